// What calls of the service take and return, by its OpenAPI document. `make types` writes this.
// A field that may be absent has a default.

export interface AdvanceSession {
  /** Number of frames to compute, at most the setting max_advance_frames. */
  frames?: number;
}

export interface CheckBody {
  /** Title of the scene. */
  scene: string;
  /** Whether there is no error among the findings. */
  ok: boolean;
  /** Number of particles that are shown at frame 0. */
  particles: number | null;
  /** Whether MPM's substeps are below the stability limit; null also where a network moves the particles, for which no bound is known. */
  stable: boolean | null;
  /** Bound that chose the shortest substep: "sound", "speed", "obstacle", "frame", "reference" or "fixed"; null also where a network made the frames. */
  bound: string | null;
  /** Substeps of the first frames; null as with `bound`. */
  substeps: number | null;
  /** Time of a frame [ms], measured on this server in the first frames. */
  milliseconds: number | null;
  /** Estimated memory of the simulation [bytes]. */
  memory: number | null;
  /** Faults, risks and costs of the scene: the gravest 20 findings. */
  findings: FindingBody[];
}

export interface CheckScene {
  /** Scenario of the scene: one of water_2d, water_ramps_2d, sand_2d, sand_ramps_2d, water_3d, sand_3d, water_sand_2d. */
  scenario?: string | null;
  /** Seed of the scenario; 0 if absent. */
  seed?: number | null;
  /** Scene of your own, in place of a scenario, as `hybridmpm schema` describes it. */
  scene?: Record<string, unknown> | null;
  /** Simulator: MPM (mpm), a network that MPM replaces where a guard alarms (hybrid), or a network alone (neural). */
  solver?: "mpm" | "neural" | "hybrid";
  /** Coarse level: the ratio of simulated to shown particles, one of 1/64, 1/32, 1/16, 1/8, 1/4. Only with mpm; all particles are simulated if absent. */
  coarse?: string | null;
  /** Name of the network, from `GET /v1/models`; not with mpm. If absent, the first that serves the scenario; required with a scene. */
  model?: string | null;
  /** Mean cosine below which the safeguard alarms; only with hybrid. If absent, other guards alone watch the network. */
  r_c?: number | null;
}

export interface Control {
  /** Number of the sketch in its session, counted from 1. */
  number: number;
  /** Kind of the sketch; of several in turn that of the present one. */
  kind: "arrow" | "ellipse" | "shape" | "solid";
  /** preparing: it is being planned; an older one may steer meanwhile. steering: it leads the fluid to the goal. out_of_reach: as steering, but something is known to be in the way. holding: it keeps the goal. done: it no longer steers. */
  phase: "preparing" | "steering" | "out_of_reach" | "holding" | "done";
  /** Name of the method that planned. */
  method?: string | null;
  /** Frame of the session at which the sketch began to steer. */
  first_frame?: number | null;
  /** Number of frames that the sketch has steered so far, those of `hold` included. */
  frames_done?: number;
  /** Number of frames in which the goal is to be reached, of several the last. */
  frames?: number | null;
  /** Number of the present goal among several, from 0 on; null where there is one. */
  keyframe?: number | null;
  /** Number of frames for which the goal is kept after that. */
  hold?: number | null;
  /** Share of the mass in the goal after `frames`; null before, and for an arrow that keeps the fluid's shape. */
  inside?: number | null;
  /** Share of the mass in the oval as it was drawn, at the same time; null for an arrow. */
  inside_drawn?: number | null;
  /** Distance of the centre of mass from its target, at the same time [m]. */
  miss?: number | null;
}

export interface CreateSession {
  /** Scenario of the scene: one of water_2d, water_ramps_2d, sand_2d, sand_ramps_2d, water_3d, sand_3d, water_sand_2d. */
  scenario?: string | null;
  /** Seed of the scenario; 0 if absent. */
  seed?: number | null;
  /** Scene of your own, in place of a scenario, as `hybridmpm schema` describes it. */
  scene?: Record<string, unknown> | null;
  /** Simulator: MPM (mpm), a network that MPM replaces where a guard alarms (hybrid), or a network alone (neural). */
  solver?: "mpm" | "neural" | "hybrid";
  /** Coarse level: the ratio of simulated to shown particles, one of 1/64, 1/32, 1/16, 1/8, 1/4. Only with mpm; all particles are simulated if absent. */
  coarse?: string | null;
  /** Name of the network, from `GET /v1/models`; not with mpm. If absent, the first that serves the scenario; required with a scene. */
  model?: string | null;
  /** Mean cosine below which the safeguard alarms; only with hybrid. If absent, other guards alone watch the network. */
  r_c?: number | null;
  /** Log of a session, in place of everything else: it is computed again, which takes as long as its frames took. */
  log?: LogBody | null;
}

