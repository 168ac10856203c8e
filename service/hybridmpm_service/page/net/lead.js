// The frames of a session computed in this tab, in a worker, as long as it keeps the pace; the server follows.

import { numberOf } from "./lead-frames.js";

const AGAIN_MS = 5000; // after a refusal, or another viewer's command
const PLANNED_MS = 500; // until the server knows what the lead was ended for
const REFUSED = "urn:hybridmpm:problem:lead-refused";
const NO_SCOPE = "urn:hybridmpm:problem:scope-missing";
const READ_ONLY = new Set(["play", "speed"]); // commands that change no state

/** What a command lets the hand do, {push} or {pull}, as the inputs of a lead have it; null for other commands. */
function handOf({ type, ...value }) {
  if (type === "push_end") return { push: null };
  return type === "push" || type === "pull" ? { [type]: value } : null;
}

/** The command of what a hand does. */
function commandOf({ push = null, pull }) {
  if (pull !== undefined) return { type: "pull", ...pull };
  return push === null ? { type: "push_end" } : { type: "push", ...push };
}

/**
 * Who computes the frames: the server ("none"), or this tab ("leads"). Between them this tab has asked for it ("asked")
 * or loads the state ("starts"), and after them it waits for the last report ("ends").
 */
export class Lead {
  #handlers;
  #worker = null;
  #module = null; // name of the module of the worker
  #ready = false; // whether the worker has its module
  #knowsBodies = false; // whether that tells where rigid bodies are
  #broken = false; // whether this browser cannot compute the session
  #phase = "none";
  #session = null; // newest description of the session
  #scene = null; // {length, frameDt, dim, isOpen, bodies: number of rigid ones}
  #slowAt = Infinity; // lowest speed at which this tab has been too slow for the session
  #notBefore = 0; // when to ask again [ms]
  #begun = null; // the server's message that began
  #planned = null; // phase of the latest sketch; null without one
  #hand = undefined; // what the hand did that the worker does not know yet, {push} or {pull}; undefined where there is nothing
  #waiting = []; // commands that wait for the end
  #ended = []; // called when the lead has ended
  #flushes = []; // called when the server has the next report
  #acks = []; // {number, done}: done() is called when the server has so many reports
  #reports = { sent: 0, acked: 0 };
  #skip = null; // {from, to}: frames of the server that this tab has shown already

  /**
   * @param handlers {send(message), start(), ways() -> promises of an ArrayBuffer, frame(ArrayBuffer),
   *   changed(isHere), lengthOf(scene) -> longest side of its world [m]}
   */
  constructor(handlers) {
    this.#handlers = handlers;
  }

  /** Whether the frames that are shown are those of this tab. */
  get isHere() {
    return this.#phase === "leads" || this.#phase === "ends";
  }

