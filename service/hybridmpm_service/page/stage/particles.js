// Estimates of the speeds of particles, which renderers need besides positions.

/** Speed that the byte 255 stands for [m/s]. */
export const FASTEST = 4;

/** Where each of the ascending `ids` stands among `others`, ascending too; -1 where it does not. */
function placesOf(ids, others) {
  let place = 0;
  return Int32Array.from(ids, (id) => {
    while (place < others.length && others[place] < id) place += 1;
    return others[place] === id ? place : -1;
  });
}

/** Speeds of the particles, one byte each (255 = FASTEST), estimated from successive frames and smoothed. */
export class SpeedEstimate {
  #last = null;
  #length;
  bytes = new Uint8Array(0);

  /** @param length longest side of the world [m], which the largest position stands for */
  constructor(length = 1) {
    this.#length = length;
  }

  update(frame) {
    const last = this.#last;
    this.#last = frame;
    const elapsed = last === null ? -1 : frame.time - last.time;
    if (elapsed < 0) this.bytes = new Uint8Array(frame.count);
    else if (elapsed > 0) this.#blend(last, frame, (255 * this.#length) / (65535 * elapsed * FASTEST));
  }

  #blend(last, { count, dim, ids, positions }, scale) {
    const places = ids === null ? null : placesOf(ids, last.ids);
    const before = this.bytes;
    this.bytes = new Uint8Array(count);
    for (let i = 0; i < count; i += 1) {
      const place = places === null ? i : places[i];
      if (place < 0) continue; // a new particle
      let squared = 0;
      for (let axis = 0; axis < dim; axis += 1) {
        squared += (positions[i * dim + axis] - last.positions[place * dim + axis]) ** 2;
      }
      this.bytes[i] = 0.6 * before[place] + 0.4 * Math.min(255, Math.sqrt(squared) * scale);
    }
  }
}