export interface DecisionBody {
  /** Frame whose end is the first state that `mode` goes on from. */
  frame: number;
  /** Simulator from there on: MPM or the network. */
  mode: "neural" | "mpm";
  /** Value of the guard that decided, or of the safeguard where no guard did; null where there is none. */
  value: number | null;
  /** Name of the guard that decided; where no guard did, "warm-up", "calm", "free_fall", "rest", "force" or "unsound". */
  reason: string;
  /** Frame of the decision; later than `frame` where frames of the network were undone. */
  noticed: number;
}

export interface DecisionList {
  /** Decisions in the order in which they were made. */
  decisions: DecisionBody[];
}

export interface EstimateBody {
  /** Name of the method. */
  name: string;
  /** Mean error by the measure. */
  error: number;
  /** Its standard error over the scenes of the calibration. */
  error_se: number | null;
  /** Error that nine of ten such scenes stay below; `max_error` is compared with it. */
  error_bound: number | null;
  /** Median time of a frame in mid-splash on one thread of the server [ms]. */
  ms_per_frame: number;
}

export interface FieldProblem {
  /** Path of the field. */
  field: string;
  /** What is wrong with its value. */
  message: string;
}

export interface FindingBody {
  /** error: the scene does not run, or not stably. warning: it runs, but the result may not be the expected one. note: it costs more than necessary. */
  severity: "error" | "warning" | "note";
  /** Path of the part of the scene; "" for the whole. */
  field: string;
  /** Description of the fault, with its figures. */
  problem: string;
  /** Remedy; "" where the problem already names it. */
  advice: string;
}

export interface ForceBody {
  /** Number of frames before that frame. */
  frame: number;
  /** Side of a cell [m]. */
  cell: number;
  /** Mean position of the particles of each cell [m]. */
  points: number[][];
  /** Mean acceleration of these particles, without gravity [m/s^2]. */
  force: number[][];
}

export interface Forces {
  /** Number of these frames, at most 40. */
  frames: number;
  /** Names of the walls, such as "y_lower", and "obstacles[0]" and so on; the first 64. */
  solids: string[];
  /** Force on each, D components [N]; in 2D per metre of depth. */
  force: number[][];
  /** Torque on each about the origin, 1 number in 2D, 3 in 3D [N m]. */
  torque: number[][];
}

export interface GoalBody {
  /** Planned path of the centre of mass; [point][axis] [m]. */
  path: number[][];
  /** Outline of the oval as it was drawn, within the walls; [point][axis] [m]. Null for an arrow and a shape. */
  drawn: number[][] | null;
  /** Outlines of a shape, or of a solid in the front view, at the size to fill, within the walls; [line][point][axis] [m]. Null for others. */
  outlines?: number[][][] | null;
  /** Outline of the region to fill, within the walls; [point][axis] [m]. It is the oval, grown or shrunk as `needs.scale` says, or a disc around the tip of an arrow. Obstacles take their part of it. Null where an arrow keeps the fluid's shape. */
  region: number[][] | null;
}

export interface Grip {
  /** Number of the body in the scene. */
  body: number;
  /** Point that is held, from the centre of mass, in the body's own frame [m]. */
  grip: number[];
  /** Point that it is drawn to [m]. */
  target: number[];
  /** Distance of both at which a spring at rest gives `strength` [m]. */
  reach: number;
  /** Largest force [N], in 2D per metre of depth. */
  strength: number;
}

export interface Hand {
  /** Centre [m]. */
  point: number[];
  /** Velocity of the hand [m/s]. */
  velocity: number[];
  /** Reach of the force [m]. */
  radius: number;
  /** Largest acceleration of a particle [g = 9.81 m/s^2]. */
  cap?: number;
}

