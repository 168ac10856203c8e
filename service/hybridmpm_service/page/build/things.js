// The things of a scene that a hand can place: bodies, rigid ones, obstacles, emitters and sinks, as the records of a scene file.
//
// Points have two or three numbers [m]. A `room` has the sides of the world, a `view` is what picture.js makes.

import { DENSITY, handlesOfRigid, outlineOf, resizedRigid, RIGID_KINDS } from "./rigid.js";
import { packed, unpacked } from "./rows.js";
import { boundsInSpace, cylinderIn, handlesInSpace, hullOfSurface, polyhedronIn, resizedInSpace, scaledInSpace, slopeIn } from "./space.js";

const SMALLEST = 0.02; // m
const THICKNESS = 0.03; // of a ramp [m]
const SPEED = 1; // of what an emitter brings [m/s]
const PARTS = ["bodies", "rigid", "obstacles", "emitters", "sinks"];
/** Titles of the materials that a scene may name. */
export const MATERIALS = { water: "Water", sand: "Sand", elastic: "Jelly", honey: "Honey", oil: "Oil", mud: "Mud", lava: "Lava" };

const matter = (material) => (room) => ({ shape: "box", material, ...room });

/** What can be added, by name: in the plane and in space, or in one of both. `make` takes the room between two corners: {lower, upper}. */
const KINDS = {
  water: { title: "Water", part: "bodies", make: matter("water") },
  sand: { title: "Sand", part: "bodies", make: matter("sand") },
  elastic: { title: "Jelly", part: "bodies", make: matter("elastic") },
  liquid: { title: "Honey", part: "bodies", make: matter("honey") },
  crate: { title: "Rigid box", part: "rigid", make: RIGID_KINDS.box },
  ball: { title: "Rigid ball", part: "rigid", make: RIGID_KINDS.ball },
  wedge: { title: "Rigid polygon", part: "rigid", dim: 2, make: RIGID_KINDS.polygon },
  rod: { title: "Rigid cylinder", part: "rigid", dim: 3, make: ({ lower, upper }) => ({ ...cylinderIn(lower, upper), density: DENSITY }) },
  gem: { title: "Rigid polyhedron", part: "rigid", dim: 3, make: ({ lower, upper }) => ({ ...polyhedronIn(lower, upper), density: DENSITY }) },
  block: { title: "Block", part: "obstacles", make: (room) => ({ shape: "box", ...room }) },
  ramp: { title: "Ramp", part: "obstacles", dim: 2, make: (_, a, b) => ({ shape: "segment", start: point(a), end: apart(a, b), thickness: THICKNESS }) },
  slope: { title: "Slope", part: "obstacles", dim: 3, make: ({ lower, upper }) => slopeIn(lower, upper) },
  emitter: { title: "Emitter", part: "emitters", make: emitterBetween },
  sink: { title: "Sink", part: "sinks", make: (room) => ({ shape: "box", ...room }) },
};

/** What can be added in so many dimensions: {name: {title}}. */
export const kindsOf = (dim) => Object.fromEntries(Object.entries(KINDS).filter(([, kind]) => (kind.dim ?? dim) === dim));

/** The ways an emitter may point, by name. */
const DIRECTIONS = { right: [1, 0, 0], left: [-1, 0, 0], up: [0, 1, 0], down: [0, -1, 0], "to the front": [0, 0, 1], "to the back": [0, 0, -1] };

/** Those of so many dimensions: {name: direction}. */
export const directionsOf = (dim) => Object.fromEntries(Object.entries(DIRECTIONS).filter(([, d]) => dim === 3 || d[2] === 0).map(([name, d]) => [name, d.slice(0, dim)]));

const round = (x) => Math.round(x * 1000) / 1000;
const point = (p) => p.map(round);
const within = (p, room) => p.map((x, k) => Math.min(room[k], Math.max(0, x)));
const middleOf = (a, b) => a.map((x, k) => (x + b[k]) / 2);

