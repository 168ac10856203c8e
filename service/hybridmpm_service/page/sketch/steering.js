// The life of a sketch: drawn, perhaps staged for a moment, planned by the server, followed, done.

import { classify, isDrawable, ovalBetween, strokeOf } from "./sketch.js";

/** Frames that a sketch steers: 0.25 s of simulated time, the service's default horizon. */
export const FRAMES = 100;
const STAGE_MS = 1100; // time to disagree with the guess of a freehand stroke

/**
 * Phases: "idle", "drawing", "staged" (guess shown, not sent), "planning" (server computes),
 * "following", "done".
 */
export class Steering {
  phase = "idle";
  sketch = null; // {kind, points, widths: [start, end]}
  plan = null; // the service's answer
  done = 0; // controlled frames so far
  #tool = "arrow";
  #raw = []; // samples of the stroke in progress: {point, time}
  #stageTimer = 0;
  #lastFrame = 0;
  #serial = 0; // tells answers to replaced sketches apart
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
    this.#serial += 1;
    this.#tool = tool;
    this.#raw = [sample];
    this.plan = null;
    this.#shape();
    this.#enter("drawing");
  }

  extend(samples) {
    if (this.phase !== "drawing") return;
    this.#raw.push(...samples);
    this.#shape();
    this.#handlers.changed();
  }

  #shape() {
    const points = this.#raw.map((sample) => sample.point);
    const widths = this.#handlers.widths();
    const [first, last] = [points[0], points.at(-1)];
    if (this.#tool === "arrow") this.sketch = { kind: "arrow", points: [first, last], widths };
    else if (this.#tool === "oval") this.sketch = { kind: "ellipse", points: ovalBetween(first, last), widths };
    else this.sketch = { kind: classify(points), points, widths };
  }

  /** The pointer is released: explicit tools are sent at once, a guess waits a moment. */
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

  /** The guess was wrong: take the stroke for the other kind. */
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
    const serial = this.#serial;
    try {
      const stroke = strokeOf(this.sketch, this.#handlers.dim() === 3 ? this.sketch.widths : null);
      const plan = await this.#handlers.plan(stroke, FRAMES);
      if (serial !== this.#serial) return;
      this.plan = plan;
      this.done = 0;
      this.#enter("following");
    } catch (problem) {
      if (serial !== this.#serial) return;
      this.clear();
      this.#handlers.refused(problem);
    }
  }

  /** Take the drawing away. What the server already follows goes on. */
  clear() {
    clearTimeout(this.#stageTimer);
    this.#serial += 1;
    this.sketch = null;
    this.plan = null;
    this.done = 0;
    this.#enter("idle");
  }

  /** A frame arrived: how much of the plan has been followed? */
  watch(frame) {
    const wasReset = frame < this.#lastFrame;
    this.#lastFrame = frame;
    if (this.phase !== "following" && this.phase !== "done") return;
    if (wasReset) {
      this.clear();
      return;
    }
    // The picture may still be behind the frame at which the plan was made.
    this.done = Math.min(this.plan.frames, Math.max(0, frame - this.plan.first_frame));
    if (this.phase === "following" && this.done === this.plan.frames) this.#enter("done");
  }

  /** Distance [m] between where the centre of mass ends and where it was wanted, and the angle between both ways. */
  deviation() {
    const { displacement, target_displacement: target } = this.plan;
    const norm = (vector) => Math.hypot(...vector);
    const miss = norm(displacement.map((value, axis) => value - target[axis]));
    const dot = displacement.reduce((sum, value, axis) => sum + value * target[axis], 0);
    const cosine = dot / Math.max(norm(displacement) * norm(target), 1e-9);
    return { miss, degrees: (Math.acos(Math.min(1, Math.max(-1, cosine))) * 180) / Math.PI };
  }
}