export interface Health {
  /** State of the process: "alive" or "ready". */
  status: string;
}

export interface HistoryBody {
  /** Frames at which `values` were taken, ascending. */
  frames: number[];
  /** Values of the safeguard at these frames. */
  values: number[];
  /** First frame and simulator of each phase. */
  phases: ([number, "neural" | "mpm"])[];
  /** The latest 16 decisions, oldest first. */
  decisions: DecisionBody[];
}

export interface JobBody {
  /** Name of the job. */
  id: string;
  /** Kind of its result. */
  kind: "trajectory" | "recording" | "dataset";
  /** Name of the key that the job belongs to; null without keys. */
  key?: string | null;
  /** Session of the job, which ends with it. Null for a data set. */
  session: string | null;
  /** running, done or failed. */
  phase: "running" | "done" | "failed";
  /** Number of frames, or other parts, that are done. */
  done: number;
  /** Number of all parts; null until it is known. */
  total: number | null;
  /** Reason of a failure; null without one. */
  problem: Problem | null;
  /** Addresses of the job, its events and its result. */
  links: Record<string, string>;
}

export interface JobList {
  /** Running jobs and those whose results are kept, the oldest first; those of this node come first. */
  jobs: JobBody[];
  /** Names of the nodes that did not answer, so that theirs are missing. */
  missing_nodes?: string[];
}

export interface KeyframeRecord {
  /** The sketch of the goal. */
  sketch: SketchRecord;
  /** Number of frames from the goal before to this one. Chosen by the needs of the goal if absent. */
  frames?: number | null;
  /** Number of frames for which the goal is kept. */
  hold?: number;
  /** Particles that are led to it, as of a sketch, chosen in the state at the start. */
  who?: number | "water" | "sand" | "elastic" | "liquid" | OfParticle | Stroke | null;
}

export interface KeyframeRequest {
  /** Strokes of the goal: exactly one. */
  strokes?: Stroke[] | null;
  /** The goal as interpreted, in place of strokes. */
  sketch?: SketchRecord | null;
  /** Number of frames from the goal before to this one. Chosen by the needs of the goal if absent. */
  frames?: number | null;
  /** Number of frames for which the goal is kept. */
  hold?: number;
  /** Particles that are led to it, as of a sketch, chosen in the state at the start. */
  who?: number | "water" | "sand" | "elastic" | "liquid" | OfParticle | Stroke | null;
}

export interface LastFrame {
  /** Number of MPM's substeps; null where a network made the frame. */
  substeps: number | null;
  /** Bound that chose the length of the substeps: "sound", "speed", "obstacle", "frame", "reference" or "fixed"; null where a network made the frame. */
  bound: string | null;
  /** Time that the simulator took for the frame [ms]. */
  ms: number;
}

export interface LegBody {
  /** The sketch as interpreted. */
  sketch: Record<string, unknown>;
  /** Frames since the start of the sequence at which it begins. */
  start: number;
  /** Number of frames in which the goal is to be reached. */
  frames: number;
  /** Number of frames for which it is kept. */
  hold: number;
  /** Velocity of the centre of mass at the goal [m/s]; null for rest. */
  velocity: number[] | null;
  needs: NeedsBody;
}

export interface LimitedSettings {
  /** Method that plans: auto, or one of none, constant, analytic, learned, controlnet. */
  method?: string;
  /** Number of frames in which the goal is to be reached; with `hold` at most the setting max_sketch_frames. Chosen by the needs of the goal if absent. */
  frames?: number | null;
  /** Largest acceleration of a particle [g = 9.81 m/s^2]. */
  cap?: number;
  /** Factor on `cap`. */
  strength?: number;
  /** Number of frames for which the goal is kept after it was reached. */
  hold?: number;
  /** Treatment of an oval larger than the fluid: filled evenly (even), or shrunk to the volume of the fluid (shrink). */
  fill?: "even" | "shrink";
  /** Particles that the sketch leads, all of them if absent: the index of a body, a material, the body of a particle, or the particles under a stroke. */
  who?: number | "water" | "sand" | "elastic" | "liquid" | OfParticle | Stroke | null;
  /** Seed of random numbers of a method. */
  seed?: number;
  /** Largest number of frames, above that of `hold`. */
  most: number;
}