/** The room between two corners, at least of a smallest side along each axis. */
function box(a, b, room) {
  const lower = within(a.map((x, k) => Math.min(x, b[k])), room);
  const upper = within(lower.map((x, k) => Math.max(a[k], b[k], x + SMALLEST)), room);
  return { lower: point(lower), upper: point(upper) };
}

/** `b`, or a point beside `a` if both are one: a ramp has a length. */
const apart = (a, b) => point(Math.hypot(...b.map((x, k) => x - a[k])) < SMALLEST ? a.map((x, k) => (k === 0 ? x + SMALLEST : x)) : b);

function emitterBetween({ lower, upper }) {
  // The opening of a flat one is the longer side of the room.
  const [across, up] = upper.map((x, k) => x - lower[k]);
  const { right, down } = directionsOf(lower.length);
  return opening(lower, upper, lower.length === 2 && up >= across ? right : down, SPEED);
}

/** A rectangular emitter in the middle of a box, across a direction. */
function opening(lower, upper, direction, speed) {
  const along = direction.findIndex((d) => d !== 0);
  const [low, high] = [[...lower], [...upper]];
  low[along] = high[along] = (lower[along] + upper[along]) / 2;
  return { shape: "rectangle", material: "water", lower: point(low), upper: point(high), velocity: direction.map((d) => d * speed) };
}

/** Make a thing of a kind in the room between two corners: {part, record}. */
export const made = (kind, a, b, room) => ({ part: KINDS[kind].part, record: KINDS[kind].make(box(a, b, room), a, b) });

/** The things of a scene, in the order of the scene file. The start of an emitter is a time, that of other records a place. */
export const thingsOf = (scene) =>
  PARTS.flatMap((part) =>
    (scene[part] ?? []).map((record) => {
      if (part !== "emitters") return { part, record: unpacked(record) };
      const { start, stop, ...rest } = record;
      return { part, record: { ...rest, times: { start, stop } } };
    }),
  );

/** A scene with other things in it. */
export function sceneOf(base, things) {
  const scene = structuredClone(base);
  for (const part of PARTS) scene[part] = things.filter((thing) => thing.part === part).map(({ record: { times, ...record } }) => ({ ...packed(record), ...times }));
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
  if (part === "rigid") return `Rigid ${record.shape !== "hull" ? record.shape : record.points[0].length === 2 ? "polygon" : "polyhedron"}`;
  const material = MATERIALS[materialOf(record)] ?? "Liquid";
  return part === "emitters" ? `Emitter of ${material.toLowerCase()}` : material;
}

/** The title of a thing, with its number where several have it. */
export function nameOf(thing, things) {
  const alike = things.filter((one) => titleOf(one) === titleOf(thing));
  return alike.length > 1 ? `${titleOf(thing)} ${alike.indexOf(thing) + 1}` : titleOf(thing);
}

/** Corners of a square or cube of a side [m] between the walls that no thing reaches, nearest to the middle; of one there where there is none. */
export function freeRoom({ lower, upper }, things, side) {
  const middle = middleOf(lower, upper);
  const steps = lower.map((low, k) => [-4, -3, -2, -1, 0, 1, 2, 3, 4].map((step) => (step / 4) * ((upper[k] - low) / 2 - side * 0.6)));
  const ways = steps.reduce((found, along) => found.flatMap((way) => along.map((step) => [...way, step])), [[]]);
  ways.sort((a, b) => Math.hypot(...a) - Math.hypot(...b));
  const corners = (way) => [-1, 1].map((end) => middle.map((x, k) => x + way[k] + (end * side) / 2));
  const taken = things.map(boundsOf).filter((bounds) => bounds !== null);
  const meets = ([a, b]) => taken.some(([c, d]) => a.every((x, k) => x < d[k] + 0.01 && c[k] < b[k] + 0.01));
  return corners(ways.find((way) => !meets(corners(way)) && inside(corners(way), lower, upper)) ?? middle.map(() => 0));
}

const inside = ([a, b], lower, upper) => a.every((x, k) => x > lower[k] && b[k] < upper[k]);