  /** Another session than before, or the same after an interruption. */
  show(hello) {
    this.#drop();
    if (hello.session.id !== this.#session?.id) [this.#slowAt, this.#notBefore, this.#broken] = [Infinity, 0, false];
    const { dim, emitters = [], sinks = [], frame_dt: frameDt } = hello.scene;
    this.#scene = { dim, length: this.#handlers.lengthOf(hello.scene), frameDt, isOpen: emitters.length + sinks.length > 0, bodies: hello.rigid.length };
    this.#session = hello.session;
    this.consider();
  }

  note(session) {
    if (this.#session === null) return; // one that is only watched
    this.#session = session;
    const planned = session.control?.phase ?? null;
    // What the lead was ended for is planned.
    if (this.#planned === "preparing" && planned !== "preparing") this.#notBefore = 0;
    this.#planned = planned;
    this.#worker?.postMessage({ order: "known", frame: session.frame });
    this.consider();
  }

  /** Ask to compute the frames where that is possible and seems to be worth it. */
  consider() {
    const session = this.#session;
    if (this.#phase !== "none" || session === null || session.solver !== "mpm" || !session.playing || session.led) return;
    const isPlanned = session.control?.phase === "preparing";
    if (isPlanned || this.#broken || session.speed >= this.#slowAt || performance.now() < this.#notBefore) return;
    this.#prepare();
    if (!this.#ready || (this.#scene.bodies > 0 && !this.#knowsBodies)) return;
    this.#phase = "asked";
    this.#handlers.send({ type: "lead" });
  }

  #prepare() {
    const name = this.#scene.dim === 3 ? "space" : "plane";
    if (this.#module === name) return;
    this.#worker?.terminate();
    [this.#module, this.#ready] = [name, false];
    this.#worker = new Worker(new URL("./lead-worker.js", import.meta.url), { type: "module" });
    this.#worker.addEventListener("message", ({ data }) => this.#fromWorker(data));
    this.#worker.addEventListener("error", () => this.#fail());
    this.#order("prepare", { name });
  }

  #order(order, rest = {}) {
    this.#worker.postMessage({ order, ...rest });
  }

  // ---- from the server ----

  /** Take a message about the lead; return whether it was one. */
  receive(message) {
    if (message.type === "lead") this.#begin(message);
    else if (message.type === "led") {
      this.#order("known", { frame: message.frame });
      this.#reports.acked += 1;
      const isDone = ({ number }) => number <= this.#reports.acked;
      for (const { done } of this.#acks.filter(isDone)) done();
      this.#acks = this.#acks.filter((one) => !isDone(one));
    } else if (message.type === "unlead") this.#unled(message);
    else return false;
    return true;
  }

  /** Whether a problem is the refusal of what this asked for. */
  refuses(type) {
    if (type === NO_SCOPE && this.#phase === "asked") this.#broken = true; // the key lets this page only watch
    else if (type !== REFUSED) return false;
    if (this.#phase === "asked") this.#toServer();
    this.#notBefore = performance.now() + AGAIN_MS;
    return true;
  }

  #begin(message) {
    if (this.#phase !== "asked") {
      this.#handlers.send({ type: "unlead" });
      return;
    }
    this.#phase = "starts";
    this.#begun = message;
    // Under a sketch the session has gone on without this tab.
    if (message.steered_until === null) this.#load(null, null);
    else this.#fetch();
  }

  /** Give the state to the worker, its own if that is the same, else that of a start file; and what steers from there. */
  #load(start, ways) {
    const { frame, digest, push, pull, types, steered_until: steeredUntil } = this.#begun;
    const hand = pull === null ? { push } : { pull };
    const about = { types, hasPopulation: this.#scene.isOpen, length: this.#scene.length, frameDt: this.#scene.frameDt };
    this.#order("speed", { value: this.#session.speed });
    this.#order("begin", { start, ways, wanted: { frame, digest, hand, steeredUntil }, about });
  }

  async #fetch() {
    const begun = this.#begun;
    begun.fetched = true;
    const steers = begun.steered_until !== null;
    try {
      const found = await Promise.all([this.#handlers.start(), steers ? this.#handlers.ways() : null]);
      if (this.#phase === "starts" && this.#begun === begun) this.#load(...found);
    } catch {
      if (this.#phase === "starts" && this.#begun === begun) this.#giveUp();
    }
  }

  /** The law of the next of several goals, which the server plans in the state that it gets of this tab. */
  async #continue() {
    const begun = this.#begun;
    await this.flush();
    try {
      const ways = await this.#handlers.ways();
      if (this.#phase === "leads" && this.#begun === begun) this.#order("follow", { ways });
    } catch {
      if (this.#phase === "leads" && this.#begun === begun) this.end();
    }
  }

  #unled({ frame, reason }) {
    if (this.#phase === "none") return;
    if (this.isHere) this.#skip = { from: this.#begun.frame, to: frame };
    this.#order("stop");
    if (reason !== "asked for") this.#notBefore = performance.now() + AGAIN_MS;
    this.#toServer();
  }

  /** Whether to show a frame of the server: not while it catches up with those that this tab has shown. */
  passes(buffer) {
    if (this.isHere) return false;
    if (this.#skip === null) return true;
    const frame = numberOf(buffer);
    if (frame > this.#skip.from && frame < this.#skip.to) return false;
    this.#skip = null;
    return true;
  }

  // ---- from the worker ----

  #fromWorker(data) {
    switch (data.kind) {
      case "ready":
        [this.#ready, this.#knowsBodies] = [true, data.knowsBodies];
        this.consider();
        break;
      case "other":
        if (this.#begun.fetched) this.#fail();
        else this.#fetch();
        break;
      case "arrived":
        if (this.#phase === "leads") this.#continue();
        break;
      case "begun":
        if (this.#phase !== "starts") {
          this.#order("stop");
          break;
        }
        this.#phase = "leads";
        this.#reports = { sent: 0, acked: 0 };
        if (this.#hand !== undefined) this.#order("hand", { value: this.#hand });
        this.#hand = undefined;
        this.#handlers.changed(true);
        break;
      case "frame":
        if (this.isHere) this.#handlers.frame(data.buffer);
        break;
      case "report":
        if (!this.isHere) break;
        this.#reports.sent += 1;
        this.#acks.push(...this.#flushes.splice(0).map((done) => ({ number: this.#reports.sent, done })));
        this.#handlers.send({ type: "led", upto: data.upto, inputs: data.inputs });
        break;
      case "slow":
        this.#slowAt = this.#session.speed;
        this.end();
        break;
      case "ended":
        this.#finish(data.digest);
        break;
      default: // failed
        this.#fail();
    }
  }

  #finish(digest) {
    if (this.#phase !== "ends") return;
    const pauses = this.#waiting.some(({ type }) => type === "pause" || type === "step");
    this.#handlers.send({ type: "unlead", digest, pause: pauses });
  }

  /** This browser cannot compute the session: the server does so from now on. */
  #fail() {
    this.#broken = true;
    this.#giveUp();
  }

  #giveUp() {
    if (this.#phase !== "none") this.#handlers.send({ type: "unlead" });
    this.#toServer();
  }

  #toServer() {
    const wasHere = this.isHere;
    this.#phase = "none";
    if (this.#hand !== undefined) this.#waiting.unshift(commandOf(this.#hand));
    this.#hand = undefined;
    for (const message of this.#waiting.splice(0)) this.#handlers.send(message);
    const acks = this.#acks.splice(0).map(({ done }) => done);
    for (const done of [...this.#ended.splice(0), ...this.#flushes.splice(0), ...acks]) done();
    if (wasHere) this.#handlers.changed(false);
  }

  #drop() {
    this.#worker?.postMessage({ order: "stop" });
    this.#waiting = [];
    this.#hand = undefined;
    this.#skip = null;
    this.#toServer();
  }

  /** Forget the session: the page leaves it, or its connection is interrupted. */
  leave() {
    this.#drop();
    this.#session = null;
  }

  // ---- from the page ----

  /** Take a command of the user; return whether it is no longer the server's to be sent now. */
  takes(message) {
    if (this.#phase === "none") return false;
    if (message.type === "speed") this.#order("speed", { value: message.value });
    if (this.#phase === "ends") {
      this.#waiting.push(message); // in their order
      return true;
    }
    if (READ_ONLY.has(message.type)) return false;
    const hand = handOf(message);
    if (hand !== null) {
      if (this.#phase === "leads") this.#order("hand", { value: hand });
      else this.#hand = hand;
      return true;
    }
    if (this.#phase !== "leads") return false; // the command ends what has hardly begun
    this.#waiting.push(message);
    this.end();
    return true;
  }

  /** Let the server go on alone; resolves when it does so in the state that this tab has shown. */
  end() {
    this.#notBefore = Math.max(this.#notBefore, performance.now() + PLANNED_MS);
    if (this.#phase !== "leads" && this.#phase !== "ends") return Promise.resolve();
    const ended = new Promise((resolve) => this.#ended.push(resolve));
    if (this.#phase === "leads") this.#order("end");
    this.#phase = "ends";
    return ended;
  }

  /** Let the server know all frames that this tab has shown; resolves when it does. */
  flush() {
    if (this.#phase === "ends") return this.end();
    if (this.#phase !== "leads") return Promise.resolve();
    const known = new Promise((resolve) => this.#flushes.push(resolve));
    this.#order("report");
    return known;
  }
}
