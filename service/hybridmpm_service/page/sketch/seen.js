// The sketch that steers and was not drawn on this page: that of the owner of a session that is watched, or of before a reload.

const OUTLINE_POINTS = 48;
const STEERS = ["steering", "out_of_reach", "holding"];

/** A sketch of a log, as the page draws sketches: {kind, points, widths}; null for a kind without strokes. */
function drawn({ kind, points, widths, center, axes, angle, width }) {
  if (kind === "arrow") return { kind, points, widths: [widths?.[0] ?? 4, widths?.at(-1) ?? 4] };
  if (kind !== "ellipse") return null;
  const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
  const outline = Array.from({ length: OUTLINE_POINTS }, (_, i) => {
    const turn = (2 * Math.PI * i) / OUTLINE_POINTS;
    const [a, b] = [axes[0] * Math.cos(turn), axes[1] * Math.sin(turn)];
    return [center[0] + a * cos - b * sin, center[1] + a * sin + b * cos];
  });
  return { kind, points: outline, widths: [width ?? 4, width ?? 4] };
}

export class SeenSketch {
  sketch = null; // null while none steers
  #number = null; // of the sketch that was asked for last
  #parts;

  /** @param parts {log() -> promise of the session's log, in the lengths of the picture; changed()} */
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
    if (control.number === this.#number) return;
    this.#number = control.number;
    try {
      const { inputs } = await this.#parts.log();
      const one = inputs.findLast(({ kind, number }) => kind === "sketch" && number === control.number);
      if (this.#number === control.number) this.#show(control.number, one === undefined ? null : drawn(one.sketch));
    } catch {
      // Who may not read the log sees the fluid alone.
    }
  }

  #show(number, sketch) {
    this.#number = number;
    if (sketch === this.sketch) return;
    this.sketch = sketch;
    this.#parts.changed();
  }
}
