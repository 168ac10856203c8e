// The frames of a session, computed in this tab: the solver as a WebAssembly module, at a pace, under a hand.

import { encodeFrame } from "./lead-frames.js";

const TICK_MS = 1000 / 60; // no screen shows more pictures
const TURN_MS = 25; // longest time of a turn: a hand that waits acts in the next frame
const MOST_LAG_MS = 100; // a longer lag is skipped, since catching up later looks like a jump
const REPORT_MS = 100; // from one report of frames and inputs to the next
const MEASURED_MS = 1000; // time over which the pace is measured
const SLOWEST = 0.9; // share of the aimed pace that has to be kept
const MOST_AHEAD = 240; // frames; the server refuses more than 400

let core = null; // exports of the module
let player = 0; // address of the simulation
let given = null; // {types, hasPopulation, length, frameDt}: what frames need besides the state
let speed = 0.25; // simulated seconds per second
let runs = false;
let timer = 0;
let hand = { push: null }; // {push: {point, velocity, radius, cap} or null}, or {pull: {body, grip, target, reach, strength}}
let inputs = []; // those since the latest report
const NO_WAYS = new Uint8Array(12); // of no frames
let steered = { from: 0, to: 0, until: 0 }; // the frames of the law that is followed, and the end of the whole motion
let waits = false; // whether the law of the next goal has been asked for
let known = 0; // latest frame that the server has computed
let pace = { origin: 0, done: 0 }; // when the counting of frames began [ms], and how many were computed since
let measure = { since: 0, frame: 0 };
let reported = 0; // when [ms]

async function exportsOf(name) {
  const { instance } = await WebAssembly.instantiateStreaming(fetch(new URL(`../modules/${name}.wasm`, self.location.href)), {});
  return instance.exports.has_native_bits() ? instance.exports : null;
}

/** The first of the modules of a dimension that gives the bits of the server in this browser. */
async function firstOf(name) {
  const relaxed = await exportsOf(name).catch(() => null); // not all browsers have its instructions
  const found = relaxed ?? (await exportsOf(`${name}-exact`));
  if (found === null) throw new Error("this browser computes other bits than the server");
  return found;
}

function give(array) {
  const address = core.reserve(array.byteLength); // may move the memory
  new Uint8Array(core.memory.buffer).set(new Uint8Array(array.buffer, array.byteOffset, array.byteLength), address);
}

function failure() {
  const text = new Uint8Array(core.memory.buffer, core.message(), core.message_length());
  return new Error(new TextDecoder().decode(text));
}

function at(address) {
  if (address === 0) throw failure();
  return address;
}

