// Sketches that draw themselves: that of a first visit, drawn by a ghost hand, and that of the whole pipeline.

import { ovalBetween, resample } from "./sketch/sketch.js";

const GHOST_POINTS = 60; // points of a sketch that a ghost hand draws one after the other
const LOOK_FRAMES = 60; // frames for which the first sketch stays on the picture when it is done

/**
 * A scene whose sketch draws itself at a frame, within `seconds` of the wall clock. A preset that repeats is drawn
 * again after a reset; any touch of mouse, finger or key ends the others.
 */
export const PIPELINE = {
  scene: { scenario: "water_2d", seed: 10, solver: "hybrid" },
  frame: 150,
  sketch: { kind: "ellipse", points: ovalBetween([0.355, 0.525], [0.645, 0.715]) },
  settings: {},
  seconds: 0,
  repeats: true,
};

/** The same in 3D, where a learned plan leads the water. */
export const PIPELINE_3D = {
  ...PIPELINE,
  scene: { scenario: "water_3d", seed: 10, solver: "hybrid" },
};

/** Presets by their name in the address. */
export const PIPELINES = new Map([
  ["pipeline", PIPELINE],
  ["pipeline-3d", PIPELINE_3D],
]);

export const WELCOME = {
  scene: { scenario: "water_2d", seed: 0, solver: "mpm", coarse: null },
  frame: 110,
  sketch: { kind: "ellipse", points: ovalBetween([0.34, 0.5], [0.66, 0.76]) },
  settings: { hold: 40 },
  seconds: 1.3,
  repeats: false,
};

/** Presents the sketch of a preset when its frame is shown, unless the visitor draws at that moment. */
export class Presenter {
  ghost = null; // {sketch: as far as the ghost hand has drawn it, hand: [x, y]}; null while it draws nothing
  #preset = null;
  #presented = false; // whether the sketch of a first visit is on the picture
  #frame = 0; // frame that was shown last
  #began = 0; // when the ghost hand began [ms]
  #steering;

  constructor(steering) {
    this.#steering = steering;
  }

  /** Take another preset, or none. */
  set(preset) {
    this.#preset = preset;
    this.#presented = false;
    this.#frame = 0;
    this.ghost = null;
  }

  /** Note a touch of mouse, finger or key. */
  interrupt() {
    this.#presented = false;
    if (this.#preset !== null && !this.#preset.repeats) this.set(null);
  }

  /** Note that a frame is shown. */
  follow(frame, now) {
    const isCue = this.#preset !== null && this.#frame < this.#preset.frame && frame >= this.#preset.frame;
    this.#frame = frame;
    if (this.#presented) this.#clearWhenDone(frame);
    if (!isCue || this.#steering.phase !== "idle") return;
    this.#began = now;
    this.#draw(now);
  }

  /** Move on with the ghost hand; true while it draws. */
  animate(now) {
    if (this.ghost === null) return false;
    this.#draw(now);
    return true;
  }

  #draw(now) {
    const { sketch, seconds, settings, repeats } = this.#preset;
    const part = seconds === 0 ? 1 : Math.min(1, Math.max(0, now - this.#began) / (1000 * seconds));
    if (part < 1) {
      // The hand begins and ends at rest, as hands do.
      const eased = part * part * (3 - 2 * part);
      const points = resample(sketch.points, GHOST_POINTS).slice(0, Math.max(2, Math.ceil(eased * GHOST_POINTS)));
      this.ghost = { sketch: { ...sketch, points }, hand: points.at(-1) };
      return;
    }
    this.ghost = null;
    this.#steering.present(sketch, settings);
    if (repeats) return;
    this.#preset = null;
    this.#presented = true;
  }

  /** Remove the sketch some time after its end. */
  #clearWhenDone(frame) {
    const { phase, plan } = this.#steering;
    if (phase !== "done" || frame < plan.first_frame + plan.frames + plan.hold + LOOK_FRAMES) return;
    this.#presented = false;
    this.#steering.clear();
  }
}
