// The pictures of the last seconds, kept as what they were drawn from: the film of what was seen draws them again.

const SECONDS = 10; // length of the film
const SPACING_MS = 38; // at least from one kept picture to the next: a film has 25 a second
const STILL_MS = 400; // a picture that rests for longer is cut to this
const MOST_BYTES = 48e6;

export class Recent {
  #moments = []; // {at: time in the film [ms], bytes, of: what Stage.moment gives}
  #latest = 0; // when the newest one was drawn [ms]
  #bytes = 0;

  /** Forget all: another scene is shown. */
  clear() {
    this.#moments = [];
    this.#bytes = 0;
  }

  /** Note that a picture was drawn; `moment()` is called where it is kept. */
  note(now, moment) {
    const last = this.#moments.at(-1);
    if (last !== undefined && now - this.#latest < SPACING_MS) return;
    const of = moment();
    if (of === null) return;
    const at = last === undefined ? 0 : last.at + Math.min(now - this.#latest, STILL_MS);
    const bytes = last?.of.frame === of.frame ? 0 : of.frame.positions.buffer.byteLength + of.speeds.byteLength;
    this.#moments.push({ at, bytes, of });
    this.#latest = now;
    this.#bytes += bytes;
    while (at - this.#moments[0].at > 1000 * SECONDS || this.#bytes > MOST_BYTES) this.#bytes -= this.#moments.shift().bytes;
  }

  /** What was seen, oldest first: {at: time in the film [ms], of: the moment}. */
  get moments() {
    const [first] = this.#moments;
    return this.#moments.map(({ at, of }) => ({ at: at - first.at, of }));
  }
}
