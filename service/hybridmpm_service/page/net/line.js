// Counts the frames that the line brings, beside those that the server computes.

const WINDOW_MS = 2000;
const MOST = 60; // frames a second that the server sends
const FEW = 0.7; // share of these below which the line is slow

export class Line {
  #times = []; // when the latest frames came [ms]
  #since = null; // since when they are counted [ms]; null while none are due

  /** Note that a frame has come. */
  take(now) {
    this.#times.push(now);
  }

  /**
   * Frames a second that come and that are due, {come, due}, where the line brings fewer; else null.
   *
   * @param pace frames a second that the server computes; 0 while it sends none
   */
  slow(now, pace) {
    this.#times = this.#times.filter((time) => now - time < WINDOW_MS);
    if (pace === 0) {
      this.#since = null;
      return null;
    }
    this.#since ??= now;
    const [come, due] = [(1000 * this.#times.length) / WINDOW_MS, Math.min(pace, MOST)];
    return now - this.#since >= WINDOW_MS && come < FEW * due ? { come, due } : null;
  }
}
