// One simulation on the server: created or joined over HTTP, watched over a WebSocket, resumed by id.

import { Problem, Session } from "../client.js";
import { advised, client } from "./api.js";

const LOST_CODE = 4404; // the server does not know the session (any more)
const RETRY_SECONDS = [0.5, 1, 2, 4, 5];
const LEAVE_SECONDS = 60; // in which a reload, or the browser's Back, finds a session again

/** Leave a session, perhaps while the page closes: it ends soon, unless the page comes back to it. */
function abandon(session) {
  session.delete({ after: LEAVE_SECONDS, keepalive: true }).catch(() => {
    // The session expires by itself when the server cannot be reached.
  });
}

/**
 * The connection to one session. Its states are "connecting" (at first), "live", "reconnecting" (the server does
 * not answer, we keep trying), "lost" (the server no longer has the session), "failed" (none could be created).
 */
export class SessionClient {
  #handlers;
  #socket = null;
  #retryTimer = 0;
  #attempt = 0;
  #generation = 0; // grows with every start or attach, so that late answers are recognised
  #owned = false;
  #watches = false; // whether nothing may be sent that changes the session
  #state = "connecting";
  #lead = null; // computes the frames in this tab; null where the server does so, and until it is loaded
  #hello = null; // the latest greeting
  #session = null; // the session; null without one

  /**
   * @param handlers {onState(state, info), onHello, onStatus, onProblem, onFrame(ArrayBuffer), onHome(isHere),
   *   lengthOf(scene)}: isHere says whether this tab computes the frames, the length is that of the world [m]
   * @param mayLead whether this tab may compute them
   */
  constructor(handlers, mayLead) {
    this.#handlers = handlers;
    if (!mayLead || typeof WebAssembly === "undefined" || typeof Worker === "undefined") return;
    this.#loadLead();
  }

