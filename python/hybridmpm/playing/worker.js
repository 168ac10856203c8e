// The simulation of a playing file, beside the page: the solver as a WebAssembly module.

let core = null; // exports of the module
let player = 0; // address of the simulation
let startFile = null; // bytes
let solids = []; // [{ obstacle, points: Float32Array }], moving ones

/** Unpack what gzip packed. */
async function unpacked(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
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
  return new Float32Array(core.memory.buffer, address, length).slice();
}

/** Begin at the first state again. */
function begin() {
  if (player) core.close(player);
  give(startFile);
  player = core.open(startFile.byteLength);
  if (!player) throw failure();
}

/** Advance by frames; `hand` is null or { point, velocity, radius, cap }. */
function advance(frames, hand) {
  if (hand === null) {
    if (frames > 0 && !core.advance(player, frames, 0)) throw failure();
    return;
  }
  const numbers = Float32Array.of(...hand.point, ...hand.velocity, hand.radius, hand.cap);
  for (let i = 0; i < frames; i += 1) {
    give(numbers);
    if (!core.advance_pushed(player)) throw failure();
  }
}

/** What the page draws: all arrays are copies. */
function state(wanted) {
  const [count, dim] = [core.count(player), core.dim()];
  const found = {
    frame: core.frame(player),
    positions: numbersAt(core.positions(player), count * dim),
    materials: bytesAt(core.materials(player), count),
    values: null,
    moved: solids.map(({ obstacle, points }) => {
      give(points);
      return numbersAt(core.moved(player, obstacle, points.length), points.length);
    }),
  };
  if (wanted === "pressure") found.values = numbersAt(core.pressures(player), count);
  else if (wanted === "density") found.values = numbersAt(core.volume_ratios(player), count).map((j) => 1 / j);
  else {
    const v = numbersAt(core.velocities(player), count * dim);
    found.values = new Float32Array(count);
    for (let i = 0; i < count; i += 1) {
      let sum = 0;
      for (let axis = 0; axis < dim; axis += 1) sum += v[i * dim + axis] ** 2;
      found.values[i] = Math.sqrt(sum);
    }
  }
  return found;
}

const orders = {
  async open({ modules, start, moving }) {
    core = await firstModule(modules);
    startFile = await unpacked(start);
    solids = moving;
    begin();
    return { dim: core.dim(), frameDt: core.frame_dt(player) };
  },
  async reset({ wanted }) {
    begin();
    return state(wanted);
  },
  async advance({ frames, hand, wanted }) {
    const before = performance.now();
    advance(frames, hand);
    const took = performance.now() - before;
    return { ...state(wanted), took, frames };
  },
  async digest() {
    const bytes = bytesAt(core.digest(player), 32);
    const digest = Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
    return { digest, frame: core.frame(player) };
  },
};

onmessage = async ({ data: { id, order, ...given } }) => {
  try {
    postMessage({ id, ...(await orders[order](given)) });
  } catch (error) {
    const stopped = error instanceof WebAssembly.RuntimeError;
    const text = stopped
      ? "The simulation stopped: this device has no memory left for it, or the file is damaged. Reload the page."
      : error.message;
    postMessage({ id, error: text });
  }
};