/** Corners of the box around a thing [m]; null for one without an end. */
export function boundsOf({ record }) {
  const { rotation, lower, upper, center, radius, start, end } = record;
  if ((lower ?? center ?? start ?? record.points?.[0] ?? record.vertices?.[0] ?? record.point).length === 3) {
    const found = boundsInSpace(record);
    if (found !== undefined) return found;
  } else if (rotation) return boundsAround(radius === undefined ? outlineOf(record) : [center], radius);
  if (lower !== undefined) return [lower, upper];
  if (center !== undefined) return [-1, 1].map((side) => center.map((x) => x + side * (radius ?? 0)));
  const points = start !== undefined ? [start, end] : record.points ?? record.vertices;
  return points === undefined ? null : boundsAround(points);
}

const boundsAround = (points, reach = 0) =>
  [-1, 1].map((end) => [0, 1].map((k) => Math[end < 0 ? "min" : "max"](...points.map((p) => p[k])) + end * reach));

const POINTS = ["lower", "upper", "center", "start", "end", "point"];

/** The same thing elsewhere, by as much as leaves it in the room. */
export function moved(thing, by, room) {
  const bounds = boundsOf(thing);
  const step = bounds === null ? by : by.map((d, k) => Math.min(room[k] - bounds[1][k], Math.max(-bounds[0][k], d)));
  const shift = (p) => point(p.map((x, k) => x + step[k]));
  // The corners of a surface lie closer than places are rounded.
  const exact = (p) => p.map((x, k) => x + step[k]);
  const record = { ...thing.record };
  for (const name of POINTS) if (record[name] !== undefined) record[name] = shift(record[name]);
  for (const name of ["points", "vertices"]) if (record[name] !== undefined) record[name] = record[name].map(by.length === 2 ? shift : exact);
  // What turns about a point takes it along.
  if (record.motion?.center !== undefined) record.motion = { ...record.motion, center: shift(record.motion.center) };
  return { ...thing, record };
}

/** Where a thing can be taken in a view to resize it: {name: point}. */
export function handlesOf(thing, view) {
  const { part, record } = thing;
  const [across, up] = view.axes;
  if (view.dim === 2 && part === "rigid") return handlesOfRigid(record);
  const inSpace = view.dim === 2 ? undefined : handlesInSpace(thing, view);
  if (inSpace !== undefined) return inSpace;
  if (record.start !== undefined) return { start: record.start, end: record.end };
  if (record.center !== undefined && record.radius !== undefined) return { rim: record.center.map((x, k) => (k === across ? x + record.radius : x)) };
  if (record.lower === undefined) return {};
  const corner = (right, top) => middleOf(record.lower, record.upper).map((x, k) => (k === across ? right[k] : k === up ? top[k] : x));
  const { lower, upper } = record;
  const ends = { lower: corner(lower, lower), upper: corner(upper, upper) };
  return part === "emitters" ? ends : { ...ends, topLeft: corner(lower, upper), bottomRight: corner(upper, lower) };
}

/** The same thing with a handle elsewhere in a view. */
export function resized(thing, handle, to, view) {
  const { part, record } = thing;
  const at = within(to, view.room);
  if (view.dim === 2 && part === "rigid") return { ...thing, record: resizedRigid(record, handle, at) };
  if (view.dim === 3 && handlesInSpace(thing, view) !== undefined) {
    // What turns may be led from beyond the walls.
    return { ...thing, record: resizedInSpace(record, handle, handle === "turn" ? to : at, view) };
  }
  const become = (fields) => ({ ...thing, record: { ...record, ...fields } });
  if (handle === "start") return become({ start: apart(record.end, at) });
  if (handle === "end") return become({ end: apart(record.start, at) });
  if (handle === "rim") return become({ radius: round(Math.max(SMALLEST / 2, Math.hypot(...at.map((x, k) => x - record.center[k])))) });
  const corners = { lower: [...record.lower], upper: [...record.upper] };
  if (part === "emitters") {
    for (const k of view.axes.filter((axis) => record.velocity[axis] === 0)) {
      corners[handle][k] = at[k];
      if (corners.upper[k] < corners.lower[k] + SMALLEST) return thing;
    }
    return become({ lower: point(corners.lower), upper: point(corners.upper) });
  }
  const [across, up] = view.axes;
  const isLeft = ["lower", "topLeft"].includes(handle);
  const isLow = ["lower", "bottomRight"].includes(handle);
  const [from, ends] = [[...record.lower], [...record.upper]];
  [from[across], ends[across]] = [isLeft ? record.upper[across] : record.lower[across], at[across]];
  [from[up], ends[up]] = [isLow ? record.upper[up] : record.lower[up], at[up]];
  return become(box(from, ends, view.room));
}

