// Types of client.js.

import type * as api from "./api.js";

export type * as api from "./api.js";

/** As `hybridmpm schema` describes it. */
type Scene = Record<string, unknown>;
/** A stroke, its points alone [m], a sketch as interpreted (such as a shape), several goals in turn, or a picture. */
export type Drawing = api.Stroke | [number, number][] | api.SketchRecord | api.KeyframeRequest[] | Blob;
/** Settings of a sketch. */
export type SketchSettings = Omit<api.SketchRequest, "strokes" | "sketch" | "keyframes">;

export interface Options {
  /** Token of a key or of a link, where the service has keys. It is sent in headers alone. */
  key?: string | null;
  /** In place of that of the platform. */
  fetch?: typeof fetch;
  /** In place of that of the platform; Node has one from version 22 on. */
  WebSocket?: typeof WebSocket;
}

export interface CallOptions {
  /** Cancels the call. */
  signal?: AbortSignal;
}

/** What a service refused, or why there is no answer. `message` is a sentence for people. */
export class Problem extends Error {
  constructor(title: string, detail?: string, status?: number, more?: Partial<Pick<Problem, "type" | "fields" | "retryAfter">>);
  title: string;
  /** Exact description; the fields that are wrong, where the service names them. */
  detail: string;
  /** HTTP status; 0 without an answer. */
  status: number;
  type: string;
  /** Last part of the type, as "session-not-found"; empty where there is none. */
  readonly kind: string;
  fields: api.FieldProblem[];
  /** When to try again [s]; null where that is not known. */
  retryAfter: number | null;
}

/** A service. All methods reject with a Problem. */
export class Client {
  /** @param address of the service; "http://127.0.0.1:8000" if absent */
  constructor(address?: string | URL, options?: Options);
  readonly address: URL;
  key: string | null;

  /** The whole address of a path of the service. */
  at(path: string): URL;
  /** Make any call and return its answer, which is a success. */
  call(
    method: string,
    path: string,
    options?: CallOptions & { body?: unknown; accept?: string; keepalive?: boolean; query?: Record<string, unknown> },
  ): Promise<Response>;
  /** Make any call and return its JSON; null where there is none. */
  json(method: string, path: string, body?: unknown, options?: CallOptions & { query?: Record<string, unknown> }): Promise<any>;
  /** A connection to the stream of a session, whose messages are not decoded. */
  socket(id: string): WebSocket;

  /** Whether a session can be created now; rejects with the reason otherwise. */
  ready(): Promise<true>;
  scenarios(): Promise<api.ScenarioBody[]>;
  scenario(name: string, seed?: number): Promise<Scene>;
  models(): Promise<api.ModelBody[]>;
  /** The method that simulates a scene within an error or a time. */
  plan(request: api.PlanRequest): Promise<api.PlanBody>;
  /** Findings about a scene before its first frame. */
  check(request: api.CheckScene): Promise<api.CheckBody>;
  outlines(request: api.OutlinesRequest, options?: { signal?: AbortSignal }): Promise<api.OutlinesBody>;
  /** The shape in a file with this ending, such as "svg", as fields of a body or an obstacle; `place` is in metres. */
  shape(file: Blob, kind: string, place: { height: number; x?: number; y?: number; z?: number }): Promise<api.ShapeBody>;
  /** A session, paused at frame 0: of a scenario, of a scene or of a log. */
  create(request: api.CreateSession, options?: CallOptions): Promise<Session>;
  /** All sessions, oldest first. */
  sessions(): Promise<Session[]>;
  session(id: string): Promise<Session>;
  makeDataset(request: api.MakeDataSet): Promise<Job>;
  jobs(): Promise<Job[]>;
  job(id: string): Promise<Job>;
}

/** The state of a session: N particles in `dim` dimensions. */
export interface Particles {
  frame: number;
  /** [s] */
  time: number;
  dim: 2 | 3;
  /** N x dim, particle by particle [m]. */
  positions: Float32Array;
  /** N x dim [m/s]. */
  velocities: Float32Array;
  /** 5 water, 6 sand, 7 elastic, 8 viscous liquid. */
  types: Uint8Array;
  ids: number[];
  /** Of each rigid body: 3 numbers of its centre [m], 4 of the quaternion, 3 of velocity [m/s] and angular velocity [rad/s] each. */
  rigid: number[][];
}

/** A running simulation of a service; it lives on when this object is gone. */
export class Session {
  readonly id: string;
  /** The newest description that the service has sent. */
  info: api.SessionBody;

