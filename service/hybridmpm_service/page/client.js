// Client of a hybridmpm service, for browsers and Node: sessions, sketches, live frames, jobs. No dependencies.
//
// client.d.ts describes the types; the service describes its calls in docs/reference/http-api.md and /openapi.json.

import { decodeFrame, decodeTypes, lengthOf, VERSION } from "./frames.js";

const ADDRESS = "http://127.0.0.1:8000"; // of a service that `hybridmpm serve` starts
const PROTOCOL = "hybridmpm";

/** What a service refused, or why there is no answer. Its message is a sentence for people. */
export class Problem extends Error {
  /**
   * @param {string} title   short description
   * @param {string} detail  exact description
   * @param {number} status  HTTP status, 0 when there was no answer
   * @param more {type: name of the kind of problem, fields: [{field, message}], retryAfter [s]}
   */
  constructor(title, detail = "", status = 0, { type = "", fields = [], retryAfter = null } = {}) {
    const exact = fields.length > 0 ? fields.map(({ field, message }) => `${field}: ${message}`).join("; ") : detail;
    super(exact ? `${title}: ${exact}` : title);
    this.name = "Problem";
    this.title = title;
    this.detail = exact;
    this.status = status;
    this.type = type;
    this.fields = fields;
    this.retryAfter = retryAfter;
  }

  /** The last part of the type, as "session-not-found"; empty where there is none. */
  get kind() {
    return this.type.split(":").at(-1);
  }
}

async function problemOf(response) {
  const wait = response.headers.get("Retry-After");
  const retryAfter = wait === null ? null : Number(wait);
  try {
    const { title, detail, type, errors } = await response.json();
    return new Problem(title ?? response.statusText, detail, response.status, { type, fields: errors ?? [], retryAfter });
  } catch {
    return new Problem("The server answered with an error", `status ${response.status}`, response.status, { retryAfter });
  }
}

/** A service at an address, with a key or the token of a link where it has keys. */
export class Client {
  #options;

