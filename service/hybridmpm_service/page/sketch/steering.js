// The life of a sketch: drawn, perhaps staged for a moment, planned by the server, followed, held, done.

import { arrowAlong, isDrawable, kindOf, ovalFrom, startingAt, strokeOf } from "./sketch.js";

const STAGE_MS = 1100; // time in which the user may correct the guess for a freehand stroke

/**
 * One sketch after the other. Its phases are "idle", "drawing", "staged" (the guess is shown, not yet sent),
 * "proposed" (what no hand has drawn is shown, not yet sent), "planning" (the server plans while the simulation goes on), "following", "holding" and "done".
 */
export class Steering {
  phase = "idle";
  sketch = null; // {kind, points, widths: [start, end]}
  plan = null; // the service's answer
  framesDone = 0; // number of frames that the sketch has steered so far
  reached = null; // {inside, miss} once the frames of the sketch are over
  keyframe = null; // number of the goal that is followed, of several in turn
  #turn = []; // keyframes that are followed in turn
  #guess = "arrow"; // kind that a free stroke was read as
  #tool = "arrow";
  #samples = []; // points of the stroke in progress: {point, time}
  #isBeside = false; // whether the stroke in progress begins beside the fluid
  #stageTimer = 0;
  #lastFrame = 0;
  #seen = false; // whether the server has said that this sketch steers
  #attempt = 0; // number of the present sketch; answers to replaced ones have others
  #call = new AbortController(); // takes back the call that asks for the plan
  #handlers;