/** A box with another side [m] along an axis, from its lower corner. */
export function sidedBox(thing, axis, side, room) {
  const upper = thing.record.upper.map((x, k) => (k === axis ? Math.min(room[k], thing.record.lower[k] + Math.max(side, SMALLEST)) : x));
  return { ...thing, record: { ...thing.record, upper: point(upper) } };
}

/** The same polygon or surface with another height about its middle [m]. */
export function scaled(thing, height, room) {
  const [lower, upper] = boundsOf(thing);
  const factor = height / (upper[1] - lower[1]);
  if (lower.length === 3) return { ...thing, record: scaledInSpace(thing.record, factor) };
  const vertices = thing.record.vertices.map((p) => within(p.map((x, k) => (lower[k] + upper[k]) / 2 + factor * (x - (lower[k] + upper[k]) / 2)), room));
  return { ...thing, record: { ...thing.record, vertices } };
}

/** The same thing as an obstacle ("solid"), as the rigid body around it ("rigid"), or as a body of a material. */
export function become({ record }, matter) {
  const { material, velocity, contact, friction, motion, ...shape } = record;
  if (matter === "rigid") return { part: "rigid", record: { ...hullOfSurface(shape), density: DENSITY } };
  return matter === "solid" ? { part: "obstacles", record: shape } : { part: "bodies", record: { ...shape, material: matter } };
}

/** The handle that the keyboard moves. */
export const lastHandle = (thing, view) => ["end", "rim", "upper", "scale", "turn"].find((name) => name in handlesOf(thing, view));

/** The shapes that a thing may take: names, or none. */
export function shapesOf({ part, record }) {
  const shapes = ["box", "ball", ...(part !== "sinks" && (record.lower ?? record.center ?? record.start)?.length === 3 ? ["cylinder"] : [])];
  return part === "emitters" || !shapes.includes(record.shape) ? [] : shapes;
}

/** The same thing with another one of these shapes, in its place. */
export function reshaped(thing, name, room) {
  const [lower, upper] = boundsOf(thing);
  const { lower: _, upper: __, center, radius, start, end, shape, rotation, ...rest } = thing.record;
  const reach = Math.min(...upper.map((x, k) => x - lower[k])) / 2;
  const shapes = {
    box: () => ({ shape: "box", ...box(lower, upper, room) }),
    ball: () => ({ shape: "ball", center: point(middleOf(lower, upper)), radius: round(reach) }),
    cylinder: () => cylinderIn(lower, upper),
  };
  return { ...thing, record: { ...rest, ...shapes[name]() } };
}

/** The same emitter with its opening turned and its speed changed. */
export function turned(thing, name, room, speed) {
  const { lower, upper, velocity } = thing.record;
  const direction = directionsOf(lower.length)[name];
  const length = Math.max(...upper.map((x, k) => x - lower[k])) / 2;
  const middle = middleOf(lower, upper);
  const corners = [-1, 1].map((side) => within(middle.map((x, k) => x + (direction[k] === 0 ? side * length : 0)), room));
  const isSame = direction.every((d, k) => Math.sign(velocity[k]) === d);
  const next = opening(...(isSame ? [lower, upper] : corners), direction, speed ?? Math.hypot(...velocity));
  return { ...thing, record: { ...thing.record, ...next, material: thing.record.material } };
}

/** The name of the direction that an emitter points in; null for a slanted one. */
export function directionOf({ record }) {
  const entry = Object.entries(directionsOf(record.velocity.length)).find(([, d]) => d.every((x, k) => Math.sign(record.velocity[k]) === x));
  return entry === undefined || record.shape !== "rectangle" ? null : entry[0];
}
