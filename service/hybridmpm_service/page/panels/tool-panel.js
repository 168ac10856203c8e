// Strength and duration of the tools: the settings of the next sketch and of the hand.

import { byId, setText } from "./dom.js";

/** Largest acceleration of a particle at full strength [g], the service's own default. */
const CAP = 15;
const LIFTED = 0.3;
const FEWEST_FRAMES = 40; // what the slider for the duration begins with, behind "automatic"

let frameDt = 0.0025; // length of a frame of the scene [s]

const strength = () => Number(byId("strength").value) / 100;
const seconds = (frames) => `${(frames * frameDt).toFixed(2)} s`;

/** Largest acceleration of a particle that the hand may give it [g]. */
export const handCap = () => CAP * strength();

/**
 * Largest force of a hand that holds a rigid body [N], in 2D per metre of depth: at full strength the weight of a square or
 * cube of water whose side is a share of the shortest way between two walls.
 *
 * @param scene in lengths of its world; @param length longest side of the world [m]
 */
export function pullStrength({ walls: { lower, upper }, gravity }, length) {
  const side = LIFTED * length * Math.min(...upper.map((high, axis) => high - lower[axis]));
  return strength() * 1000 * side ** lower.length * (Math.hypot(...gravity) || 9.81);
}

/** Settings of the next sketch: {strength, hold}, and `frames` unless their number is left to the service. */
export function sketchSettings() {
  const duration = Number(byId("duration").value);
  const settings = { strength: strength(), hold: Number(byId("hold").value) };
  return duration < FEWEST_FRAMES ? settings : { ...settings, frames: duration };
}

function describe() {
  setText("strength-out", `${byId("strength").value} %, up to ${handCap().toFixed(1)} g`);
  const duration = Number(byId("duration").value);
  setText("duration-out", duration < FEWEST_FRAMES ? "as needed" : `${seconds(duration)}, ${duration} frames`);
  const hold = Number(byId("hold").value);
  setText("hold-out", hold === 0 ? "none" : `${seconds(hold)}, ${hold} frames`);
}

/** Call `showForces(whether)` whenever the user asks to see the forces, or no more. */
export function bindToolPanel(showForces) {
  for (const id of ["strength", "duration", "hold"]) byId(id).addEventListener("input", describe);
  byId("forces").addEventListener("change", () => showForces(byId("forces").checked));
  describe();
}

/** Set the length of a frame [s], for durations. */
export function showFrameLength(length) {
  frameDt = length;
  describe();
}

/** Ask to see the forces, or no more. */
export function toggleForces() {
  byId("forces").click();
}
