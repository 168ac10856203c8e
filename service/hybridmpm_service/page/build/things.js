// The things of a flat scene that a hand can place: bodies, rigid ones, obstacles, emitters and sinks, as the records of a scene file.

import { handlesOfRigid, outlineOf, resizedRigid, RIGID_KINDS } from "./rigid.js";

const SMALLEST = 0.02; // m
const THICKNESS = 0.03; // of a ramp [m]
const SPEED = 1; // of what an emitter brings [m/s]
const PARTS = ["bodies", "rigid", "obstacles", "emitters", "sinks"];
/** Titles of the materials that a scene may name. */
export const MATERIALS = { water: "Water", sand: "Sand", elastic: "Jelly", honey: "Honey", oil: "Oil", mud: "Mud", lava: "Lava" };

/** What can be added, by name. `make` takes two corners of the room that it has. */
export const KINDS = {
  water: { title: "Water", part: "bodies", make: (a, b) => ({ shape: "box", material: "water", ...box(a, b) }) },
  sand: { title: "Sand", part: "bodies", make: (a, b) => ({ shape: "box", material: "sand", ...box(a, b) }) },
  elastic: { title: "Jelly", part: "bodies", make: (a, b) => ({ shape: "box", material: "elastic", ...box(a, b) }) },
  liquid: { title: "Honey", part: "bodies", make: (a, b) => ({ shape: "box", material: "honey", ...box(a, b) }) },
  crate: { title: "Rigid box", part: "rigid", make: (a, b) => RIGID_KINDS.box(box(a, b)) },
  ball: { title: "Rigid ball", part: "rigid", make: (a, b) => RIGID_KINDS.ball(box(a, b)) },
  wedge: { title: "Rigid polygon", part: "rigid", make: (a, b) => RIGID_KINDS.polygon(box(a, b)) },
  block: { title: "Block", part: "obstacles", make: (a, b) => ({ shape: "box", ...box(a, b) }) },
  ramp: {
    title: "Ramp",
    part: "obstacles",
    make: (a, b) => ({ shape: "segment", start: point(a), end: apart(a, b), thickness: THICKNESS }),
  },
  emitter: { title: "Emitter", part: "emitters", make: emitterBetween },
  sink: { title: "Sink", part: "sinks", make: (a, b) => ({ shape: "box", ...box(a, b) }) },
};

/** The four ways an emitter may point, by name. */
export const DIRECTIONS = { right: [1, 0], left: [-1, 0], up: [0, 1], down: [0, -1] };

const round = (x) => Math.round(x * 1000) / 1000;
const point = (p) => p.map(round);
const inBox = (x) => Math.min(1, Math.max(0, x));

function box(a, b) {
  const lower = [0, 1].map((k) => inBox(Math.min(a[k], b[k])));
  const upper = [0, 1].map((k) => inBox(Math.max(a[k], b[k], lower[k] + SMALLEST)));
  return { lower: point(lower), upper: point(upper) };
}

/** `b`, or a point beside `a` if both are one: a ramp has a length. */
const apart = (a, b) => point(Math.hypot(b[0] - a[0], b[1] - a[1]) < SMALLEST ? [a[0] + SMALLEST, a[1]] : b);

function emitterBetween(a, b) {
  // The opening is the longer side of the room.
  const upright = Math.abs(b[1] - a[1]) >= Math.abs(b[0] - a[0]);
  const { lower, upper } = box(a, b);
  return opening(lower, upper, upright ? DIRECTIONS.right : DIRECTIONS.down, SPEED);
}

/** A rectangular emitter in the middle of a box, across a direction. */
function opening(lower, upper, direction, speed) {
  const along = direction[0] === 0 ? 1 : 0;
  const middle = (lower[along] + upper[along]) / 2;
  const [low, high] = [[...lower], [...upper]];
  low[along] = high[along] = middle;
  return { shape: "rectangle", material: "water", lower: point(low), upper: point(high), velocity: direction.map((d) => d * speed) };
}

/** Make a thing of a kind in the room between two corners: {part, record}. */
export const made = (kind, a, b) => ({ part: KINDS[kind].part, record: KINDS[kind].make(a, b) });

/** The things of a scene, in the order of the scene file. */
export const thingsOf = (scene) => PARTS.flatMap((part) => (scene[part] ?? []).map((record) => ({ part, record })));

/** A scene with other things in it. */
export function sceneOf(base, things) {
  const scene = structuredClone(base);
  for (const part of PARTS) scene[part] = things.filter((thing) => thing.part === part).map(({ record }) => record);
  return scene;
}

const FIELD = /(bodies|rigid|obstacles|emitters|sinks)[[.](\d+)\]?/;

