// An answer of the server that is requested again and again while it is shown.

const EVERY_MS = 150;

export class Polled {
  latest = null; // the newest answer; null where there is none, or nobody looks
  #timer = 0;
  #wanted = false;
  #ask;
  #changed;

  /** @param handlers {ask() -> promise of an answer, or of null while there is none; changed()} */
  constructor({ ask, changed }) {
    this.#ask = ask;
    this.#changed = changed;
  }

  /** Whether somebody wants to see it. */
  get wanted() {
    return this.#wanted;
  }

  set wanted(value) {
    if (value === this.#wanted) return;
    this.#wanted = value;
    clearTimeout(this.#timer);
    if (value) this.#poll();
    else this.#take(null);
  }

  async #poll() {
    let answer = null;
    try {
      answer = await this.#ask();
    } catch {
      // A missing session or server is reported elsewhere.
    }
    if (!this.#wanted) return;
    this.#take(answer);
    this.#timer = setTimeout(() => this.#poll(), EVERY_MS);
  }

  #take(answer) {
    if (answer === null && this.latest === null) return;
    this.latest = answer;
    this.#changed();
  }
}
