// Decoding of the messages that docs/reference/http-api.md describes. Pure functions: bytes in, plain values out.

export const MAGIC = 0x4d504d48; // "HMPM" when read little-endian
/** Version of the frames that this page asks for. */
export const VERSION = 3;
export const KIND_POSITIONS = 1;
export const NUMBERS_U16 = 1;
export const HEADER_BYTES = 32;
export const FLAG_STEERED = 1;
export const FLAG_POPULATION = 2;
export const FLAG_RIGID = 4;
/** Numbers of a rigid body's pose by the scene's dimension: its centre, then an angle or a quaternion. */
export const POSE_NUMBERS = { 2: 3, 3: 7 };

/** Types of particles, in DeepMind's numbering. */
export const WATER = 5;
export const SAND = 6;
export const GOOP = 7;
export const LIQUID = 8;

/** A message that this page cannot read, most likely because server and page differ in version. */
export class ProtocolError extends Error {}

/**
 * Decode one binary frame of the stream.
 *
 * `positions`, `ids` and `types` are views into `buffer` (no copies). `positions` has count x dim numbers, 0 .. 65535
 * for 0 .. 1 times the longest side of the world. `ids` and `types` are null where particles neither come nor go; else `ids` are ascending.
 * `poses` has 3 numbers of each rigid body in 2D, centre [m] and angle [rad], and 7 in 3D, centre and unit quaternion with the scalar
 * first; null where there is none.
 */
export function decodeFrame(buffer) {
  if (buffer.byteLength < HEADER_BYTES) {
    throw new ProtocolError(`a frame needs ${HEADER_BYTES} bytes of header, got ${buffer.byteLength}`);
  }
  const view = new DataView(buffer);
  const version = view.getUint8(4);
  const kind = view.getUint8(5);
  const numbers = view.getUint8(29);
  if (view.getUint32(0, true) !== MAGIC || version !== VERSION || kind !== KIND_POSITIONS || numbers !== NUMBERS_U16) {
    throw new ProtocolError(`unknown frame: version ${version}, kind ${kind}, numbers ${numbers}`);
  }
  const count = view.getUint32(24, true);
  const dim = view.getUint8(28);
  const flags = view.getUint16(6, true);
  const hasPopulation = (flags & FLAG_POPULATION) !== 0;
  const bodies = flags & FLAG_RIGID && buffer.byteLength >= HEADER_BYTES + 4 ? view.getUint32(HEADER_BYTES, true) : 0;
  const first = HEADER_BYTES + (flags & FLAG_RIGID ? 4 + 4 * bodies * POSE_NUMBERS[dim] : 0);
  const start = first + (hasPopulation ? 4 * count : 0);
  const end = start + 2 * count * dim;
  const expected = end + (hasPopulation ? count : 0);
  if ((dim !== 2 && dim !== 3) || buffer.byteLength !== expected) {
    throw new ProtocolError(`${count} particles in ${dim}D need ${expected} bytes, got ${buffer.byteLength}`);
  }
  return {
    frame: Number(view.getBigUint64(8, true)),
    time: view.getFloat64(16, true),
    steered: (flags & FLAG_STEERED) !== 0,
    solverMs: view.getUint16(30, true) / 100,
    count,
    dim,
    // Typed arrays use the byte order of the machine; every browser in use is little-endian.
    positions: new Uint16Array(buffer, start, count * dim),
    poses: bodies > 0 ? new Float32Array(buffer, HEADER_BYTES + 4, bodies * POSE_NUMBERS[dim]) : null,
    ids: hasPopulation ? new Uint32Array(buffer, first, count) : null,
    types: hasPopulation ? new Uint8Array(buffer, end, count) : null,
  };
}

/** The particle types of the hello message, one byte each; null where each frame has its own. */
export function decodeTypes(base64) {
  return base64 === null ? null : Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
}

/** The longest side of the world of a scene [m], which 65535 stands for in the frames. */
export const lengthOf = (scene) => Math.max(...(scene.world?.size ?? [1]));
