// Encoding of the frames that this tab computes, as the stream would have sent them. Pure functions.

import { FLAG_POPULATION, FLAG_RIGID, FLAG_STEERED, HEADER_BYTES, KIND_POSITIONS, MAGIC, NUMBERS_U16, POSE_NUMBERS, VERSION } from "../frames.js";

/** The number of an encoded frame. */
export const numberOf = (buffer) => Number(new DataView(buffer).getBigUint64(8, true));

/**
 * The bytes of a frame that this tab has computed, as the stream would have sent them.
 *
 * @param positions Float32Array, count x dim [m]
 * @param length longest side of the world [m]
 * @param population {ids: BigUint64Array, types: Uint8Array of indices, typeOf: types by index}; null where particles
 *   neither come nor go
 * @param bodies numbers of the rigid bodies, 13 of each: centre, quaternion, velocity, angular velocity; null without one
 */
export function encodeFrame({ frame, time, solverMs, isSteered, positions, dim, length, population, bodies }) {
  const count = positions.length / dim;
  const bodyCount = bodies === null ? 0 : bodies.length / 13;
  const first = HEADER_BYTES + (bodyCount > 0 ? 4 + 4 * POSE_NUMBERS[dim] * bodyCount : 0);
  const start = first + (population === null ? 0 : 4 * count);
  const end = start + 2 * count * dim;
  const buffer = new ArrayBuffer(end + (population === null ? 0 : count));
  const view = new DataView(buffer);
  view.setUint32(0, MAGIC, true);
  view.setUint8(4, VERSION);
  view.setUint8(5, KIND_POSITIONS);
  view.setUint16(6, (population === null ? 0 : FLAG_POPULATION) | (bodyCount > 0 ? FLAG_RIGID : 0) | (isSteered ? FLAG_STEERED : 0), true);
  view.setBigUint64(8, BigInt(frame), true);
  view.setFloat64(16, time, true);
  view.setUint32(24, count, true);
  view.setUint8(28, dim);
  view.setUint8(29, NUMBERS_U16);
  view.setUint16(30, Math.min(Math.round(100 * solverMs), 65535), true);
  const numbers = new Uint16Array(buffer, start, count * dim);
  const scale = 65535 / length;
  for (let i = 0; i < numbers.length; i += 1) {
    numbers[i] = Math.min(Math.max(positions[i] * scale + 0.5, 0), 65535);
  }
  if (bodyCount > 0) {
    view.setUint32(HEADER_BYTES, bodyCount, true);
    new Float32Array(buffer, HEADER_BYTES + 4, bodyCount * POSE_NUMBERS[dim]).set(posesOf(bodies, dim));
  }
  if (population !== null) {
    const { ids, types, typeOf } = population;
    const words = new Uint32Array(ids.buffer, ids.byteOffset, 2 * count); // the lower one of each id first
    const [idsOut, typesOut] = [new Uint32Array(buffer, first, count), new Uint8Array(buffer, end, count)];
    for (let i = 0; i < count; i += 1) {
      idsOut[i] = words[2 * i];
      typesOut[i] = typeOf[types[i]];
    }
  }
  return buffer;
}

/** Of each body the centre, then in the plane the angle, in space the quaternion. */
function posesOf(bodies, dim) {
  return Array.from({ length: bodies.length / 13 }, (_, k) => {
    const [x, y, z, w, i, j, l] = bodies.subarray(13 * k);
    return dim === 3 ? [x, y, z, w, i, j, l] : [x, y, Math.atan2(2 * w * l, 1 - 2 * l * l)];
  }).flat();
}