export interface LinkBody {
  /** Token to send in place of a key; it shows this session alone. */
  token: string;
  /** Time from which it is not valid any more [s since 1970]. */
  until: number;
  /** Address of the page that shows the session; browsers send nothing behind the #. */
  page: string;
}

export interface LogBody {
  /** Version of the form of the log. */
  format: 1;
  /** Versions that computed the session. */
  versions: Versions;
  /** Scenario that the scene was drawn from; null where a scene was sent. */
  scenario: string | null;
  /** Seed of the scenario. */
  seed: number | null;
  /** Scene, as `hybridmpm schema` describes it. */
  scene: Record<string, unknown>;
  /** Simulator. */
  solver: "mpm" | "neural" | "hybrid";
  /** Coarse level; null where none was chosen. */
  coarse: string | null;
  /** Name of the network; null without one. */
  model: string | null;
  /** Value below which the safeguard alarms. */
  r_c: number | null;
  /** Frame at which the log ends. */
  frame: number;
  /** Inputs of the session, in order; frames ascend. */
  inputs: (SketchInput | ReleaseInput | PushInput | PullInput)[];
  /** SHA-256 of the state in which the log ends: ids (uint64), positions and velocities (float32), little-endian, one after the other, as `particles` answers them. */
  digest: string;
}

export interface MakeDataSet {
  /** Scenario of the scenes: one of water_2d, water_ramps_2d, sand_2d, sand_ramps_2d, water_3d, sand_3d, water_sand_2d. */
  scenario: string;
  /** Number of trajectories for training. */
  trajectories: number;
  /** Number of trajectories for validation. */
  valid?: number;
  /** Number of trajectories for tests. */
  test?: number;
  /** First seed of each split, counted from the start of the split's seeds. */
  seed?: number;
  /** Number of frames of a trajectory; that of the scenario if absent. All trajectories together have at most the setting max_dataset_frames. */
  frames?: number | null;
  /** Number of frames from one stored state to the next. */
  stride?: number;
  /** Ratio of the particles to those of the scene. */
  r_p?: number;
}

export interface MakeLink {
  /** Time until it expires [s]. */
  seconds?: number;
}

export interface ModelBody {
  /** Name of the network. */
  name: string;
  /** Scenarios that the network serves. */
  scenarios: string[];
  /** Ratio of its particles to those of the scene, in (0, 1]. */
  r_p: number;
  /** Number of frames of one of its steps. */
  r_t: number;
  /** Size of its latent vectors. */
  latent: number;
  /** Number of its message passing layers. */
  layers: number;
  /** Distance within which particles are neighbours [m]. */
  radius: number;
  /** Number of its parameters. */
  parameters: number;
  /** Versions of the solvers that made its training data. */
  solver_versions: number[];
  /** SHA-256 digest of its file. */
  sha256: string;
}

export interface ModelList {
  /** Networks; the first that serves a scenario is the scenario's default. */
  models: ModelBody[];
}

export interface NeedsBody {
  /** Largest acceleration that 95 % of the mass needs [g]. */
  acceleration: number;
  /** Largest acceleration that any group of particles needs [g]. */
  peak: number;
  /** Root mean square of the least force over mass and time [g]. */
  rms: number;
  /** Largest allowed acceleration [g]. */
  cap: number;
  /** Number of frames in which the goal is to be reached. */
  frames: number;
  /** Fewest frames in which it is reached with ease. */
  suggested_frames: number;
  /** Size of the goal over that of the drawn oval: above 1 if it was grown to the fluid's volume, below 1 if it was shrunk to it, 1 for an arrow. */
  scale: number;
  /** Share of the drawn oval that walls and obstacles take. */
  taken: number;
  /** Whether no obstruction is known. */
  reachable: boolean;
  /** Known obstructions; empty if the goal is within reach. */
  obstructions: ObstructionBody[];
  /** Remarks that keep nothing out of reach, e.g. that the way was bent round an obstacle. */
  notes: string[];
  /** Summary in words. */
  text: string;
}