  refresh(): Promise<api.SessionBody>;
  /** Compute frames; the description after them. */
  advance(frames?: number): Promise<api.SessionBody>;
  particles(): Promise<Particles>;
  particlesFile(kind: "npz" | "ply" | "vtp"): Promise<Blob>;
  surfaceFile(kind: "glb" | "ply"): Promise<Blob>;
  startFile(): Promise<ArrayBuffer>;
  ways(): Promise<ArrayBuffer>;
  /** Another session that goes on from the present state. */
  fork(): Promise<Session>;
  /** What the session can be computed again from. */
  log(): Promise<api.LogBody>;
  decisions(): Promise<api.DecisionBody[]>;
  /** Let a sketch steer the session; `signal` takes it back as long as there is no answer. */
  steer(drawing: Drawing, settings?: SketchSettings, options?: CallOptions): Promise<api.SketchBody>;
  /** The sketch that steers and its goal, as `steer` has answered it; null without one. */
  sketch(): Promise<api.SketchBody | null>;
  /** Let no sketch steer the session any more. */
  release(): Promise<null>;
  force(): Promise<api.ForceBody>;
  pressure(): Promise<api.PressureBody>;
  /** Follow a sketch on a copy of the session. */
  trace(drawing: Drawing, settings?: SketchSettings, options?: CallOptions & { stride?: number }): Promise<api.TrajectoryBody>;
  record(request: api.RecordSession): Promise<Job>;
  /** A link that shows the session to those without a key. */
  link(request?: api.MakeLink): Promise<api.LinkBody>;
  takeLinksBack(): Promise<null>;
  /** End the session: at once, or `after` some seconds in which no command comes. `keepalive` is for a page that is left. */
  delete(options?: { after?: number; keepalive?: boolean }): Promise<null>;
  /** Watch the session, and command its player. */
  stream(): Promise<Stream>;
}

/** Work of a service in the background. */
export class Job {
  readonly id: string;
  info: api.JobBody;
  refresh(): Promise<api.JobBody>;
  /** Each change of `info`, until the job has ended. */
  events(): AsyncGenerator<api.JobBody, void>;
  /** Wait for the end, and return the file. */
  result(): Promise<Blob>;
  delete(): Promise<null>;
}

/** All particles at one frame, as the stream shows them. */
export class Frame {
  readonly number: number;
  /** Simulated time [s]. */
  readonly time: number;
  /** Whether a sketch steered this frame. */
  readonly steered: boolean;
  readonly solverMs: number;
  readonly count: number;
  readonly dim: 2 | 3;
  /** Ascending, where particles come and go; else null. */
  readonly ids: Uint32Array | null;
  /** 5 water, 6 sand, 7 elastic, 8 viscous liquid. */
  readonly types: Uint8Array;
  /** Longest side of the world [m]. */
  readonly length: number;
  /** Coordinates, particle by particle, in 65535ths of `length`. */
  readonly numbers: Uint16Array;
  /** Coordinates, particle by particle [m]. */
  readonly positions: Float32Array;
  /** Of each rigid body: in 2D centre [m] and angle [rad], in 3D centre and unit quaternion, the scalar first; null without one. */
  readonly poses: Float32Array | null;
}

/** A rigid body in its own frame, about the centre of mass [m]. */
export interface Solid {
  shape: "box" | "ball" | "cylinder" | "hull";
  /** Half sides of a box; half the length of a cylinder, whose axis is y. */
  half?: number[] | number;
  radius?: number;
  /** Corners of a hull, in 2D in order, anticlockwise. */
  corners?: number[][];
  /** Three corners each, in 3D, anticlockwise from outside. */
  triangles?: number[][];
  /** [kg], in 2D per metre of depth. */
  mass: number;
}

export interface Hello {
  type: "hello";
  version: 3;
  session: api.SessionBody;
  /** What viewers need of the scene. */
  scene: Scene;
  /** Distance of neighbouring particles at rest [m]. */
  spacing: number;
  types: string | null;
  /** The rigid bodies, in the order of the scene and of the poses in frames. */
  rigid: Solid[];
}

export interface Status {
  type: "status";
  session: api.SessionBody;
  history: api.HistoryBody | null;
  forces: api.Forces | null;
  /** Median solver time of a frame [ms]; 0 before the first one. */
  ms_per_frame: number;
  /** 95th percentile of the same [ms]. */
  ms_p95: number;
  /** Measured speed: simulated seconds per second. */
  time_scale: number;
}

export interface StreamEvents {
  frame: CustomEvent<Frame>;
  status: CustomEvent<Status>;
  problem: CustomEvent<Problem>;
  /** Any other message. */
  message: CustomEvent<{ type: string }>;
  close: CustomEvent<{ code: number; reason: string }>;
}

/** Live frames of a session, and the commands of its player. */
export class Stream extends EventTarget {
  readonly hello: Hello;
  /** The newest one; null at first. */
  readonly status: Status | null;
  addEventListener<K extends keyof StreamEvents>(type: K, listener: (event: StreamEvents[K]) => void, options?: AddEventListenerOptions | boolean): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject | null, options?: AddEventListenerOptions | boolean): void;
  removeEventListener<K extends keyof StreamEvents>(type: K, listener: (event: StreamEvents[K]) => void, options?: EventListenerOptions | boolean): void;
  removeEventListener(type: string, listener: EventListenerOrEventListenerObject | null, options?: EventListenerOptions | boolean): void;
  /** Frames as they come, the newest one where several came meanwhile; ends with the stream. */
  frames(): AsyncGenerator<Frame, void>;
  /** Send any command, as docs/reference/http-api.md describes them. */
  send(command: { type: string } & Record<string, unknown>): void;
  play(): void;
  pause(): void;
  step(frames?: number): void;
  reset(): void;
  /** @param value simulated seconds per second, 0.01 to 1 */
  speed(value: number): void;
  /** Push the fluid near a point [m] towards a velocity [m/s], until `letGo` or the next push. */
  push(hand: api.Hand): void;
  /** Pull at a rigid body, until `letGo` or a push. */
  pull(grip: api.Grip): void;
  letGo(): void;
  close(): void;
}
