// A scene with a sketch that draws itself: the whole way from the network over the splash to the sketch and back.

import { ovalBetween } from "./sketch.js";

/** The hybrid simulator from frame 0 on; at frame 150 the fluid is to fill an oval, and the hybrid goes on. */
export const PIPELINE = {
  scene: { scenario: "water_2d", seed: 10, solver: "hybrid" },
  frame: 150,
  kind: "ellipse",
  points: ovalBetween([0.355, 0.525], [0.645, 0.715]),
};

/** Waits for the frame of a preset, each time that the simulation comes to it from an earlier one. */
export class Cue {
  #preset;
  #waits = true;

  constructor(preset) {
    this.#preset = preset;
  }

  /** Whether the sketch is to appear now, with this frame shown. */
  isNow(frame) {
    const came = this.#waits && frame >= this.#preset.frame;
    this.#waits = frame < this.#preset.frame;
    return came;
  }
}