export interface ObstructionBody {
  /** Kind of the obstruction. */
  reason: "wall" | "obstacle" | "shape" | "time" | "cap";
  /** Description of the obstruction, with a remedy. */
  message: string;
}

export interface OfParticle {
  /** Number of the particle. */
  particle: number;
}

export interface OutlinesBody {
  /** The shape, as sketches and keyframes take it. */
  sketch: Record<string, unknown>;
  /** Its area in the front view [m^2]. */
  area: number;
}

export interface OutlinesRequest {
  /** Words, traced in the font Aileron. */
  text?: string | null;
  /** A PNG, JPEG or WebP file of at most 1 MiB in base 64, whose dark parts are traced. */
  picture?: string | null;
  /** Attribute d of a path in SVG, closed. */
  path?: string | null;
  /** Middle of the rectangle around the shape [m]. */
  center: number[];
  /** Height of that rectangle [m]. */
  height: number;
  /** Width of the stroke, which gives the depth in 3D [pixels of 512]. */
  width?: number | null;
}

export interface ParticlesBody {
  /** Number of frames since the start. */
  frame: number;
  /** Simulated time since the start [s]. */
  time: number;
  /** Positions; [particle][axis] [m]. */
  positions: number[][];
  /** Velocities; [particle][axis] [m/s]. */
  velocities: number[][];
  /** Type of each particle: 3 kinematic, 5 water, 6 sand, 7 elastic (goop), 8 viscous liquid. */
  types: number[];
  /** Permanent number of each particle, ascending; new particles have larger ones. */
  ids: number[];
  /** Centre of mass [m], unit quaternion of the turn with the scalar first, velocity [m/s] and angular velocity [rad/s] of each rigid body: 3, 4, 3 and 3 numbers, also in 2D. */
  rigid: number[][];
}

export interface PlanBody {
  /** Name of the method. */
  name: string;
  /** Mean error by the measure. */
  error: number;
  /** Its standard error over the scenes of the calibration. */
  error_se: number | null;
  /** Error that nine of ten such scenes stay below; `max_error` is compared with it. */
  error_bound: number | null;
  /** Median time of a frame in mid-splash on one thread of the server [ms]. */
  ms_per_frame: number;
  /** Measure of the error. */
  measure: "grid_rmse" | "grid_nrmse" | "grid_node_error" | "transport" | "kinetic_energy" | "centroid";
  /** Whether it meets the limit; otherwise it is the nearest method. */
  feasible: boolean;
  /** Ratio of the simulated particles to those of the scene. */
  r_p: number;
  /** Estimated number of simulated particles. */
  particles: number;
  /** Cells per metre of their grid. */
  resolution: number;
  /** Estimated number of substeps of a frame in mid-splash. */
  substeps: number;
  /** Whether all particles of the scene are shown where fewer are simulated. */
  show_all: boolean;
  /** Fields of `POST /v1/sessions` that choose this method; null where no session can have it. */
  session: Record<string, unknown> | null;
  /** All compared methods, the fastest first. */
  candidates: EstimateBody[];
  /** The second choice. */
  runner_up: EstimateBody | null;
  /** Reason of the choice; for an infeasible limit, the requirements of a feasible one. */
  reason: string;
  /** Sources of the figures. */
  notes: string[];
}

export interface PlanRequest {
  /** Scenario of the scene: one of water_2d, water_ramps_2d, sand_2d, sand_ramps_2d, water_3d, sand_3d, water_sand_2d. */
  scenario?: string | null;
  /** Seed of the scenario; 0 if absent. */
  seed?: number | null;
  /** Scene of your own, in place of a scenario, as `hybridmpm schema` describes it. */
  scene?: Record<string, unknown> | null;
  /** Largest mean error: the answer is the fastest method within it. */
  max_error?: number | null;
  /** Longest time of a frame [ms]: the answer is the most accurate method within it. */
  budget_ms?: number | null;
  /** Measure of the error. */
  measure?: "grid_rmse" | "grid_nrmse" | "grid_node_error" | "transport" | "kinetic_energy" | "centroid";
}

export interface PressureBody {
  /** Number of frames since the start. */
  frame: number;
  /** Side of a cell [m]. */
  cell: number;
  /** Mean position of the particles of each cell [m]. */
  points: number[][];
  /** Mean pressure of these particles [Pa]. */
  pressure: number[];
}