  async #loadLead() {
    const { Lead } = await import("./lead.js");
    const { onFrame: frame, onHome: changed, lengthOf } = this.#handlers;
    this.#lead = new Lead({
      send: (message) => this.#state === "live" && this.#socket.send(JSON.stringify(message)),
      start: () => this.#session.startFile(),
      ways: () => this.#session.ways(),
      frame,
      changed,
      lengthOf,
    });
    if (this.#state === "live" && !this.#watches) this.#lead.show(this.#hello);
  }

  get state() {
    return this.#state;
  }

  get id() {
    return this.#session?.id ?? null;
  }

  /** Whether this tab computes the frames. */
  get isHere() {
    return this.#lead?.isHere ?? false;
  }

  /** Leave the present session and create another one, of {scenario, seed, solver, coarse}, {scene} or {log}. */
  async start(body) {
    const generation = this.#leave();
    this.#enter("connecting");
    try {
      const session = await client.create(body);
      if (generation !== this.#generation) {
        abandon(session);
        return;
      }
      this.#session = session;
      this.#owned = true;
      this.#connect(generation);
    } catch (problem) {
      if (generation === this.#generation) this.#enter("failed", { problem });
    }
  }

  /**
   * Join a session.
   *
   * @param watches whether to leave it as it is: no message is sent to it then
   * @param owned whether this page has created it; others go on when the page closes
   */
  attach(id, { watches = false, owned = false } = {}) {
    const generation = this.#leave();
    this.#watches = watches;
    this.#session = new Session(client, { id });
    this.#owned = owned;
    this.#enter("connecting");
    return this.#resume(generation);
  }

  /** Send a control message; returns false (and sends nothing) while there is no connection, or where one only watches. */
  send(message) {
    if (this.#state !== "live" || this.#watches) return false;
    if (!this.#lead?.takes(message)) this.#socket.send(JSON.stringify(message));
    return true;
  }

  /**
   * Let a stroke steer the simulation. Resolves to how it was understood, what it takes and where it leads.
   *
   * @param settings {strength, frames, hold}, each of which may be absent
   * @param signal an AbortSignal that takes the stroke back as long as there is no answer
   */
  async steer(stroke, settings, signal) {
    await this.#lead?.end();
    return this.#session.steer(stroke, settings, { signal });
  }

  /** The mean acceleration that steers the particles of each cell of a coarse grid, besides gravity. */
  force() {
    return this.#session.force();
  }

  /** The mean pressure of the particles of each cell of a grid; only MPM computes it. */
  pressure() {
    return this.#session.pressure();
  }

  /** The sketch that steers and its goal, as `steer` resolves to; null without one. */
  sketch() {
    return this.#session.sketch();
  }

  /** What the session can be computed again from. */
  async log() {
    await this.#lead?.flush();
    return this.#session.log();
  }

  /** All particles as a file: "npz", "ply" or "vtp". */
  async particles(kind) {
    await this.#lead?.flush();
    return this.#session.particlesFile(kind);
  }

  /** Begin a session that goes on from the present state by itself; answers it. */
  async fork() {
    await this.#lead?.flush();
    return this.#session.fork();
  }

  /** A link with which others watch the session: {token, until, page}. Only a service with keys makes one. */
  link() {
    return this.#session.link();
  }

  /** Let no sketch steer the simulation any more. */
  async release() {
    await this.#lead?.end();
    return this.#session.release();
  }

  /** Try again at once instead of waiting for the next attempt. */
  retry() {
    if (this.#state !== "reconnecting") return;
    clearTimeout(this.#retryTimer);
    this.#resume(this.#generation);
  }

  /** Delete the session, if this page created it, because the page goes away. */
  dispose() {
    this.#leave();
  }

  #leave() {
    this.#generation += 1;
    clearTimeout(this.#retryTimer);
    this.#attempt = 0;
    this.#lead?.leave();
    this.#socket?.close();
    this.#socket = null;
    if (this.#owned && this.#session !== null) abandon(this.#session);
    this.#session = null;
    this.#owned = this.#watches = false;
    return this.#generation;
  }

  #enter(state, info = {}) {
    this.#state = state;
    this.#handlers.onState(state, info);
  }

  /** Call over HTTP first: it distinguishes a missing server from a missing session, unlike a failed WebSocket. */
  async #resume(generation) {
    try {
      await this.#session.refresh();
    } catch (problem) {
      if (generation !== this.#generation) return;
      if (problem instanceof Problem && [401, 403, 404].includes(problem.status)) this.#enter("lost", { problem });
      else this.#retryLater(generation);
      return;
    }
    if (generation === this.#generation) this.#connect(generation);
  }

  #retryLater(generation) {
    const seconds = RETRY_SECONDS[Math.min(this.#attempt, RETRY_SECONDS.length - 1)];
    this.#attempt += 1;
    this.#enter("reconnecting", { seconds });
    this.#retryTimer = setTimeout(() => this.#resume(generation), 1000 * seconds);
  }

  #connect(generation) {
    const socket = client.socket(this.id);
    this.#socket = socket;
    socket.addEventListener("message", ({ data }) => {
      if (generation !== this.#generation) return;
      if (typeof data === "string") this.#receive(JSON.parse(data));
      else if (this.#lead?.passes(data) ?? true) this.#handlers.onFrame(data);
    });
    socket.addEventListener("close", ({ code }) => {
      if (generation !== this.#generation) return;
      this.#socket = null;
      this.#state = "connecting"; // nothing can be sent
      this.#lead?.leave();
      if (code === LOST_CODE) this.#enter("lost", { deleted: true });
      else this.#retryLater(generation);
    });
  }

  #receive(message) {
    if (message.type === "hello") {
      this.#attempt = 0;
      this.#enter("live");
      this.#hello = message;
      this.#handlers.onHello(message);
      if (!this.#watches) this.#lead?.show(message);
    } else if (message.type === "status") {
      this.#handlers.onStatus(message);
      this.#lead?.note(message.session);
    } else if (this.#lead?.receive(message)) {
      // It was for the lead alone.
    } else if (message.type === "problem") {
      if (this.#lead?.refuses(message.problem)) return;
      const { title, detail, status = 0, problem: type } = message;
      this.#handlers.onProblem(advised(new Problem(title, detail, status, { type })));
    }
  }
}
