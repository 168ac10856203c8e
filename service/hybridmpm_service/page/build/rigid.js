// Rigid bodies of a flat draft: boxes, balls and convex polygons, which may be turned about their centre of mass. Boxes and balls may
// lie in space.

import { hullOf } from "./hulls.js";

/** Density of a new rigid body. */
export const DENSITY = 500; // kg/m^3: half of it floats above water
const SMALLEST = 0.02; // m
const TURN_AWAY = 0.05; // distance of the handle that turns a body from its side [m]
const MOST_HANDLES = 12; // corners of a polygon that each have one

const round = (x) => Math.round(x * 1000) / 1000;
const rounded = (p) => p.map(round);
const plus = (a, b) => [a[0] + b[0], a[1] + b[1]];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1]];
const middle = (a, b) => a.map((x, k) => (x + b[k]) / 2);

function turned([x, y], angle) {
  const [cosine, sine] = [Math.cos(angle), Math.sin(angle)];
  return [cosine * x - sine * y, sine * x + cosine * y];
}

/** Centre of mass of the convex hull of some points. */
function centroidOf(points) {
  let [area, x, y] = [0, 0, 0];
  const corners = hullOf(points);
  corners.forEach(([ax, ay], i) => {
    const [bx, by] = corners[(i + 1) % corners.length];
    const part = ax * by - ay * bx;
    [area, x, y] = [area + part, x + part * (ax + bx), y + part * (ay + by)];
  });
  return area === 0 ? points[0] : [x / (3 * area), y / (3 * area)];
}

/** The centre of mass of a record, about which it is turned. */
export function centerOf({ lower, upper, center, points }) {
  if (lower !== undefined) return middle(lower, upper);
  return center ?? centroidOf(points);
}

const boxCorners = ([left, bottom], [right, top]) => ({ lower: [left, bottom], bottomRight: [right, bottom], upper: [right, top], topLeft: [left, top] });

/** Points of a turned record as they lie: corners of a box by name, those of a polygon by number. */
function placesOf(record) {
  const center = centerOf(record);
  const still = record.lower !== undefined ? boxCorners(record.lower, record.upper) : record.points;
  const moved = Object.entries(still).map(([name, p]) => [name, plus(center, turned(minus(p, center), record.rotation ?? 0))]);
  return Object.fromEntries(moved);
}

/** The outline of a box or a polygon as it lies. */
export const outlineOf = (record) => {
  const places = Object.values(placesOf(record));
  return record.points === undefined ? places : hullOf(places);
};

/** Records of a kind in the room between two corners. */
export const RIGID_KINDS = {
  box: ({ lower, upper }) => ({ shape: "box", lower, upper, density: DENSITY }),
  ball: ({ lower, upper }) => {
    const radius = Math.min(...upper.map((x, k) => x - lower[k])) / 2;
    return { shape: "ball", center: rounded(middle(lower, upper)), radius: round(radius), density: DENSITY };
  },
  polygon: ({ lower, upper }) => {
    const [[x, y], [across, up]] = [middle(lower, upper), minus(upper, lower)];
    const corner = (i) => [x + (across / 2) * Math.cos((Math.PI * i) / 3), y + (up / 2) * Math.sin((Math.PI * i) / 3)];
    return { shape: "hull", points: [0, 1, 2, 3, 4, 5].map((i) => rounded(corner(i))), density: DENSITY };
  },
};

/** Where a record can be taken to resize or turn it: {name: point}. */
export function handlesOfRigid(record) {
  const center = centerOf(record);
  if (record.radius !== undefined) return { rim: [center[0] + record.radius, center[1]] };
  const places = placesOf(record);
  const still = record.lower !== undefined ? [record.lower, record.upper] : record.points;
  const top = Math.max(...still.map(([, y]) => y)) - center[1];
  const turn = plus(center, turned([0, top + TURN_AWAY], record.rotation ?? 0));
  const named = record.points === undefined ? places : Object.fromEntries(Object.entries(places).map(([k, p]) => [`corner${k}`, p]));
  return Object.keys(named).length > MOST_HANDLES ? { turn } : { ...named, turn };
}

/** The same record with a handle elsewhere; other corners stay where they are. */
export function resizedRigid(record, handle, at) {
  const [center, rotation] = [centerOf(record), record.rotation ?? 0];
  if (handle === "turn") {
    const [dx, dy] = minus(at, center);
    return { ...record, rotation: round(Math.atan2(-dx, dy)) };
  }
  if (handle === "rim") return { ...record, radius: round(Math.max(SMALLEST / 2, Math.hypot(...minus(at, center)))) };
  const places = placesOf(record);
  if (record.points !== undefined) {
    const lie = { ...places, [handle.slice("corner".length)]: at };
    return { ...record, points: turnedBack(Object.values(lie), rotation) };
  }
  const across = { lower: "upper", upper: "lower", topLeft: "bottomRight", bottomRight: "topLeft" };
  const fixed = places[across[handle]];
  const way = turned(minus(at, fixed), -rotation).map((x) => (Math.abs(x) < SMALLEST ? SMALLEST * (Math.sign(x) || 1) : x));
  const to = plus(fixed, turned(way, rotation));
  const [x, y] = middle(fixed, to);
  const half = way.map((s) => Math.abs(s) / 2);
  return { ...record, lower: rounded([x - half[0], y - half[1]]), upper: rounded([x + half[0], y + half[1]]) };
}

/** Points that lie so once they are turned about their centre of mass. */
function turnedBack(points, rotation) {
  const center = centroidOf(points);
  return points.map((p) => rounded(plus(center, turned(minus(p, center), -rotation))));
}

/** A box with another side [m] along an axis, about its middle. */
export function sized(record, axis, side) {
  const center = centerOf(record);
  const [lower, upper] = [[...record.lower], [...record.upper]];
  [lower[axis], upper[axis]] = [round(center[axis] - side / 2), round(center[axis] + side / 2)];
  return { ...record, lower, upper };
}