export interface Problem {
  /** Name of the kind of problem. */
  type: string;
  /** Title of the kind of problem. */
  title: string;
  /** HTTP status. */
  status: number;
  /** What went wrong this time, and what to change. */
  detail: string;
  /** Path of the request. */
  instance: string;
  /** Fields whose values are not allowed, where the problem is about fields. */
  errors?: FieldProblem[] | null;
}

export interface PullInput {
  /** Kind of the input. */
  kind?: "pull";
  /** First frame whose state it acts on. */
  frame: number;
  /** Force of the hand. */
  pull: Grip;
}

export interface PushInput {
  /** Kind of the input. */
  kind?: "push";
  /** First frame whose state it acts on. */
  frame: number;
  /** Force of the hand; null ends it, and a pull. */
  push: Hand | null;
}

export interface ReachedBody {
  /** Share of the mass in the goal; null where an arrow keeps the fluid's shape. */
  inside: number | null;
  /** Share of the mass in the oval as it was drawn; null for an arrow. */
  inside_drawn: number | null;
  /** Distance of the centre of mass from its target [m]. */
  miss: number;
  /** Root mean square of the force over mass and time [g]. */
  rms: number;
  /** Largest force on a particle [g]. */
  peak: number;
}

export interface RecordSession {
  /** Number of frames to compute, at most the setting max_advance_frames. */
  frames: number;
  /** Number of frames from one recorded state to the next. */
  every?: number;
  /** File to write: arrays (npz), a film (gif; mp4 where the server has an encoder), or four pictures side by side (png). */
  format?: "npz" | "gif" | "mp4" | "png";
  /** Width of a picture of a film or strip [pixels]. */
  width?: number;
  /** Simulated seconds in a second of film, which may last a minute. */
  speed?: number;
}

export interface ReleaseInput {
  /** Kind of the input. */
  kind?: "release";
  /** First frame whose state no sketch acts on. */
  frame: number;
}

export interface SafeguardBody {
  /** Value below which the safeguard alarms, so that MPM takes over; null where other guards alone do. */
  r_c: number | null;
  /** Mean cosine in [-1, 1]; null until both windows are full. */
  value: number | null;
  /** Share of the frames so far that MPM simulated, in [0, 1]. */
  mpm_share: number;
}

export interface ScenarioBody {
  /** Name of the scenario. */
  name: string;
  /** Dimension of its scenes. */
  dim: 2 | 3;
  /** Suggested number of frames of a simulation. */
  frames: number;
  /** Largest number of particles of its scenes. */
  max_particles: number;
  /** Contents of its scenes. */
  text: string;
}

export interface ScenarioList {
  /** Scenarios. */
  scenarios: ScenarioBody[];
}

export interface SessionBody {
  /** Name of the session in its address. */
  id: string;
  /** Name of the key that the session belongs to; null without keys. */
  key?: string | null;
  /** Scenario of the scene; null where a scene was sent. */
  scenario: string | null;
  /** Seed of the scenario; null where a scene was sent. */
  seed: number | null;
  /** Dimension D of the scene. */
  dim: 2 | 3;
  /** Number N of particles; it changes where the scene has emitters or sinks. */
  particles: number;
  /** Number of frames since the start. */
  frame: number;
  /** Simulated time since the start [s]. */
  time: number;
  /** Simulated time of a frame [s]. */
  frame_dt: number;
  /** Whether the player computes frames. */
  playing: boolean;
  /** Whether the tab of a viewer computes the frames first, and the player those that it has reported. */
  led: boolean;
  /** Target speed of the player: simulated seconds per second. */
  speed: number;
  /** Centre of mass, D numbers [m]; null where there is no particle. */
  centroid: number[] | null;
  /** Simulator of the session. */
  solver: "mpm" | "neural" | "hybrid";
  /** Coarse level: the ratio of simulated to shown particles, as "1/16"; null where all are simulated. */
  coarse: string | null;
  /** Name of the network; null where MPM simulates alone. */
  model: string | null;
  /** Ratio of the simulated particles to those of the scene, in (0, 1]. */
  r_p: number;
  /** Simulator of the next frame: MPM or the network. */
  mode: "neural" | "mpm";
  /** Safeguard of the network; null unless the session is hybrid. */
  safeguard: SafeguardBody | null;
  /** The newest sketch; null where there was none since frame 0. */
  control: Control | null;
  /** Report on the latest frame; null before the first. */
  last_frame: LastFrame | null;
  /** Storage of the session: in memory alone (memory), also on disk, so that it survives a crash (disk), or in memory because the disk cannot be written at present (failing). */
  kept: "memory" | "disk" | "failing";
  /** Remark on a session that was computed again; null where there is none. */
  notice: string | null;
  /** Static findings of the scene's check: at most 20 warnings and notes, the gravest first. Scenes with errors are refused. */
  findings: FindingBody[];
  /** Addresses of the session and its parts: self, stream, advance, particles, fork, log, sketches, trajectories, decisions. */
  links: Record<string, string>;
}

