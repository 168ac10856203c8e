// The life of a sketch: drawn, perhaps staged for a moment, planned by the server, followed, done.

import { classify, isDrawable, ovalFrom, strokeOf } from "./sketch.js";

/** Frames that a sketch steers: 0.25 s of simulated time, the service's default horizon. */
export const FRAMES = 100;
const STAGE_MS = 1100; // time in which the user may correct the guess for a freehand stroke

/**
 * One sketch after the other. Its phases are "idle", "drawing", "staged" (the guess is shown, not yet sent),
 * "planning" (the server computes), "following" and "done".
 */
export class Steering {
  phase = "idle";
  sketch = null; // {kind, points, widths: [start, end]}
  plan = null; // the service's answer
  framesDone = 0; // number of frames that the sketch has steered so far
  #tool = "arrow";
  #samples = []; // points of the stroke in progress: {point, time}
  #stageTimer = 0;
  #lastFrame = 0;
  #attempt = 0; // number of the present sketch, which tells answers to replaced ones apart
  #handlers;

  /** @param handlers {plan(stroke, frames) -> promise, dim(), widths(), changed(), refused(problem), tooSmall()} */
  constructor(handlers) {
    this.#handlers = handlers;
  }

  #enter(phase) {
    this.phase = phase;
    this.#handlers.changed();
  }

  begin(tool, sample) {
    clearTimeout(this.#stageTimer);
    this.#attempt += 1;
    this.#tool = tool;
    this.#samples = [sample];
    this.plan = null;
    this.#updateSketch();
    this.#enter("drawing");
  }

  extend(samples) {
    if (this.phase !== "drawing") return;
    this.#samples.push(...samples);
    this.#updateSketch();
    this.#handlers.changed();
  }

  #updateSketch() {
    const points = this.#samples.map((sample) => sample.point);
    const widths = this.#handlers.widths();
    const [first, last] = [points[0], points.at(-1)];
    if (this.#tool === "arrow") this.sketch = { kind: "arrow", points: [first, last], widths };
    else if (this.#tool === "oval") this.sketch = { kind: "ellipse", points: ovalFrom(points), widths };
    else this.sketch = { kind: classify(points), points, widths };
  }

  /** End the stroke. Arrow and oval are sent at once; the guess for a free stroke waits a moment. */
  finish() {
    if (this.phase !== "drawing") return;
    if (!isDrawable(this.sketch)) {
      this.clear();
      this.#handlers.tooSmall();
    } else if (this.#tool === "free") {
      this.#stage();
    } else {
      this.#send();
    }
  }

  #stage() {
    clearTimeout(this.#stageTimer);
    this.#stageTimer = setTimeout(() => this.#send(), STAGE_MS);
    this.#enter("staged");
  }

  /** Take a stroke that was guessed wrongly for the other kind. */
  switchKind() {
    if (this.phase !== "staged") return;
    const other = { ...this.sketch, kind: this.sketch.kind === "arrow" ? "ellipse" : "arrow" };
    if (!isDrawable(other)) {
      this.#handlers.tooSmall();
      return;
    }
    this.sketch = other;
    this.#stage();
  }

  async #send() {
    this.#enter("planning");
    const serial = this.#attempt;
    try {
      const stroke = strokeOf(this.sketch, this.#handlers.dim() === 3 ? this.sketch.widths : null);
      const plan = await this.#handlers.plan(stroke, FRAMES);
      if (serial !== this.#attempt) return;
      this.plan = plan;
      this.framesDone = 0;
      this.#enter("following");
    } catch (problem) {
      if (serial !== this.#attempt) return;
      this.clear();
      this.#handlers.refused(problem);
    }
  }

  /** Take the sketch off the picture. A motion that the server follows already goes on. */
  clear() {
    clearTimeout(this.#stageTimer);
    this.#attempt += 1;
    this.sketch = null;
    this.plan = null;
    this.framesDone = 0;
    this.#enter("idle");
  }

  /** Note that a frame is shown, and so how much of the plan has been followed. */
  follow(frame) {
    const wasReset = frame < this.#lastFrame;
    this.#lastFrame = frame;
    if (this.phase !== "following" && this.phase !== "done") return;
    if (wasReset) {
      this.clear();
      return;
    }
    // The picture may still be behind the frame at which the plan begins.
    this.framesDone = Math.min(this.plan.frames, Math.max(0, frame - this.plan.first_frame));
    if (this.phase === "following" && this.framesDone === this.plan.frames) this.#enter("done");
  }

  /** Distance [m] between the planned end of the centre of mass and the target, and angle between both ways. */
  deviation() {
    const { displacement, target_displacement: target } = this.plan;
    const norm = (vector) => Math.hypot(...vector);
    const miss = norm(displacement.map((value, axis) => value - target[axis]));
    const dot = displacement.reduce((sum, value, axis) => sum + value * target[axis], 0);
    const cosine = dot / Math.max(norm(displacement) * norm(target), 1e-9);
    return { miss, degrees: (Math.acos(Math.min(1, Math.max(-1, cosine))) * 180) / Math.PI };
  }
}