function digest() {
  const bytes = new Uint8Array(core.memory.buffer, at(core.digest(player)), 32);
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** A hand as the module takes it. */
function numbersOf({ push = null, pull }) {
  if (pull !== undefined) return [pull.body, ...pull.grip, ...pull.target, pull.reach, pull.strength];
  return push === null ? [] : [...push.point, ...push.velocity, push.radius, push.cap];
}

/** Numbers of the rigid bodies, 13 of each: centre, quaternion, velocity, angular velocity; null where there is none. */
function bodies() {
  const count = core.rigid_count?.(player) ?? 0;
  return count === 0 ? null : new Float64Array(core.memory.buffer, at(core.rigid(player)), 13 * count);
}

/** Advance by one frame; a hand acts in it. */
function advance() {
  const numbers = numbersOf(hand);
  if (numbers.length > 0) give(Float64Array.from(numbers));
  if (!core.advance(player, 1, numbers.length)) throw failure();
}

/** Follow the law of a sketch from now on; `until` is the frame in which the last of several goals has been kept. */
function follow(ways, until) {
  give(ways);
  if (!core.follow(player, ways.byteLength)) throw failure();
  const [from, frames] = new Uint32Array(ways.buffer, ways.byteOffset, 2);
  steered = { from, to: from + frames, until };
  waits = false;
}

/** Send the present state as a frame of the stream. */
function show(milliseconds) {
  const [count, dim] = [core.count(player), core.dim()];
  const memory = core.memory;
  const positions = new Float32Array(memory.buffer, at(core.positions(player)), count * dim);
  const population = given.hasPopulation
    ? {
        ids: new BigUint64Array(memory.buffer, core.ids(player), count),
        types: new Uint8Array(memory.buffer, core.materials(player), count),
        typeOf: given.types,
      }
    : null;
  const frame = core.frame(player);
  const time = frame * given.frameDt;
  const isSteered = frame > steered.from && frame <= steered.to;
  const about = { frame, time, solverMs: milliseconds, isSteered };
  const buffer = encodeFrame({ ...about, positions, dim, length: given.length, population, bodies: bodies() });
  postMessage({ kind: "frame", buffer }, [buffer]);
}

function report(now) {
  reported = now;
  postMessage({ kind: "report", upto: core.frame(player), inputs });
  inputs = [];
}

function startPace(now) {
  pace = { origin: now, done: 0 };
  measure = { since: now, frame: core.frame(player) };
}

/** Frames that are due at the speed, and not more than the server can follow. */
function due(now) {
  const rate = speed / given.frameDt / 1000; // frames per millisecond
  const most = Math.max(1, MOST_LAG_MS * rate);
  let owed = (now - pace.origin) * rate - pace.done;
  if (owed > most) {
    pace = { origin: now - most / rate, done: 0 };
    owed = most;
  }
  const frame = core.frame(player);
  const nextLaw = steered.to < steered.until ? steered.to - frame : Infinity;
  return Math.min(Math.floor(owed + 1e-9), known + MOST_AHEAD - frame, nextLaw);
}

/** Whether the pace of the latest second was kept; true before it is over. */
function keepsUp(now) {
  const elapsed = now - measure.since;
  if (elapsed < MEASURED_MS) return true;
  const frame = core.frame(player);
  const share = ((frame - measure.frame) * given.frameDt * 1000) / (elapsed * speed);
  measure = { since: now, frame };
  return share >= SLOWEST;
}

function tick() {
  const began = performance.now();
  try {
    let [done, now] = [0, began];
    for (const frames = due(began); done < frames && now - began < TURN_MS; done += 1) {
      advance();
      now = performance.now();
    }
    pace.done += done;
    if (done > 0) show((now - began) / done);
    if (now - reported >= REPORT_MS) report(now);
    const arrives = steered.to < steered.until && core.frame(player) === steered.to;
    if (arrives && !waits) postMessage({ kind: "arrived" });
    waits = arrives;
    if (!waits && !keepsUp(now)) postMessage({ kind: "slow" });
    timer = setTimeout(tick, Math.max(0, TICK_MS - (performance.now() - began)));
  } catch (error) {
    runs = false;
    postMessage({ kind: "failed", text: error.message });
  }
}

function stop() {
  runs = false;
  clearTimeout(timer);
}

const orders = {
  async prepare({ name }) {
    core = await firstOf(name);
    postMessage({ kind: "ready", knowsBodies: core.rigid_count !== undefined });
  },
  /** Go on from a start file, or without one from the own state, which has the same digest then; under a law or none. */
  begin({ start, ways, wanted, about }) {
    if (start !== null) {
      if (player) core.close(player);
      give(new Uint8Array(start));
      player = core.open(start.byteLength);
      if (!player) throw failure();
    }
    if (!player || digest() !== wanted.digest || core.frame(player) !== wanted.frame) {
      postMessage({ kind: "other" });
      return;
    }
    follow(ways === null ? NO_WAYS : new Uint8Array(ways), wanted.steeredUntil);
    given = about;
    ({ hand } = wanted);
    [inputs, known, runs] = [[], wanted.frame, true];
    const now = performance.now();
    startPace(now);
    reported = now;
    postMessage({ kind: "begun" });
    tick();
  },
  hand({ value }) {
    if (!runs) return;
    hand = value;
    const frame = core.frame(player);
    // Of several in one frame the last one acts.
    if (inputs.at(-1)?.frame === frame) inputs.pop();
    inputs.push({ frame, ...hand });
  },
  speed({ value }) {
    speed = value;
    if (runs) startPace(performance.now());
  },
  follow({ ways }) {
    if (!runs) return;
    follow(new Uint8Array(ways), steered.until);
    startPace(performance.now());
  },
  known({ frame }) {
    known = Math.max(known, frame);
  },
  report() {
    if (runs) report(performance.now());
  },
  /** End, with a last report; the answer to it has the digest. */
  end() {
    const wasRunning = runs;
    stop();
    if (wasRunning) report(performance.now());
    postMessage({ kind: "ended", digest: wasRunning ? digest() : null });
  },
  stop,
};

onmessage = async ({ data: { order, ...rest } }) => {
  try {
    await orders[order](rest);
  } catch (error) {
    stop();
    postMessage({ kind: "failed", text: error.message });
  }
};
