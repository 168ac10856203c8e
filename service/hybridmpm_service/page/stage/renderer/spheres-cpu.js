// 3D particles without a graphics card: lit discs and the surface of liquids, in a picture with a depth buffer of its own.

import { LIQUID, SAND, WATER } from "../../frames.js";
import * as palette from "./palette.js";
import { SurfacePicture } from "./surface-cpu.js";

const SPHERE_SPACINGS = 0.82;
const SHADES = 6; // colours of one material, by speed or by grain
const SCALE_STEPS = 32; // colours of a quantity
const LEVELS = 32; // brightnesses of one colour
const MAX_SIZE = 640; // pixels of the picture, which is then scaled to the stage
const MAX_SURFACE_SIZE = 440; // where a liquid is smoothed, which is the expensive part

/** Brightness ramps as packed RGBA (little-endian: red is the lowest byte), by material and shade. */
const ramps = new Map();

function rampOf(type, shade) {
  const key = type * SHADES + shade;
  if (!ramps.has(key)) ramps.set(key, makeRamp(...colorsOf(type, shade / (SHADES - 1))));
  return ramps.get(key);
}

const scaleRamps = Array.from({ length: SCALE_STEPS }, (_, step) => {
  const bright = palette.onScale(step / (SCALE_STEPS - 1));
  return makeRamp(bright.map((channel) => 0.42 * channel), bright);
});

function colorsOf(type, t) {
  if (type === SAND) {
    const bright = palette.mix(palette.SAND_DARK, palette.SAND_LIGHT, 0.35 + 0.65 * t);
    return [bright.map((channel) => 0.42 * channel), bright];
  }
  if (type === WATER) {
    return [
      palette.mix(palette.WATER_DEEP, palette.WATER_SHALLOW, 0.6 * t),
      palette.mix(palette.WATER_SHALLOW, palette.WATER_CREST, 0.7 * t),
    ];
  }
  return type === LIQUID ? [palette.LIQUID_DEEP, palette.LIQUID_SHALLOW] : [palette.GOOP_DEEP, palette.GOOP_SHALLOW];
}

function makeRamp(deep, bright) {
  return Uint32Array.from({ length: LEVELS }, (_, level) => {
    const facing = level / (LEVELS - 1);
    const gleam = 70 * facing ** 12;
    const [r, g, b] = palette.mix(deep, bright, 0.12 + 0.88 * facing).map((value) => Math.min(255, value + gleam));
    return ((255 << 24) | (b << 16) | (g << 8) | r) >>> 0;
  });
}

/** The pixels of a sphere of integer radius: offsets, height (0 .. 1) and brightness of each. */
const discs = new Map();

function discOf(radius) {
  if (discs.has(radius)) return discs.get(radius);
  const pixels = [];
  for (let dy = -radius; dy <= radius; dy += 1) {
    for (let dx = -radius; dx <= radius; dx += 1) {
      const [x, y] = [dx / (radius + 0.3), -dy / (radius + 0.3)];
      const height = Math.sqrt(1 - x * x - y * y);
      if (Number.isNaN(height)) continue;
      const facing = Math.max(0, -0.37 * x + 0.78 * y + 0.51 * height);
      pixels.push({ dx, dy, height, level: Math.round(facing * (LEVELS - 1)) });
    }
  }
  discs.set(radius, pixels);
  return pixels;
}

/** Draws all particles of a 3D scene; keeps its buffers between frames. */
export class SpherePicture {
  #size = 0;
  #canvas = document.createElement("canvas");
  #image = null;
  #pixels = null;
  #depths = null;
  #surface = new SurfacePicture();

  /** @param bodies rigid ones, or null */
  draw(context, view, scene, particles, bodies) {
    drawShadows(context, view, scene, particles.positions);
    // Coloured by a quantity each particle is to be seen.
    const flows = particles.quantities === null && scene.types.some((type) => type !== SAND);
    this.#resize(Math.min(flows ? MAX_SURFACE_SIZE : MAX_SIZE, Math.round(view.width)));
    this.#pixels.fill(0);
    this.#depths.fill(-Infinity);
    bodies?.fill(view, { size: this.#size, pixels: this.#pixels, depths: this.#depths });
    for (let i = 0; i < scene.types.length; i += 1) {
      if (!flows || scene.types[i] === SAND) this.#add(view, scene, particles, i);
    }
    if (flows) {
      this.#surface.compute(view, scene, particles, this.#size);
      this.#surface.light(view, this.#pixels, this.#depths);
    }
    this.#canvas.getContext("2d").putImageData(this.#image, 0, 0);
    context.drawImage(this.#canvas, 0, 0, view.width, view.height);
  }

  #lookOf(scene, speeds, i) {
    const type = scene.types[i];
    const shade = type === WATER ? speeds[i] / 256 : palette.grainShade(scene, i);
    return rampOf(type, Math.floor(shade * SHADES));
  }

  #resize(size) {
    if (size === this.#size) return;
    this.#size = size;
    this.#canvas.width = size;
    this.#canvas.height = size;
    this.#image = new ImageData(size, size);
    this.#pixels = new Uint32Array(this.#image.data.buffer);
    this.#depths = new Float32Array(size * size);
  }

  #add(view, scene, { positions, speeds, quantities }, i) {
    const place = view.project([positions[3 * i] / 65535, positions[3 * i + 1] / 65535, positions[3 * i + 2] / 65535]);
    const scale = this.#size / view.width;
    const reach = SPHERE_SPACINGS * scene.spacing;
    const radius = Math.max(1, Math.round((reach * view.pixelsPerMetre * scale) / (1 - view.perspective * place[2])));
    const ramp = quantities === null ? this.#lookOf(scene, speeds, i) : scaleRamps[Math.floor((quantities[i] / 256) * SCALE_STEPS)];
    const [cx, cy] = [Math.round(place[0] * scale), Math.round(place[1] * scale)];
    for (const { dx, dy, height, level } of discOf(radius)) {
      const [x, y] = [cx + dx, cy + dy];
      if (x < 0 || y < 0 || x >= this.#size || y >= this.#size) continue;
      const at = y * this.#size + x;
      const depth = place[2] + reach * height;
      if (depth <= this.#depths[at]) continue;
      this.#depths[at] = depth;
      this.#pixels[at] = ramp[level];
    }
  }
}

/** The floor cells with something above them, darkened. */
function drawShadows(context, view, scene, positions) {
  if (view.pitch < 0.05) return; // the floor is seen from the edge
  const cell = 2.5 * scene.spacing;
  const seen = new Set();
  context.beginPath();
  for (let i = 0; i < positions.length; i += 3) {
    const column = Math.floor(positions[i] / 65535 / cell);
    const row = Math.floor(positions[i + 2] / 65535 / cell);
    const key = row * 65536 + column;
    if (seen.has(key)) continue;
    seen.add(key);
    const corner = (across, along) => view.project([(column + across) * cell, scene.walls.lower[1], (row + along) * cell]);
    const [first, ...others] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
    context.moveTo(first[0], first[1]);
    for (const [px, py] of others) context.lineTo(px, py);
    context.closePath();
  }
  context.fillStyle = "rgb(0 0 0 / 0.45)";
  context.fill();
}