/** The thing that a part and its number, as in "bodies[1]", name; undefined where there is none. */
const numbered = (things, part, number) => things.filter((thing) => thing.part === part)[Number(number)];

/** The index of the first thing that a text, such as "bodies[1].lower", names; else -1. */
export function indexIn(text, things) {
  const found = text.match(FIELD);
  return found === null ? -1 : things.indexOf(numbered(things, found[1], found[2]));
}

/** A text with the names of the things in the place of "bodies[1]". */
export function inWords(text, things) {
  return text.replaceAll(new RegExp(FIELD, "g"), (field, part, number) => {
    const thing = numbered(things, part, number);
    return thing === undefined ? field : `“${nameOf(thing, things)}”`;
  });
}

/** The name of a record's material, "liquid" where its constants are given. */
export const materialOf = ({ material }) => (typeof material === "string" ? material : material?.kind);

const SOLE = ["water", "sand", "elastic"]; // what has a look of its own

/** What a thing looks like: its material, or "rigid", "obstacles" or "sinks". */
export function lookOf({ part, record }) {
  if (["rigid", "obstacles", "sinks"].includes(part)) return part;
  return SOLE.includes(materialOf(record)) ? materialOf(record) : "liquid";
}

export function titleOf({ part, record }) {
  if (part === "obstacles") return record.shape === "segment" ? "Ramp" : "Obstacle";
  if (part === "sinks") return "Sink";
  if (part === "rigid") return `Rigid ${record.shape === "hull" ? "polygon" : record.shape}`;
  const material = MATERIALS[materialOf(record)] ?? "Liquid";
  return part === "emitters" ? `Emitter of ${material.toLowerCase()}` : material;
}

/** The title of a thing, with its number where several have it. */
export function nameOf(thing, things) {
  const alike = things.filter((one) => titleOf(one) === titleOf(thing));
  return alike.length > 1 ? `${titleOf(thing)} ${alike.indexOf(thing) + 1}` : titleOf(thing);
}

/** A square of a side [m] between the walls that no thing reaches, nearest to the middle; the middle where there is none. */
export function freeRoom({ lower, upper }, things, side) {
  const [x, y] = [0, 1].map((k) => (lower[k] + upper[k]) / 2);
  const steps = [-4, -3, -2, -1, 0, 1, 2, 3, 4].map((step) => (step / 4) * ((upper[0] - lower[0]) / 2 - side * 0.6));
  const squares = steps.flatMap((dx) => steps.map((dy) => [dx, dy])).sort((a, b) => Math.hypot(...a) - Math.hypot(...b));
  const corners = ([dx, dy]) => [-1, 1].map((end) => [x + dx + (end * side) / 2, y + dy + (end * side) / 2]);
  const taken = things.map(boundsOf).filter((bounds) => bounds !== null);
  const meets = ([a, b]) => taken.some(([c, d]) => [0, 1].every((k) => a[k] < d[k] + 0.01 && c[k] < b[k] + 0.01));
  return corners(squares.find((square) => !meets(corners(square)) && inside(corners(square), lower, upper)) ?? [0, 0]);
}

const inside = ([a, b], lower, upper) => [0, 1].every((k) => a[k] > lower[k] && b[k] < upper[k]);

/** Corners of the box around a thing [m]; null for one without an end. */
export function boundsOf({ record }) {
  if (record.rotation) return boundsAround(record.radius === undefined ? outlineOf(record) : [record.center], record.radius);
  if (record.lower !== undefined) return [record.lower, record.upper];
  if (record.center !== undefined) {
    const reach = record.radius ?? 0;
    return [record.center.map((x) => x - reach), record.center.map((x) => x + reach)];
  }
  const points = record.start !== undefined ? [record.start, record.end] : record.points ?? record.vertices;
  return points === undefined ? null : boundsAround(points);
}

const boundsAround = (points, reach = 0) =>
  [-1, 1].map((end) => [0, 1].map((k) => Math[end < 0 ? "min" : "max"](...points.map((p) => p[k])) + end * reach));

const POINTS = ["lower", "upper", "center", "start", "end", "point"];

/** The same thing elsewhere, by as much as leaves it in the unit square. */
export function moved(thing, by) {
  const bounds = boundsOf(thing);
  const step = bounds === null ? by : by.map((d, k) => Math.min(1 - bounds[1][k], Math.max(-bounds[0][k], d)));
  const shift = (p) => point([p[0] + step[0], p[1] + step[1]]);
  const record = { ...thing.record };
  for (const name of POINTS) if (record[name] !== undefined) record[name] = shift(record[name]);
  for (const name of ["points", "vertices"]) if (record[name] !== undefined) record[name] = record[name].map(shift);
  // What turns about a point takes it along.
  if (record.motion?.center !== undefined) record.motion = { ...record.motion, center: shift(record.motion.center) };
  return { ...thing, record };
}