export interface SessionList {
  /** Sessions, oldest first; those of this node come first. */
  sessions: SessionBody[];
  /** Names of the nodes that did not answer, so that theirs are missing. */
  missing_nodes?: string[];
}

export interface ShapeBody {
  /** Kind of the shape: a polygon in 2D, a mesh in 3D. */
  shape: "polygon" | "mesh";
  /** Corners [m]; more than 1000 of a mesh are a text, base 64 of float64, little-endian, three a corner. */
  vertices: number[][] | string;
  /** Indices of three vertices each, of a mesh; more than 1000 are a text as well, of uint32. */
  triangles?: number[][] | string | null;
}

export interface SketchBody {
  /** The sketch as interpreted: an "arrow" with `points` [m], an "ellipse" with `center` [m], semi-`axes` [m] and `angle` [rad], a "shape" with `outlines` [m], or a "solid" with `vertices` [m] and `triangles`. In 3D `widths` or `width` [pixels] give the depth of the others. */
  sketch: Record<string, unknown>;
  /** Name of the method that planned. */
  method: string;
  /** Reason of this method. */
  reason: string;
  /** Number of frames in which the goal is to be reached. */
  frames: number;
  /** Number of frames for which the goal is kept after that. */
  hold: number;
  /** Frame of the session at which the sketch begins to steer. */
  first_frame: number;
  /** Time of the planning [ms]. */
  planning_ms: number;
  needs: NeedsBody;
  goal: GoalBody;
  /** Several goals in turn, of which the fields above describe the present one, and `frames` and `hold` the last; null for one sketch. */
  keyframes?: LegBody[] | null;
  /** Number of the sketch in its session, counted from 1. */
  number: number;
  /** Frame of the session whose state the sketch was planned for; `first_frame` is later where the session went on meanwhile. */
  drawn_frame: number;
}

export interface SketchInput {
  /** Kind of the input. */
  kind?: "sketch";
  /** First frame whose state it acts on. */
  frame: number;
  /** Number of the sketch in its session, counted from 1. */
  number: number;
  /** Frame of the state that it was planned for. */
  drawn_frame: number;
  /** Name of the method that planned. */
  planned_by: string;
  /** The sketch, or the first of several. */
  sketch: SketchRecord;
  /** Several sketches in turn; null where there is one. */
  keyframes?: KeyframeRecord[] | null;
  /** Their settings. */
  settings: LimitedSettings;
}

export interface SketchRecord {
  /** Kind of the sketch. */
  kind: "arrow" | "ellipse" | "shape" | "solid";
  /** Points of an arrow from tail to tip [m]. */
  points?: number[][] | null;
  /** Width of an arrow's stroke at each point [pixels of 512]. */
  widths?: number[] | null;
  /** Centre of an ellipse [m]. */
  center?: number[] | null;
  /** Semi-axes of an ellipse, major first [m]. */
  axes?: number[] | null;
  /** Angle of the major axis to +x [rad]. */
  angle?: number | null;
  /** Closed lines of a shape [m]. */
  outlines?: number[][][] | null;
  /** Corners of the triangles of a solid [m], as of a mesh in a scene. */
  vertices?: number[][] | string | null;
  /** Triangles of a solid, three indices of vertices each, all of them the same way round. */
  triangles?: number[][] | string | null;
  /** Width of the stroke of an ellipse or a shape [pixels of 512]. */
  width?: number | null;
  /** How a picture was read, where that is not obvious. */
  note?: string | null;
}