  /** @param handlers {plan(stroke or keyframes, settings, signal) -> promise, goal() -> promise of the present one, collected(sketch, stroke) -> whether it waits for its turn, settings() -> those of the next sketch, release(), dim(), widths(),
   *   isBeside(point) -> whether there is no fluid, middle() -> that of the fluid, {point, width}, or null, changed(), refused(problem), planned(plan), tapped(point) -> whether that chose who is to move, tooSmall()} */
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
    this.#isBeside = this.#handlers.isBeside(sample.point);
    this.#forget();
    this.#updateSketch();
    this.#enter("drawing");
  }

  extend(samples) {
    if (this.phase !== "drawing") return;
    this.#samples.push(...samples);
    this.#updateSketch();
    this.#handlers.changed();
  }

  /** The depth of the stroke in progress has changed. */
  deepen() {
    if (this.phase !== "drawing") return;
    this.#updateSketch();
    this.#handlers.changed();
  }

  #updateSketch() {
    const points = this.#samples.map((sample) => sample.point);
    if (this.#tool === "arrow") this.sketch = this.#arrow(arrowAlong(points));
    else if (this.#tool === "shape") this.sketch = this.#free("shape");
    else if (this.#tool === "oval") this.sketch = { kind: "ellipse", points: ovalFrom(points), widths: this.#handlers.widths() };
    else this.sketch = this.#free(kindOf(points));
  }

  #free(kind) {
    const points = this.#samples.map((sample) => sample.point);
    return kind === "arrow" ? this.#arrow(points) : { kind, points, widths: this.#handlers.widths() };
  }

  /** What is drawn is what is done: an arrow that begins beside the fluid begins in its middle, and ends where it ends. */
  #arrow(points) {
    const widths = this.#handlers.widths();
    const middle = this.#isBeside ? this.#handlers.middle() : null; // which moves while one draws
    if (middle === null) return { kind: "arrow", points, widths };
    return { kind: "arrow", points: startingAt(middle.point, points), widths: [middle.width, widths[1]] };
  }

  /** End the stroke. Arrow and oval are sent at once; the guess for a free stroke waits a moment. */
  finish() {
    if (this.phase !== "drawing") return;
    const points = this.#samples.map(({ point }) => point);
    if (!isDrawable({ ...this.sketch, points: this.sketch.kind === "arrow" ? points : this.sketch.points })) {
      const [point] = points;
      this.clear();
      if (!this.#handlers.tapped(point)) this.#handlers.tooSmall();
    } else if (this.#tool === "free") {
      this.#guess = this.sketch.kind;
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

  /** Send a sketch that no hand has drawn, with settings of its own. */
  present(sketch, settings) {
    this.clear();
    this.sketch = { ...sketch, widths: this.#handlers.widths() };
    this.#send(settings);
  }

  /** Show a shape that no hand has drawn, {points, outlines}, which is sent by `accept`. */
  propose(shape) {
    this.clear();
    this.sketch = { kind: "shape", ...shape, widths: this.#handlers.widths() };
    this.#enter("proposed");
  }

  accept() {
    if (this.phase === "proposed") this.#send();
  }

  /** The next kind that a staged stroke may be: after the guess the others in turn. */
  get otherKind() {
    const order = [this.#guess, ...["ellipse", "arrow", "shape"].filter((kind) => kind !== this.#guess)];
    return order[(order.indexOf(this.sketch?.kind) + 1) % order.length];
  }

  /** Take a stroke that was guessed wrongly for the next kind. */
  switchKind() {
    if (this.phase !== "staged") return;
    const other = this.#free(this.otherKind);
    if (!isDrawable(other)) {
      this.#handlers.tooSmall();
      return;
    }
    this.sketch = other;
    this.#stage();
  }

  /** Send keyframes, {sketch, goal, frames, hold}, to be followed in turn. */
  inTurn(keyframes, settings) {
    this.clear();
    this.sketch = keyframes[0].sketch;
    this.#turn = keyframes;
    this.#plan(
      keyframes.map(({ goal, frames, hold, who }) => ({ ...(goal.kind === "shape" ? { sketch: goal } : { strokes: [goal] }), frames, hold, who })),
      settings,
    );
  }

  #send(settings = this.#handlers.settings()) {
    const stroke = strokeOf(this.sketch, this.#handlers.dim() === 3 ? this.sketch.widths : null);
    if (this.#handlers.collected(this.sketch, stroke)) this.clear();
    else this.#plan(stroke, settings);
  }

  async #plan(drawing, settings) {
    this.#enter("planning");
    const serial = this.#attempt;
    this.#call.abort();
    this.#call = new AbortController();
    try {
      const plan = await this.#handlers.plan(drawing, settings, this.#call.signal);
      if (serial !== this.#attempt) return;
      this.plan = plan;
      this.#enter("following");
      this.#handlers.planned(plan);
    } catch (problem) {
      if (serial !== this.#attempt) return;
      this.clear();
      this.#handlers.refused(problem);
    }
  }

  /** Frames that the present keyframe has left; null where none is followed. */
  get left() {
    if (this.keyframe === null || this.plan === null) return null;
    const { start, frames } = this.plan.keyframes[this.keyframe];
    return Math.max(1, start + frames - this.framesDone);
  }

  /** Take the sketch back: if the server plans or follows it, it lets go. */
  takeBack() {
    if (["planning", "following", "holding"].includes(this.phase)) this.#handlers.release();
    this.clear();
  }

  /** Take the sketch off the picture; what the server has planned already stays with it. */
  clear() {
    clearTimeout(this.#stageTimer);
    this.#call.abort();
    this.#attempt += 1;
    this.sketch = null;
    this.#forget();
    this.#enter("idle");
  }

  /** Show the goal of a keyframe, as soon as the service leads to it. */
  async #showTurn(number) {
    if (number === this.keyframe) return;
    this.keyframe = number;
    this.sketch = this.#turn[number].sketch;
    const { plan } = this;
    const goal = await this.#handlers.goal().catch(() => null);
    if (plan !== this.plan) return;
    if (goal !== null) this.plan = { ...plan, goal };
    this.#handlers.changed();
  }

  #forget() {
    this.#turn = [];
    this.keyframe = null;
    this.plan = null;
    this.reached = null;
    this.framesDone = 0;
    this.#seen = false;
  }

  /** Note that a frame is shown, and so how much of the plan has been followed. */
  follow(frame) {
    const wasReset = frame < this.#lastFrame;
    this.#lastFrame = frame;
    if (this.plan === null) return;
    if (wasReset) {
      this.clear();
      return;
    }
    const { frames, hold, first_frame: first } = this.plan;
    // The picture may still be behind the frame at which the plan begins.
    this.framesDone = Math.min(frames + hold, Math.max(0, frame - first));
    const phase = this.framesDone < frames ? "following" : this.framesDone < frames + hold ? "holding" : "done";
    if (phase !== this.phase) this.#enter(phase);
  }

  /** Note what the server says of the newest sketch: what was reached, or that somebody else has ended it. */
  note(control) {
    if (this.plan === null) return;
    if (control?.number === this.plan.number) {
      this.#seen = true;
      if (this.#turn.length > 0 && control.keyframe !== null && control.keyframe !== undefined) this.#showTurn(control.keyframe);
      if (control.miss === null || this.reached !== null) return;
      // In 3D only the front view is drawn, and a learned plan chooses the depth.
      const inside = control.inside === null ? null : Math.max(control.inside, control.inside_drawn ?? 0);
      this.reached = { inside, miss: control.miss };
      this.#handlers.changed();
    } else if (this.#seen && control?.phase !== "preparing") {
      this.clear();
    }
  }
}
