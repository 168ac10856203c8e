// A hand in the fluid: while it is held, its place and velocity are sent to the server.

/** Radius within which the hand pushes [m]. */
export const RADIUS = 0.08;
const SEND_MS = 33; // faster than frames are played at the usual speeds
const WINDOW_SECONDS = 0.08; // time over which the velocity is measured: one step of a mouse is too coarse
const MAX_SPEED = 5; // m/s of simulated time; a quick flick in slow motion would tear the fluid apart

/** Velocity [m per second of the wall clock] over the latest samples {point, time}; 0 once they are old. */
export function velocityOf(samples, now) {
  const recent = samples.filter((sample) => now - sample.time < WINDOW_SECONDS);
  if (recent.length < 2) return samples[0].point.map(() => 0);
  const [first, last] = [recent[0], recent.at(-1)];
  const seconds = Math.max(now - first.time, 1e-3);
  return last.point.map((value, axis) => (value - first.point[axis]) / seconds);
}

/** The same velocity in simulated time, which passes `speed` times as fast, and at most as fast as is allowed. */
export function simulated(velocity, speed) {
  const size = Math.hypot(...velocity) / speed;
  const factor = size > MAX_SPEED ? MAX_SPEED / size : 1;
  return velocity.map((value) => (value / speed) * factor);
}

export class Hand {
  point = null; // where the hand is; null while it is not held
  held = null; // {body, grip} of the rigid body that it holds; null where it pushes
  rested = -Infinity; // when it was taken away last [ms]; now, while it is held
  #pulledTo = null; // the latest target of what it holds
  #samples = [];
  #timer = 0;
  #handlers;

  /** @param handlers {speed() -> simulated seconds per second, cap() -> largest acceleration [g],
   *   isHere() -> whether this tab simulates, push({point, velocity, radius, cap}), pull({body, grip, target, reach}), end(), changed()} */
  constructor(handlers) {
    this.#handlers = handlers;
  }

  /** @param held {body, grip} of the rigid body under the hand; null where there is none */
  begin(sample, held = null) {
    [this.held, this.#pulledTo] = [held, null];
    this.#samples = [sample];
    this.point = sample.point;
    this.rested = Infinity;
    clearInterval(this.#timer);
    this.#timer = setInterval(() => this.#send(), SEND_MS);
    this.#send();
    this.#handlers.changed();
  }

  extend(samples) {
    if (this.point === null) return;
    this.#samples = [...this.#samples, ...samples].slice(-64);
    this.point = samples.at(-1).point;
    // No network lies between: each move acts in the next frame.
    if (this.#handlers.isHere()) this.#send();
    this.#handlers.changed();
  }

  finish() {
    if (this.point === null) return;
    clearInterval(this.#timer);
    this.point = this.held = null;
    this.rested = performance.now();
    this.#handlers.end();
    this.#handlers.changed();
  }

  #send() {
    if (this.held !== null) {
      // A pull stays as it is: only another target has to be said.
      if (this.point !== this.#pulledTo) this.#handlers.pull({ ...this.held, target: this.point, reach: RADIUS });
      this.#pulledTo = this.point;
      return;
    }
    const velocity = simulated(velocityOf(this.#samples, performance.now() / 1000), this.#handlers.speed());
    this.#handlers.push({ point: this.point, velocity, radius: RADIUS, cap: this.#handlers.cap() });
  }
}
