// The chosen tool, and the pointers on the stage that use it.

import * as controls from "./panels/controls.js";
import { clearHints } from "./panels/messages.js";
import { StageKeys } from "./sketch/keys.js";
import { StagePointer } from "./sketch/pointer.js";
import { depthOfWidth } from "./sketch/sketch.js";
import { sidesOf } from "./stage/units.js";

export class Tools {
  name = "push";
  #scene = null;
  #depth = null; // of what the hand holds; null where it holds nothing
  #parts;
  #pointer;
  #keys;

  /** @param parts {stage, steering, hand, isLive(), play(), glides() -> whether the camera may, changed()} */
  constructor(overlay, parts) {
    this.#parts = parts;
    const handlers = {
      mode: () => (this.name === "orbit" ? "orbit" : "stroke"),
      begin: (sample) => this.#begin(sample),
      extend: (samples) => this.#extend(samples),
      finish: () => (parts.hand.point === null ? parts.steering.finish() : parts.hand.finish()),
      cancel: () => (parts.hand.point === null ? parts.steering.clear() : parts.hand.finish()),
      orbit: (dx, dy) => {
        parts.stage.view.orbit(dx, dy);
        parts.stage.invalidateView();
      },
      deepen: (steps) => this.#deepen(steps),
      zoom: (factor) => {
        parts.stage.view.zoomBy(factor);
        parts.stage.invalidateView();
      },
    };
    this.#pointer = new StagePointer(overlay, handlers);
    this.#keys = new StageKeys(overlay, { ...handlers, cursor: (at) => parts.stage.showCursor(at) });
  }

  /** Take another scene, with the tool that it is best looked at with. */
  setScene(scene) {
    this.#scene = scene;
    controls.showTools(scene.dim);
    this.choose(scene.dim === 3 ? "orbit" : this.name === "orbit" ? "push" : this.name);
  }

  choose(name) {
    const inSpace = this.#scene?.dim === 3;
    if (name === "orbit" && !inSpace) return;
    const switched = name !== this.name;
    this.name = name;
    if (inSpace && switched) {
      this.#parts.stage.view.glideTo(name !== "orbit", performance.now(), this.#parts.glides());
    }
    this.#parts.changed();
  }

  /** Drop the stroke in progress, or else take back the sketch that steers. */
  escape() {
    const { steering, hand } = this.#parts;
    if (steering.phase === "drawing" || hand.point !== null) {
      this.#pointer.abort();
      this.#keys.abort();
    } else steering.takeBack();
  }

  /** Move what is drawn, or the end of what is being drawn, towards the viewer; returns whether the scene has a depth. */
  #deepen(steps) {
    if (this.#scene?.dim !== 3) return false;
    const { steering, changed } = this.#parts;
    controls.deepen(steps, steering.phase === "drawing");
    steering.deepen();
    changed();
    return true;
  }

  #begin(sample) {
    const { stage, steering, hand, isLive, play } = this.#parts;
    if (!isLive()) return;
    clearHints();
    // Strokes are taken in the front view, which the camera reaches at once for them.
    if (stage.view.settle(Infinity)) stage.invalidateView();
    if (this.name === "push") {
      play();
      const taken = this.#sampleOf(sample);
      const hit = stage.bodyAt(taken.point);
      this.#depth = hit?.point[2] ?? null;
      hand.begin(this.#inDepth(taken), hit === null ? null : { body: hit.body, grip: hit.grip });
    } else {
      steering.begin(this.name, this.#sampleOf(sample));
    }
  }

  #extend(samples) {
    const { steering, hand } = this.#parts;
    const taken = samples.map((sample) => this.#sampleOf(sample));
    if (hand.point === null) steering.extend(taken);
    else hand.extend(taken.map((sample) => this.#inDepth(sample)));
  }

  /** A pointer's position as a point inside the world box. */
  #sampleOf({ at, time }) {
    const sides = sidesOf(this.#scene);
    const clamp = (value, axis) => Math.min(sides[axis], Math.max(0, value));
    return { point: this.#parts.stage.view.unproject(...at).map(clamp), time };
  }

  /** In 3D a hand pushes at the depth that a stroke would begin at, and pulls at that of what it holds. */
  #inDepth({ point, time }) {
    if (this.#scene.dim === 2) return { point, time };
    const { lower, upper } = this.#scene.walls;
    const depth = this.#depth ?? lower[2] + depthOfWidth(controls.depthWidths()[0]) * (upper[2] - lower[2]);
    return { point: [...point, depth], time };
  }
}
