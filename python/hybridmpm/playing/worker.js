// The simulation of a playing file, beside the page: the solver as a WebAssembly module.

let core = null; // exports of the module
let player = 0; // address of the simulation
let startFile = null; // bytes
let ways = null; // bytes, of those who follow a sketch
let solids = []; // [{ obstacle, points: Float32Array }], moving ones
let bodies = 0; // number of rigid ones
let readings = null; // of the probes; null without any
let readEvery = 1; // frames
let forces = 0; // numbers in the forces on walls and obstacles

/** Unpack what gzip packed. */
async function unpacked(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  try {
    return new Uint8Array(await new Response(stream).arrayBuffer());
  } catch {
    throw new Error("This file is damaged: get it once more.");
  }
}

/** The first of the modules that gives the bits of the native solver in this browser. */
async function firstModule(packed) {
  for (const one of packed) {
    const bytes = await unpacked(one);
    if (!WebAssembly.validate(bytes)) continue;
    const { instance } = await WebAssembly.instantiate(bytes, {});
    if (instance.exports.has_native_bits()) return instance.exports;
  }
  throw new Error(
    "This browser cannot run the simulation: it has no vector instructions for WebAssembly (simd128). " +
      "Chrome 91, Firefox 89 and Safari 16.4 have them, and all later ones.",
  );
}

function give(array) {
  const address = core.reserve(array.byteLength); // may move the memory
  const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
  new Uint8Array(core.memory.buffer).set(bytes, address);
}

function failure() {
  const text = new Uint8Array(core.memory.buffer, core.message(), core.message_length());
  return new Error(new TextDecoder().decode(text));
}

function bytesAt(address, length) {
  return new Uint8Array(core.memory.buffer, address, length).slice();
}

function numbersAt(address, length) {
  if (address === 0 && length > 0) throw failure();
  return new Float32Array(core.memory.buffer, address, length).slice();
}

/** Begin at the first state again. */
function begin() {
  if (player) core.close(player);
  give(startFile);
  player = core.open(startFile.byteLength);
  if (!player) throw failure();
  if (ways.byteLength > 0) {
    give(ways);
    if (!core.follow(player, ways.byteLength)) throw failure();
  }
  if (readings !== null) readings.begin();
}

/** What probes read of the present state. */
const now = {
  positions: () => numbersAt(core.positions(player), core.count(player) * core.dim()),
  velocities: () => numbersAt(core.velocities(player), core.count(player) * core.dim()),
  masses: () => numbersAt(core.masses(player), core.count(player)),
  simulated: () => numbersAt(core.simulated_positions(player), core.simulated(player) * core.dim()),
  pressures: () => numbersAt(core.pressures(player), core.simulated(player)),
  distances(points) {
    give(Float32Array.from(points));
    return numbersAt(core.distances(player, points.length), points.length / core.dim());
  },
  /** 13 numbers of each rigid body: centre, quaternion with the scalar first, velocity, angular velocity. */
  rigid: () =>
    bodies > 0 ? new Float64Array(core.memory.buffer, core.rigid(player), 13 * bodies).slice() : new Float64Array(0),
  forces() {
    const address = core.forces(player);
    return address ? new Float64Array(core.memory.buffer, address, forces).slice() : null;
  },
};

/** A hand as the module takes it; none where there is no hand. */
function numbersOf(hand) {
  if (hand === null) return [];
  if (hand.body === undefined) return [...hand.point, ...hand.velocity, hand.radius, hand.cap];
  return [hand.body, ...hand.grip, ...hand.target, hand.reach, hand.strength];
}

/**
 * Advance by frames. `hand` is null, { point, velocity, radius, cap } of one that pushes, or { body, grip, target, reach, strength }
 * of one that pulls. Returns readings: [frame, values].
 */
function advance(frames, hand) {
  const numbers = numbersOf(hand);
  const found = [];
  // Without probes all frames are one call.
  const step = readings === null ? frames : 1;
  for (let done = 0; done < frames; done += step) {
    if (numbers.length > 0) give(Float64Array.from(numbers));
    if (!core.advance(player, step, numbers.length)) throw failure();
    if (readings === null) continue;
    readings.note();
    const frame = core.frame(player);
    if (frame % readEvery === 0) found.push([frame, readings.read()]);
  }
  return found;
}

/** What the page draws: all arrays are copies. */
function state(wanted) {
  const [count, dim] = [core.count(player), core.dim()];
  const found = {
    frame: core.frame(player),
    positions: now.positions(),
    materials: bytesAt(core.materials(player), count),
    values: null,
    rigid: now.rigid(),
    moved: solids.map(({ obstacle, points }) => {
      give(points);
      return numbersAt(core.moved(player, obstacle, points.length), points.length);
    }),
  };
  if (wanted === "pressure") found.values = now.pressures();
  else if (wanted === "density") found.values = numbersAt(core.volume_ratios(player), count).map((j) => 1 / j);
  else {
    const v = now.velocities();
    found.values = new Float32Array(count);
    for (let i = 0; i < count; i += 1) {
      let sum = 0;
      for (let axis = 0; axis < dim; axis += 1) sum += v[i * dim + axis] ** 2;
      found.values[i] = Math.sqrt(sum);
    }
  }
  return found;
}

/** The readings at the start. */
function first() {
  return readings === null ? [] : [[core.frame(player), readings.read()]];
}

const orders = {
  async open({ modules, start, path, moving, about }) {
    core = await firstModule(modules);
    [startFile, ways] = [await unpacked(start), await unpacked(path)];
    solids = moving;
    readEvery = about.readEvery;
    bodies = about.rigid.length;
    if (about.probes.length > 0) readings = new Readings(about, now);
    forces = (2 * core.dim() + about.solids.length) * 3 * (core.dim() - 1);
    begin();
    const isCoarse = core.simulated(player) !== core.count(player);
    return { dim: core.dim(), frameDt: core.frame_dt(player), isCoarse, readings: first() };
  },
  async reset({ wanted }) {
    begin();
    return { ...state(wanted), readings: first() };
  },
  async advance({ frames, hand, wanted }) {
    const before = performance.now();
    const found = advance(frames, hand);
    const took = performance.now() - before;
    return { ...state(wanted), took, frames, readings: found };
  },
  /** Lets the fluid follow a drawing from now on: numbers as the module's `draw` takes them. */
  async sketch({ numbers }) {
    give(Float64Array.from(numbers));
    if (!core.draw(player, numbers.length)) throw failure();
    return { frame: core.frame(player) };
  },
  async digest() {
    const address = core.digest(player);
    if (!address) throw failure();
    const digest = Array.from(bytesAt(address, 32), (byte) => byte.toString(16).padStart(2, "0")).join("");
    return { digest, frame: core.frame(player) };
  },
};

onmessage = async ({ data: { id, order, ...given } }) => {
  try {
    postMessage({ id, ...(await orders[order](given)) });
  } catch (error) {
    const stopped = error instanceof WebAssembly.RuntimeError || error instanceof RangeError;
    const text = stopped
      ? "The simulation stopped: this device has no memory left for it, or the file is damaged. Reload the page."
      : error.message;
    postMessage({ id, error: text });
  }
};