  constructor(address = ADDRESS, { key = null, fetch = (...given) => globalThis.fetch(...given), WebSocket } = {}) {
    this.address = new URL(String(address).replace(/\/*$/, "/"));
    this.key = key;
    this.#options = { fetch, WebSocket };
  }

  /** The whole address of a path of the service, which need not be at the root of its host. */
  at(path) {
    return new URL(path.replace(/^\//, "./"), this.address);
  }

  /** Make a call and return its answer. Throws Problem for every answer that is not a success, and where there is none. */
  async call(method, path, { body, accept, signal, keepalive, query = {} } = {}) {
    const address = this.at(path);
    for (const [name, value] of Object.entries(query)) {
      if (value !== undefined) address.searchParams.set(name, String(value));
    }
    const isRaw = body instanceof FormData || body instanceof Blob;
    const headers = {
      ...(this.key === null ? {} : { Authorization: `Bearer ${this.key}` }),
      ...(accept === undefined ? {} : { Accept: accept }),
      ...(body === undefined || isRaw ? {} : { "Content-Type": "application/json" }),
    };
    const content = body === undefined || isRaw ? body : JSON.stringify(body);
    let response;
    try {
      response = await this.#options.fetch(address, { method, headers, body: content, signal, keepalive });
    } catch (error) {
      if (error.name === "AbortError") throw error;
      const isElsewhere = "location" in globalThis && globalThis.location.origin !== this.address.origin;
      const hint = isElsewhere ? `, and that cors_origins names ${globalThis.location.origin}` : "";
      throw new Problem("The server does not answer", `Check that it is still running${hint}.`);
    }
    if (!response.ok) throw await problemOf(response);
    return response;
  }

  /** Make a call and return its JSON, or null for a 204. Throws as `call`. */
  async json(method, path, body, options = {}) {
    const response = await this.call(method, path, { body, ...options });
    return response.status === 204 ? null : response.json();
  }

  /** A connection to the stream of a session, whose messages are not decoded. */
  socket(id) {
    const address = this.at(`/v1/sessions/${encodeURIComponent(id)}/stream?version=${VERSION}`);
    address.protocol = address.protocol.replace("http", "ws");
    const Socket = this.#options.WebSocket ?? globalThis.WebSocket;
    if (Socket === undefined) throw new Problem("There is no WebSocket here", "Give the client one: new Client(address, { WebSocket }).");
    // Browsers send no headers with it. The server repeats the first of the two alone.
    const socket = this.key === null ? new Socket(address) : new Socket(address, [PROTOCOL, this.key]);
    socket.binaryType = "arraybuffer";
    return socket;
  }

  async ready() {
    await this.call("GET", "/readyz");
    return true;
  }

  async scenarios() {
    return (await this.json("GET", "/v1/scenarios")).scenarios;
  }

  scenario(name, seed = 0) {
    return this.json("GET", `/v1/scenarios/${encodeURIComponent(name)}`, undefined, { query: { seed } });
  }

  async models() {
    return (await this.json("GET", "/v1/models")).models;
  }

  plan(request) {
    return this.json("POST", "/v1/plans", request);
  }

  check(request) {
    return this.json("POST", "/v1/checks", request);
  }

  outlines(request, options) {
    return this.json("POST", "/v1/outlines", request, options);
  }

  /** The shape in a file; of a surface of more than 1000 rows `vertices` and `triangles` are texts, as docs/guide/shapes.md says. */
  shape(file, kind, place) {
    return this.json("POST", "/v1/shapes", file, { query: { kind, ...place } });
  }

  async create(request, options) {
    return new Session(this, await this.json("POST", "/v1/sessions", request, options));
  }

  async sessions() {
    return (await this.json("GET", "/v1/sessions")).sessions.map((info) => new Session(this, info));
  }

  async session(id) {
    return new Session(this, await this.json("GET", `/v1/sessions/${encodeURIComponent(id)}`));
  }

  async makeDataset(request) {
    return new Job(this, await this.json("POST", "/v1/datasets", request));
  }

  async jobs() {
    return (await this.json("GET", "/v1/jobs")).jobs.map((info) => new Job(this, info));
  }

  async job(id) {
    return new Job(this, await this.json("GET", `/v1/jobs/${encodeURIComponent(id)}`));
  }
}

const isSketch = (drawing) => "outlines" in drawing || "center" in drawing;

/** The body of a sketch: a stroke, its points, a sketch as interpreted, several goals in turn, or a picture. */
function sketchOf(drawing, settings) {
  if (Array.isArray(drawing) && Array.isArray(drawing[0])) return { strokes: [{ points: drawing }], ...settings };
  if (Array.isArray(drawing)) return { keyframes: drawing, ...settings };
  if (!(drawing instanceof Blob)) return isSketch(drawing) ? { sketch: drawing, ...settings } : { strokes: [drawing], ...settings };
  const form = new FormData();
  form.set("sketch", drawing, "sketch");
  for (const [name, value] of Object.entries(settings)) form.set(name, typeof value === "object" ? JSON.stringify(value) : String(value));
  return form;
}

/** A running simulation of a service; it lives on when this object is gone. `info` is its newest description. */
export class Session {
  #client;
  #path;

  constructor(client, info) {
    this.#client = client;
    this.id = info.id;
    this.info = info;
    this.#path = `/v1/sessions/${encodeURIComponent(info.id)}`;
  }

  async refresh() {
    return (this.info = await this.#client.json("GET", this.#path));
  }

  async advance(frames = 1) {
    return (this.info = await this.#client.json("POST", `${this.#path}/advance`, { frames }));
  }

  /** All particles at the present frame, as arrays: the state that a snapshot has. */
  async particles() {
    const { frame, time, positions, velocities, types, ids, rigid } = await this.#client.json("GET", `${this.#path}/particles`);
    const { dim } = this.info;
    const flat = (rows) => Float32Array.from({ length: rows.length * dim }, (_, i) => rows[Math.floor(i / dim)][i % dim]);
    return { frame, time, dim, positions: flat(positions), velocities: flat(velocities), types: Uint8Array.from(types), ids, rigid };
  }

  /** The same as a file: "npz", "ply" or "vtp". */
  async particlesFile(kind) {
    return (await this.#client.call("GET", `${this.#path}/particles`, { accept: `application/x-${kind}` })).blob();
  }

  /** What a solver in a browser goes on from; only MPM has it. */
  async startFile() {
    return (await this.#client.call("GET", `${this.#path}/start`)).arrayBuffer();
  }

  /** The law of the sketch that steers, which a solver in a browser follows; of no frames without one. */
  async ways() {
    return (await this.#client.call("GET", `${this.#path}/ways`)).arrayBuffer();
  }

  /** Its surface in 3D as triangles: "glb" or "ply". */
  async surfaceFile(kind) {
    const accept = kind === "glb" ? "model/gltf-binary" : "application/x-ply";
    return (await this.#client.call("GET", `${this.#path}/surface`, { accept })).blob();
  }

  async fork() {
    return new Session(this.#client, await this.#client.json("POST", `${this.#path}/fork`));
  }

  log() {
    return this.#client.json("GET", `${this.#path}/log`);
  }

  async decisions() {
    return (await this.#client.json("GET", `${this.#path}/decisions`)).decisions;
  }

  steer(drawing, settings = {}, { signal } = {}) {
    return this.#client.json("POST", `${this.#path}/sketches`, sketchOf(drawing, settings), { signal });
  }

  sketch() {
    return this.#client.json("GET", `${this.#path}/sketches`);
  }

  release() {
    return this.#client.json("DELETE", `${this.#path}/sketches`);
  }

  force() {
    return this.#client.json("GET", `${this.#path}/force`);
  }

  pressure() {
    return this.#client.json("GET", `${this.#path}/pressure`);
  }

  trace(drawing, settings = {}, { stride, signal } = {}) {
    return this.#client.json("POST", `${this.#path}/trajectories`, sketchOf(drawing, settings), { query: { stride }, signal });
  }

  async record(request) {
    return new Job(this.#client, await this.#client.json("POST", `${this.#path}/recordings`, request));
  }

  link(request = {}) {
    return this.#client.json("POST", `${this.#path}/links`, request);
  }

  takeLinksBack() {
    return this.#client.json("DELETE", `${this.#path}/links`);
  }

  /** End the session, `after` some seconds where it is not used again; `keepalive` where the page is just left. */
  delete({ after, keepalive } = {}) {
    return this.#client.json("DELETE", this.#path, undefined, { query: { after }, keepalive });
  }

  /** Watch the session, and command its player. Rejects where the stream cannot be opened. */
  stream() {
    return Stream.open(this.#client, this.id);
  }
}

/** Work of a service in the background. `info` is its newest description. */
export class Job {
  #client;
  #path;

  constructor(client, info) {
    this.#client = client;
    this.id = info.id;
    this.info = info;
    this.#path = `/v1/jobs/${encodeURIComponent(info.id)}`;
  }

  async refresh() {
    return (this.info = await this.#client.json("GET", this.#path));
  }

  /** Each change of `info`, until the job has ended. */
  async *events() {
    const { body } = await this.#client.call("GET", `${this.#path}/events`, { accept: "text/event-stream" });
    let text = "";
    const decoder = new TextDecoder();
    const reader = body.getReader();
    try {
      for (let part = await reader.read(); !part.done; part = await reader.read()) {
        const lines = (text + decoder.decode(part.value, { stream: true })).split("\n");
        text = lines.pop();
        for (const line of lines) if (line.startsWith("data: ")) yield (this.info = JSON.parse(line.slice("data: ".length)));
      }
    } finally {
      reader.cancel();
    }
  }

  /** Wait for the end, and return the file. */
  async result() {
    const events = this.events();
    while (!(await events.next()).done) {
      // `info` has changed.
    }
    return (await this.#client.call("GET", `${this.#path}/result`)).blob();
  }

  delete() {
    return this.#client.json("DELETE", this.#path);
  }
}

/** All particles at one frame, as the stream shows them. */
export class Frame {
  #raw;
  #positions = null;

  constructor(raw, types, length) {
    this.#raw = raw;
    this.number = raw.frame;
    this.time = raw.time;
    this.steered = raw.steered;
    this.solverMs = raw.solverMs;
    this.count = raw.count;
    this.dim = raw.dim;
    this.ids = raw.ids;
    this.types = raw.types ?? types;
    this.poses = raw.poses;
    this.length = length;
  }

  /** Coordinates, particle by particle, in 65535ths of `length`, as they were sent. */
  get numbers() {
    return this.#raw.positions;
  }

  /** Coordinates, particle by particle [m]. */
  get positions() {
    const scale = this.length / 65535;
    return (this.#positions ??= Float32Array.from(this.#raw.positions, (number) => number * scale));
  }
}

/**
 * Live frames of a session, and the commands of its player. Events: "frame", "status", "problem" and "message" (all other
 * messages), each with its content as `detail`, and "close", with {code, reason}.
 */
export class Stream extends EventTarget {
  #socket;
  #types;
  #length;

  static open(client, id) {
    const socket = client.socket(id);
    return new Promise((resolve, reject) => {
      socket.addEventListener("message", ({ data }) => resolve(new Stream(socket, JSON.parse(data))), { once: true });
      const refused = ({ code, reason }) => reject(new Problem("The stream was not opened", reason || `code ${code}`));
      socket.addEventListener("close", refused, { once: true });
    });
  }

  constructor(socket, hello) {
    super();
    this.hello = hello;
    this.status = null;
    this.#socket = socket;
    this.#types = decodeTypes(hello.types);
    this.#length = lengthOf(hello.scene);
    socket.addEventListener("message", ({ data }) => this.#receive(data));
    socket.addEventListener("close", ({ code, reason }) => this.#tell("close", { code, reason }));
  }

  #tell(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }

  #receive(data) {
    if (typeof data !== "string") {
      this.#tell("frame", new Frame(decodeFrame(data), this.#types, this.#length));
      return;
    }
    const message = JSON.parse(data);
    if (message.type === "status") this.#tell("status", (this.status = message));
    else if (message.type === "problem") this.#tell("problem", new Problem(message.title, message.detail, message.status ?? 0, { type: message.problem }));
    else this.#tell("message", message);
  }

  /** Frames as they come, the newest one where several came meanwhile; ends with the stream. */
  async *frames() {
    const listening = new AbortController();
    const { signal } = listening;
    let [newest, isOver, wake] = [null, this.#socket.readyState > 1, () => {}];
    this.addEventListener("frame", ({ detail }) => wake((newest = detail)), { signal });
    this.addEventListener("close", () => wake((isOver = true)), { signal });
    try {
      while (!isOver || newest !== null) {
        if (newest === null) await new Promise((resolve) => (wake = resolve));
        const frame = newest;
        newest = null;
        if (frame !== null) yield frame;
      }
    } finally {
      listening.abort();
    }
  }

  /** Send any command, as docs/reference/http-api.md describes them. */
  send(command) {
    this.#socket.send(JSON.stringify(command));
  }

  play() {
    this.send({ type: "play" });
  }

  pause() {
    this.send({ type: "pause" });
  }

  step(frames = 1) {
    this.send({ type: "step", frames });
  }

  reset() {
    this.send({ type: "reset" });
  }

  speed(value) {
    this.send({ type: "speed", value });
  }

  /** Push the fluid near a point [m] towards a velocity [m/s], until `letGo`. */
  push(hand) {
    this.send({ type: "push", ...hand });
  }

  /** Pull at a rigid body, until `letGo` or a push. */
  pull(grip) {
    this.send({ type: "pull", ...grip });
  }

  letGo() {
    this.send({ type: "push_end" });
  }

  close() {
    this.#socket.close();
  }
}
