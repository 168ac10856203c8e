// The forces that act on the fluid, asked for again and again as long as somebody wants to see them.

const EVERY_MS = 150;

export class ForceField {
  latest = null; // {cell, points, force} as the service answers it; null where nothing acts or nobody looks
  #timer = 0;
  #wanted = false;
  #ask;
  #changed;

  /** @param handlers {ask() -> promise of a field, or null while there is nobody to ask; changed()} */
  constructor({ ask, changed }) {
    this.#ask = ask;
    this.#changed = changed;
  }

  /** Whether somebody wants to see the forces. */
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
    let field = null;
    try {
      field = await this.#ask();
    } catch {
      // A session that is gone, or a server that is away, is told of elsewhere.
    }
    if (!this.#wanted) return;
    this.#take(field !== null && field.points.length > 0 ? field : null);
    this.#timer = setTimeout(() => this.#poll(), EVERY_MS);
  }

  #take(field) {
    if (field === null && this.latest === null) return;
    this.latest = field;
    this.#changed();
  }
}
