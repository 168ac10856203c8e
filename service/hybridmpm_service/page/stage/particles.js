// What renderers need besides positions: the spacing of the particles, and estimates of their speeds.

/** Speed that the byte 255 stands for [m/s]. */
export const FASTEST = 4;
const NEIGHBOURS = 16;
const PROBES = 40;

/** Distance from particle `probe` to the 16th nearest other, in units of `positions`. */
function neighbourDistance(positions, dim, probe) {
  const nearest = new Float64Array(NEIGHBOURS).fill(Infinity); // ascending
  const count = positions.length / dim;
  for (let i = 0; i < count; i += 1) {
    let squared = 0;
    for (let axis = 0; axis < dim; axis += 1) squared += (positions[i * dim + axis] - positions[probe * dim + axis]) ** 2;
    if (i === probe || squared >= nearest[NEIGHBOURS - 1]) continue;
    let slot = NEIGHBOURS - 1;
    while (slot > 0 && nearest[slot - 1] > squared) {
      nearest[slot] = nearest[slot - 1];
      slot -= 1;
    }
    nearest[slot] = squared;
  }
  return Math.sqrt(nearest[NEIGHBOURS - 1]);
}

/**
 * Mean spacing of the particles in metres: the side of the square (cube) that one particle fills.
 *
 * It is taken from the distance of the 16th neighbour, which the jitter of single particles hardly changes.
 */
export function spacingOf(positions, dim) {
  const count = positions.length / dim;
  if (count <= NEIGHBOURS) return 0.01;
  const distances = Array.from({ length: PROBES }, (_, i) =>
    neighbourDistance(positions, dim, Math.floor((i * count) / PROBES)),
  ).sort((a, b) => a - b);
  const radius = distances[Math.floor(PROBES / 3)] / 65535; // the lower third: probes at the surface see further
  const ball = dim === 2 ? Math.PI * radius ** 2 : (4 / 3) * Math.PI * radius ** 3;
  return (ball / (NEIGHBOURS + 1)) ** (1 / dim);
}

/** Speeds of the particles, one byte each (255 = FASTEST), estimated from successive frames and smoothed. */
export class SpeedEstimate {
  #last = null;
  #time = 0;

  constructor(count) {
    this.bytes = new Uint8Array(count);
  }

  update({ positions, dim, time }) {
    const elapsed = time - this.#time;
    if (this.#last === null || elapsed < 0) this.bytes.fill(0);
    else if (elapsed > 0) this.#blend(positions, dim, elapsed);
    this.#last = positions;
    this.#time = time;
  }

  #blend(positions, dim, elapsed) {
    const scale = 255 / (65535 * elapsed * FASTEST);
    for (let i = 0; i < this.bytes.length; i += 1) {
      let squared = 0;
      for (let axis = i * dim; axis < (i + 1) * dim; axis += 1) squared += (positions[axis] - this.#last[axis]) ** 2;
      const speed = Math.min(255, Math.sqrt(squared) * scale);
      this.bytes[i] = 0.6 * this.bytes[i] + 0.4 * speed;
    }
  }
}
