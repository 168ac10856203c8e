// Notices a server that is connected and says nothing: it sends a status four times a second.

const LONGEST_MS = 2000;

export class Silence {
  #heard = 0; // time of the newest message [ms]
  #is = false;
  #changed;

  /** @param changed () -> called when silence begins or ends */
  constructor(changed) {
    this.#changed = changed;
    window.addEventListener("offline", () => this.#become(true));
  }

  /** Whether nothing is heard. */
  get is() {
    return this.#is;
  }

  /** Note a message, or that there is no connection to hear from. */
  hear() {
    this.#heard = performance.now();
    this.#become(false);
  }

  /** Find out whether it has been silent; to be called regularly while there is a connection. */
  listen() {
    if (performance.now() - this.#heard > LONGEST_MS) this.#become(true);
  }

  #become(value) {
    if (value === this.#is) return;
    this.#is = value;
    this.#changed();
  }
}
