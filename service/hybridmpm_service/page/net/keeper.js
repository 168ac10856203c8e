// Keeps what a session can be computed again from, for a server that has lost it.

const STORED = "hybridmpm.log"; // name in the storage of this tab
const EVERY_MS = 4000;
const REST = 30; // times as long as an answer took, nothing is asked: a long log costs the server time

export class Keeper {
  #kept = null; // {id, log}: the newest
  #frame = -1; // frame of the status before the newest answer
  #next = 0; // when the log may be asked for again [ms]
  #asks = false;
  #ask;

  /** @param ask () -> promise of the log of the present session */
  constructor(ask) {
    this.#ask = ask;
  }

  /** Note a status of a session of this page; ask for its log where it has changed, at once where it rests. */
  async note({ id, frame, playing }) {
    const now = performance.now();
    const isDue = now >= this.#next || !playing;
    if (this.#asks || !isDue || (this.#kept?.id === id && this.#frame === frame)) return;
    this.#asks = true;
    try {
      const log = await this.#ask();
      this.#frame = frame;
      this.#kept = { id, log };
      this.#store();
    } catch {
      // A session that has gone is reported elsewhere, and a log that is too long is not kept.
    } finally {
      this.#asks = false;
      const end = performance.now();
      this.#next = end + Math.max(EVERY_MS, REST * (end - now));
    }
  }

  #store() {
    try {
      sessionStorage.setItem(STORED, JSON.stringify(this.#kept));
    } catch {
      // A log larger than the storage is kept as long as the page.
    }
  }

  /** The newest log of a session, also of before a reload; null where there is none. */
  logOf(id) {
    if (this.#kept?.id === id) return this.#kept.log;
    try {
      const stored = JSON.parse(sessionStorage.getItem(STORED));
      return stored?.id === id ? stored.log : null;
    } catch {
      return null;
    }
  }
}
