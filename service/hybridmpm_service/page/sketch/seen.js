// What acts on the session and was not done on this page: sketch, goal and hand of the owner of a session that is watched, or of before a reload.

const OUTLINE_POINTS = 48;
const STEERS = ["steering", "out_of_reach", "holding"];

/** A sketch of an answer, as the page draws sketches: {kind, points, widths}; null for a kind without strokes. */
function drawn({ kind, points, widths, center, axes, angle, outlines, width }) {
  if (kind === "arrow") return { kind, points, widths: [widths?.[0] ?? 4, widths?.at(-1) ?? 4] };
  if (kind === "shape") return { kind, points: outlines[0], outlines, widths: [width ?? 4, width ?? 4] };
  if (kind !== "ellipse") return null;
  const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
  const outline = Array.from({ length: OUTLINE_POINTS }, (_, i) => {
    const turn = (2 * Math.PI * i) / OUTLINE_POINTS;
    const [a, b] = [axes[0] * Math.cos(turn), axes[1] * Math.sin(turn)];
    return [center[0] + a * cos - b * sin, center[1] + a * sin + b * cos];
  });
  return { kind, points: outline, widths: [width ?? 4, width ?? 4] };
}

const GLIDE_MS = 250; // from one status to the next, in which a hand is drawn from place to place
const OWN_MS = 1000; // after which the server no longer speaks of a hand that has rested here

export class Seen {
  sketch = null; // null while none steers
  goal = null; // of the sketch
  hand = null; // {point, radius}, or {point, body, grip} of one that pulls; null while none acts
  #glide = null; // {from, to, began [ms]} of the hand
  #number = null; // of the sketch that was asked for last
  #parts;

  /** @param parts {sketch() -> promise of the sketch that steers and its goal, in the lengths of the picture; changed()} */
  constructor(parts) {
    this.#parts = parts;
  }

  /** Note the control of a status; `own` is whether the page has drawn the sketch itself. */
  async note(control, own) {
    const steers = !own && STEERS.includes(control?.phase);
    if (!steers) {
      this.#show(null, null);
      return;
    }
    // Of several in turn the present one is asked for.
    const present = `${control.number} ${control.keyframe ?? 0}`;
    if (present === this.#number) return;
    this.#number = present;
    try {
      const one = await this.#parts.sketch();
      if (this.#number !== present) return;
      // Another one may have begun meanwhile: the next status says so.
      if (one?.number === control.number) this.#show(present, drawn(one.sketch), one.goal);
    } catch {
      // The connection is broken, which is shown elsewhere, or the sketch has ended.
    }
  }

  #show(number, sketch, goal = null) {
    this.#number = number;
    if (sketch === this.sketch && goal === this.goal) return;
    [this.sketch, this.goal] = [sketch, goal];
    this.#parts.changed();
  }

  /** Note the hand of a status, {point, radius}, {target, body, grip} or null; one of this page has been taken away at `rested` [ms]. */
  noteHand(hand, rested, now) {
    if (hand === null || now < rested + OWN_MS) {
      const had = this.hand !== null;
      this.hand = this.#glide = null;
      if (had) this.#parts.changed();
      return;
    }
    const place = hand.point ?? hand.target;
    this.#glide = { from: this.hand?.point ?? place, to: place, began: now };
    this.hand = { ...hand, point: this.#glide.from };
    this.#parts.changed();
  }

  /** Move the hand on; true while it moves. */
  animate(now) {
    if (this.#glide === null) return false;
    const { from, to, began } = this.#glide;
    const part = Math.min(1, Math.max(0, (now - began) / GLIDE_MS));
    this.hand = { ...this.hand, point: from.map((value, axis) => value + part * (to[axis] - value)) };
    if (part === 1) this.#glide = null;
    return true;
  }
}