/** Where a thing can be taken to resize it: {name: point}. */
export function handlesOf({ part, record }) {
  if (part === "rigid") return handlesOfRigid(record);
  if (record.start !== undefined) return { start: record.start, end: record.end };
  if (record.center !== undefined && record.radius !== undefined) return { rim: [record.center[0] + record.radius, record.center[1]] };
  if (record.lower === undefined) return {};
  if (part === "emitters") return { lower: record.lower, upper: record.upper };
  const [[left, bottom], [right, top]] = [record.lower, record.upper];
  return { lower: [left, bottom], upper: [right, top], topLeft: [left, top], bottomRight: [right, bottom] };
}

/** The same thing with a handle elsewhere. */
export function resized(thing, handle, to) {
  const { part, record } = thing;
  const at = to.map(inBox);
  if (part === "rigid") return { ...thing, record: resizedRigid(record, handle, at) };
  const become = (fields) => ({ ...thing, record: { ...record, ...fields } });
  if (handle === "start") return become({ start: apart(record.end, at) });
  if (handle === "end") return become({ end: apart(record.start, at) });
  if (handle === "rim") return become({ radius: round(Math.max(SMALLEST / 2, Math.hypot(at[0] - record.center[0], at[1] - record.center[1]))) });
  if (part === "emitters") {
    const across = record.velocity[0] === 0 ? 0 : 1;
    const corners = { lower: [...record.lower], upper: [...record.upper] };
    corners[handle][across] = at[across];
    if (corners.upper[across] < corners.lower[across] + SMALLEST) return thing;
    return become({ lower: point(corners.lower), upper: point(corners.upper) });
  }
  const still = { lower: record.upper, upper: record.lower, topLeft: [record.upper[0], record.lower[1]], bottomRight: [record.lower[0], record.upper[1]] };
  return become(box(still[handle], at));
}

/** The same polygon with another height about its middle [m]. */
export function scaled(thing, height) {
  const [lower, upper] = boundsOf(thing);
  const factor = height / (upper[1] - lower[1]);
  const vertices = thing.record.vertices.map((p) => p.map((x, k) => inBox((lower[k] + upper[k]) / 2 + factor * (x - (lower[k] + upper[k]) / 2))));
  return { ...thing, record: { ...thing.record, vertices } };
}

/** The same thing as a solid, by this name, or as a body of a material. */
export function become({ record }, matter) {
  const { material, velocity, contact, friction, motion, ...shape } = record;
  return matter === "solid" ? { part: "obstacles", record: shape } : { part: "bodies", record: { ...shape, material: matter } };
}

/** The handle that the keyboard moves. */
export const lastHandle = (thing) => ["end", "rim", "upper", "turn"].find((name) => name in handlesOf(thing));

/** A box as a ball in its place, and a ball as a box; null where only one of both exists. */
export function otherShape(thing) {
  const { part, record } = thing;
  if (part === "emitters" || !["box", "ball"].includes(record.shape)) return null;
  const { lower, upper, center, radius, shape, ...rest } = record;
  if (shape === "ball") return { ...thing, record: { ...rest, shape: "box", ...box(center.map((x) => x - radius), center.map((x) => x + radius)) } };
  const reach = Math.min(upper[0] - lower[0], upper[1] - lower[1]) / 2;
  return { ...thing, record: { ...rest, shape: "ball", center: point([(lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2]), radius: round(reach) } };
}

/** The same emitter with its opening turned and its speed changed. */
export function turned(thing, direction, speed) {
  const { lower, upper, velocity } = thing.record;
  const length = Math.max(upper[0] - lower[0], upper[1] - lower[1]) / 2;
  const middle = [(lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2];
  const reach = DIRECTIONS[direction][0] === 0 ? [length, 0] : [0, length];
  const corners = [-1, 1].map((side) => middle.map((x, k) => inBox(x + side * reach[k])));
  const next = opening(...corners, DIRECTIONS[direction], speed ?? Math.hypot(...velocity));
  return { ...thing, record: { ...thing.record, ...next, material: thing.record.material } };
}

/** The name of the direction that an emitter points in; null for a slanted one. */
export function directionOf({ record }) {
  const entry = Object.entries(DIRECTIONS).find(([, [x, y]]) => Math.sign(record.velocity[0]) === x && Math.sign(record.velocity[1]) === y);
  return entry === undefined || record.shape !== "rectangle" ? null : entry[0];
}