export interface SketchRequest {
  /** Method that plans: auto, or one of none, constant, analytic, learned, controlnet. */
  method?: string;
  /** Number of frames in which the goal is to be reached; with `hold` at most the setting max_sketch_frames. Chosen by the needs of the goal if absent. */
  frames?: number | null;
  /** Largest acceleration of a particle [g = 9.81 m/s^2]. */
  cap?: number;
  /** Factor on `cap`. */
  strength?: number;
  /** Number of frames for which the goal is kept after it was reached. */
  hold?: number;
  /** Treatment of an oval larger than the fluid: filled evenly (even), or shrunk to the volume of the fluid (shrink). */
  fill?: "even" | "shrink";
  /** Particles that the sketch leads, all of them if absent: the index of a body, a material, the body of a particle, or the particles under a stroke. */
  who?: number | "water" | "sand" | "elastic" | "liquid" | OfParticle | Stroke | null;
  /** Seed of random numbers of a method. */
  seed?: number;
  /** Strokes of the sketch: exactly one. */
  strokes?: Stroke[] | null;
  /** The sketch as interpreted, in place of strokes; a shape has no other form. */
  sketch?: SketchRecord | null;
  /** Several sketches in turn. */
  keyframes?: KeyframeRequest[] | null;
}

export interface Stroke {
  /** Points [x, y] of the stroke [m], from tail to tip. */
  points: [number, number][];
  /** Stroke width at each point, in pixels of a 512-pixel raster. In 3D it gives the depth: 2 stands for the back wall, 20 for the front wall. */
  widths?: number[] | null;
  /** Time at which each point was drawn [s]; times must not decrease. Drawing tools record them; the constant force does not depend on them. */
  times?: number[] | null;
  /** Kind of sketch that the stroke stands for. If absent, a stroke that goes round is an ellipse, any other an arrow. */
  kind?: "arrow" | "ellipse" | null;
}

export interface TrajectoryBody {
  /** The sketch as interpreted: an "arrow" with `points` [m], an "ellipse" with `center` [m], semi-`axes` [m] and `angle` [rad], a "shape" with `outlines` [m], or a "solid" with `vertices` [m] and `triangles`. In 3D `widths` or `width` [pixels] give the depth of the others. */
  sketch: Record<string, unknown>;
  /** Name of the method that planned. */
  method: string;
  /** Reason of this method. */
  reason: string;
  /** Number of frames in which the goal is to be reached. */
  frames: number;
  /** Number of frames for which the goal is kept after that. */
  hold: number;
  /** Frame of the session at which the sketch begins to steer. */
  first_frame: number;
  /** Time of the planning [ms]. */
  planning_ms: number;
  needs: NeedsBody;
  goal: GoalBody;
  /** Several goals in turn, of which the fields above describe the present one, and `frames` and `hold` the last; null for one sketch. */
  keyframes?: LegBody[] | null;
  reached: ReachedBody;
  /** Acceleration that steers, besides gravity, as the mean over the mass of the particles; [frame][axis], T rows [m/s^2]. */
  mean_force: number[][];
  /** Target displacement of the centre of mass [m]. */
  target_displacement: number[];
  /** Displacement of the centre of mass by the motion [m]. */
  displacement: number[];
  /** Centre of mass at the start and after each frame; [frame][axis], T + 1 rows [m]. */
  centroids: number[][];
  /** Frame of each row of `positions`, counted from `first_frame`; chosen by `stride`. */
  frame_indices: number[];
  /** Positions in these frames of the particles that were there at the start; [row][particle][axis] [m]. Null where a particle has left the scene. */
  positions: (((number | null)[])[])[];
  /** Acceleration that steers, besides gravity [m/s^2]: [axis] where it is one constant, else [row][particle][axis], where row i is that of the frame which begins with row i of `positions`. */
  force: number[] | number[][][];
}

export interface Versions {
  /** Version of the library. */
  hybridmpm: string;
  /** Version of the solver. */
  solver: number;
  /** SHA-256 of the network's file; null without a network. */
  model: string | null;
}
