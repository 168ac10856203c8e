// Things of a draft in space: their surfaces, where they can be taken, and how they turn.

import { CORNER_NUMBERS, placeOf, trianglesOf, turned, turnedBack } from "../modules/bodies.js";
import { convexHull, hullOf } from "./hulls.js";

const SMALLEST = 0.02; // m
const TURN_AWAY = 0.05; // distance of the handle that turns a body from its side [m]
const MOST_HANDLES = 12; // corners of a polyhedron that each have one
const DIRECTIONS = 720; // in which the outline of a surface of many corners is found
const IN_PLANE = 0.3; // share of an arrow that has to be seen, so that one can take its tip
const MOST_CORNERS = 160; // directions in which a surface is asked for the corners of its hull
const THIN = 0.002; // half the thickness of an opening [m]
const STILL = [1, 0, 0, 0];
const OWN = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

const plus = (a, b) => a.map((x, k) => x + b[k]);
const minus = (a, b) => a.map((x, k) => x - b[k]);
const times = (a, factor) => a.map((x) => x * factor);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => times(a, 1 / (Math.hypot(...a) || 1));
const middle = (a, b) => times(plus(a, b), 0.5);
const round = (x) => Math.round(x * 1000) / 1000;
const rounded = (p) => p.map(round);
const fine = (p) => p.map((x) => Math.round(x * 1e5) / 1e5);

/** A value of each record, computed once. */
function kept(compute) {
  const known = new WeakMap();
  return (record) => {
    if (!known.has(record)) known.set(record, compute(record));
    return known.get(record);
  };
}

// ---- turns: unit quaternions with the scalar first ----

/** The turn about a vector by its length [rad]. */
function turnOf(vector) {
  const angle = Math.hypot(...vector);
  return angle === 0 ? STILL : [Math.cos(angle / 2), ...times(vector, Math.sin(angle / 2) / angle)];
}

/** The vector of a turn, of at most half a circle. */
function vectorOf([w, ...axis]) {
  const [size, sign] = [Math.hypot(...axis), w < 0 ? -1 : 1];
  return size < 1e-9 ? [0, 0, 0] : times(axis, (sign * 2 * Math.atan2(size, Math.abs(w))) / size);
}

/** One turn after another one. */
const after = ([w, ...a], [v, ...b]) => [w * v - dot(a, b), ...plus(plus(times(b, w), times(a, v)), cross(a, b))];

/** The turn that lets a cylinder, which stands, point in a direction. */
function turnTo(direction) {
  const [across, cosine] = [cross([0, 1, 0], direction), direction[1]];
  const sine = Math.hypot(...across);
  return sine < 1e-9 ? STILL : turnOf(times(across, Math.atan2(sine, cosine) / sine));
}

// ---- surfaces ----

/** Triangles around the points of a convex body. */
const facesAround = kept(convexHull);

/** Centre of mass of the convex hull of some points. */
const centroidOf = kept((points) => {
  let [volume, sum] = [0, [0, 0, 0]];
  for (const [a, b, c] of facesAround(points).map((face) => face.map((i) => minus(points[i], points[0])))) {
    const part = dot(a, cross(b, c));
    [volume, sum] = [volume + part, plus(sum, times(plus(plus(a, b), c), part))];
  }
  return volume === 0 ? points[0] : plus(points[0], times(sum, 1 / (4 * volume)));
});

const turnOfRecord = ({ rotation }) => (Array.isArray(rotation) ? turnOf(rotation) : STILL);

/** The centre about which a record turns. */
export function centerInSpace({ lower, upper, start, end, center, points, vertices }) {
  if (lower !== undefined) return middle(lower, upper);
  if (start !== undefined) return middle(start, end);
  if (vertices !== undefined) return middle(...boundsOfPoints(vertices));
  return center ?? centroidOf(points);
}

/** A record as a solid of its own frame, and where that is: {solid, pose}; null for a surface of a file, and a half-space. */
function solidOf(record) {
  const { shape, lower, upper, radius, thickness, start, end, velocity, points } = record;
  if (shape === "mesh" || shape === "half_space") return null;
  const pose = { center: centerInSpace(record), turn: turnOfRecord(record) };
  const along = (axis) => ({ ...pose, turn: after(pose.turn, turnTo(unit(axis))) });
  if (lower !== undefined) return { solid: { shape: "box", half: upper.map((x, k) => Math.max((x - lower[k]) / 2, THIN)) }, pose };
  if (start !== undefined) {
    const half = Math.hypot(...minus(end, start)) / 2;
    return { solid: { shape: "cylinder", radius: radius ?? thickness / 2, half }, pose: along(minus(end, start)) };
  }
  if (shape === "round") return { solid: { shape: "cylinder", radius, half: THIN }, pose: along(velocity) };
  if (shape === "ball") return { solid: { shape, radius }, pose };
  const corners = points.map((p) => minus(p, pose.center));
  return { solid: { shape: "hull", corners, triangles: facesAround(points) }, pose };
}

/** Triangles of a record's surface: for each corner its place [m] and the normal outwards. */
export const surfaceOf = kept((record) => {
  if (record.vertices !== undefined) return surfaceOfMesh(record);
  const found = solidOf(record);
  if (found === null) return new Float32Array(0);
  const own = trianglesOf(found.solid);
  const numbers = new Float32Array((own.length / CORNER_NUMBERS) * 6);
  for (let i = 0, at = 0; i < own.length; i += CORNER_NUMBERS, at += 6) {
    numbers.set(placeOf(Array.from(own.subarray(i, i + 3)), found.pose), at);
    numbers.set(turned(Array.from(own.subarray(i + 3, i + 6)), found.pose.turn), at + 3);
  }
  return numbers;
});

function surfaceOfMesh({ vertices, triangles }) {
  const numbers = new Float32Array(triangles.length * 18);
  triangles.forEach(([i, j, k], t) => {
    const [a, b, c] = [vertices[i], vertices[j], vertices[k]];
    const normal = unit(cross(minus(b, a), minus(c, a)));
    [a, b, c].forEach((corner, n) => numbers.set([...corner, ...normal], t * 18 + n * 6));
  });
  return numbers;
}

/** Corners of a surface. */
const cornersOf = kept((record) => {
  if (record.vertices !== undefined) return record.vertices;
  const surface = surfaceOf(record);
  return Array.from({ length: surface.length / 6 }, (_, i) => Array.from(surface.subarray(6 * i, 6 * i + 3)));
});

/** Of very many points [x, y] the farthest ones from their middle in each direction. */
function farthest(points) {
  if (points.length <= DIRECTIONS) return points;
  const [x, y] = points.reduce(([a, b], p) => [a + p[0] / points.length, b + p[1] / points.length], [0, 0]);
  const found = new Map();
  for (const p of points) {
    const direction = Math.round((Math.atan2(p[1] - y, p[0] - x) * DIRECTIONS) / (2 * Math.PI));
    const away = (p[0] - x) ** 2 + (p[1] - y) ** 2;
    if (away >= (found.get(direction)?.away ?? 0)) found.set(direction, { p, away });
  }
  return [...found.values()].map(({ p }) => p);
}

/** The outline of a record in a view: corners [x, y] of the picture. */
export const outlineIn = (record, view) => hullOf(farthest(cornersOf(record).map((corner) => view.to(corner))));

/** Corners of the box around some points. */
const boundsOfPoints = kept((points) => {
  const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
  for (const p of points) {
    for (let k = 0; k < 3; k += 1) {
      low[k] = Math.min(low[k], p[k]);
      high[k] = Math.max(high[k], p[k]);
    }
  }
  return [low, high];
});

/** Corners of the box around a record that is turned, a cylinder or a surface [m]; of others undefined. */
export const boundsInSpace = kept((record) => {
  const { shape, start, end, radius, thickness, center, velocity } = record;
  if (record.rotation?.some((x) => x !== 0) && shape !== "ball") return boundsOfPoints(cornersOf(record));
  if (record.points !== undefined || record.vertices !== undefined) return boundsOfPoints(record.points ?? record.vertices);
  if (start === undefined && shape !== "round") return undefined;
  const ends = start === undefined ? [center, center] : [start, end];
  const direction = unit(start === undefined ? velocity : minus(end, start));
  const reach = direction.map((d) => (radius ?? thickness / 2) * Math.sqrt(Math.max(0, 1 - d * d)));
  return [0, 1].map((end) => [0, 1, 2].map((k) => Math[end === 0 ? "min" : "max"](ends[0][k], ends[1][k]) + (end === 0 ? -1 : 1) * reach[k]));
});

// ---- what can be added ----

/** A rigid polyhedron in the room between two corners: eight sides, six corners. */
export function polyhedronIn(lower, upper) {
  const [center, half] = [middle(lower, upper), times(minus(upper, lower), 0.5)];
  return { shape: "hull", points: OWN.flatMap((axis) => [1, -1].map((side) => rounded(plus(center, axis.map((a, k) => side * a * half[k]))))) };
}

/** A cylinder that stands in the room between two corners. */
export function cylinderIn(lower, upper) {
  const [x, , z] = middle(lower, upper);
  const radius = Math.max(SMALLEST / 2, Math.min(upper[0] - lower[0], upper[2] - lower[2]) / 2);
  return { shape: "cylinder", start: rounded([x, lower[1], z]), end: rounded([x, upper[1], z]), radius: round(radius) };
}

/** A slope in the room between two corners, high at its left: a surface. */
export function slopeIn([left, bottom, back], [right, top, front]) {
  const vertices = [[left, bottom, back], [right, bottom, back], [left, top, back], [left, bottom, front], [right, bottom, front], [left, top, front]];
  const triangles = [[0, 2, 1], [3, 4, 5], [0, 1, 4], [0, 4, 3], [0, 3, 5], [0, 5, 2], [1, 2, 5], [1, 5, 4]];
  return { shape: "mesh", vertices, triangles };
}

/** The convex hull of a surface, with few corners: those which lie farthest out in many directions. */
export function hullOfSurface({ vertices }) {
  const corners = new Set();
  for (let i = 0; i < MOST_CORNERS; i += 1) {
    // Directions of a spiral from pole to pole are evenly spread.
    const [y, angle] = [1 - (2 * i + 1) / MOST_CORNERS, i * Math.PI * (3 - Math.sqrt(5))];
    const direction = [Math.sqrt(1 - y * y) * Math.cos(angle), y, Math.sqrt(1 - y * y) * Math.sin(angle)];
    let [most, found] = [-Infinity, null];
    for (const vertex of vertices) {
      const out = dot(vertex, direction);
      if (out > most) [most, found] = [out, vertex];
    }
    corners.add(found);
  }
  return { shape: "hull", points: [...corners] };
}

// ---- handles ----

/** Directions of a view in the world: to the right, upwards, and towards the eye. */
const rightOf = ({ rows }) => rows[0];
const upOf = ({ rows }) => rows[1];

/** How far a surface reaches from its centre in a direction [m]. */
function reachOf(record, direction) {
  const center = centerInSpace(record);
  return cornersOf(record).reduce((most, p) => Math.max(most, dot(minus(p, center), direction)), -Infinity);
}

/** The arrow of a body whose angle in a view the handle shows: unit vector in its plane; null where it is seen from its tip. */
function arrowIn(record, view) {
  const flat = (v) => [dot(v, rightOf(view)), dot(v, upOf(view))];
  const arrows = record.start !== undefined ? [endsOf(record)].map(([a, b]) => unit(minus(b, a))) : [upOf(view), rightOf(view)].map((v) => turned(v, turnOfRecord(record)));
  const seen = arrows.map(flat).find((v) => Math.hypot(...v) > IN_PLANE);
  if (seen === undefined) return null;
  const size = Math.hypot(...seen);
  return plus(times(rightOf(view), seen[0] / size), times(upOf(view), seen[1] / size));
}

/** Ends of a cylinder as they lie. */
function endsOf(record) {
  const pose = { center: centerInSpace(record), turn: turnOfRecord(record) };
  return [record.start, record.end].map((p) => placeOf(minus(p, pose.center), pose));
}

/** Where a record can be taken in a view: {name: point}; undefined where nothing of it is of its own in space. */
export function handlesInSpace({ part, record }, view) {
  if (["ball", "round", "half_space"].includes(record.shape)) return undefined;
  const center = centerInSpace(record);
  const handles = {};
  if (record.start !== undefined) {
    const ends = endsOf(record);
    const along = unit(minus(ends[1], ends[0]));
    const isSeen = Math.hypot(dot(along, rightOf(view)), dot(along, upOf(view))) > IN_PLANE;
    if (isSeen) [handles.start, handles.end] = ends;
    // Across what is seen of it; of one that is seen from its tip, to the right.
    const across = isSeen ? unit(cross(along, view.rows[2])) : rightOf(view);
    if (record.radius !== undefined) handles.rim = plus(center, times(across, record.radius));
  } else if (record.points !== undefined) {
    const pose = { center, turn: turnOfRecord(record) };
    if (record.points.length <= MOST_HANDLES) record.points.forEach((p, i) => (handles[`corner${i}`] = placeOf(minus(p, center), pose)));
  } else if (record.vertices !== undefined) {
    const [lower, upper] = boundsInSpace(record);
    handles.scale = center.map((x, k) => (k === view.depth ? x : view.rows[1][k] < 0 ? lower[k] : upper[k]));
  } else if (part === "rigid" && record.rotation?.some((x) => x !== 0)) {
    const half = times(minus(record.upper, record.lower), 0.5);
    OWN.forEach((axis, k) => {
      const direction = turned(axis, turnOfRecord(record));
      if (Math.hypot(dot(direction, rightOf(view)), dot(direction, upOf(view))) < IN_PLANE) return;
      for (const side of [-1, 1]) handles[`side${k}${side < 0 ? "-" : "+"}`] = plus(center, times(direction, side * half[k]));
    });
  } else if (part !== "rigid") return undefined;
  if (part === "rigid" || record.vertices !== undefined) {
    const arrow = record.vertices === undefined ? arrowIn(record, view) : upOf(view);
    if (arrow !== null) handles.turn = plus(center, times(arrow, reachOf(record, arrow) + TURN_AWAY));
  }
  return handles;
}

/** The same record with a handle elsewhere in a view. */
export function resizedInSpace(record, handle, at, view) {
  const center = centerInSpace(record);
  if (handle === "turn") {
    const arrow = record.vertices === undefined ? arrowIn(record, view) : upOf(view);
    const way = minus(at, center);
    const [sine, cosine] = [dot(cross(arrow, way), view.rows[2]), dot(arrow, way)];
    return turnedBy(record, times(view.rows[2], Math.atan2(sine, cosine)));
  }
  if (handle === "scale") {
    const from = minus(handlesInSpace({ record }, view).scale, center);
    const away = (v) => Math.hypot(...v.map((x, k) => (k === view.depth ? 0 : x)));
    return scaledInSpace(record, away(minus(at, center)) / away(from));
  }
  if (handle === "rim") {
    const along = unit(minus(...endsOf(record)));
    const way = minus(at, center);
    return { ...record, radius: round(Math.max(SMALLEST / 2, Math.hypot(...minus(way, times(along, dot(way, along)))))) };
  }
  if (handle === "start" || handle === "end") {
    const [start, end] = endsOf(record);
    const { rotation, ...rest } = record;
    const fixed = handle === "start" ? end : start;
    const moved = Math.hypot(...minus(at, fixed)) < SMALLEST ? plus(fixed, [0, SMALLEST, 0]) : at;
    return { ...rest, start: rounded(handle === "start" ? moved : start), end: rounded(handle === "end" ? moved : end) };
  }
  const pose = { center, turn: turnOfRecord(record) };
  if (handle.startsWith("corner")) {
    const index = Number(handle.slice("corner".length));
    const lie = record.points.map((p, i) => (i === index ? at : placeOf(minus(p, center), pose)));
    if (convexHull(lie).length === 0) return record; // flat
    const next = centroidOf(lie);
    return { ...record, points: lie.map((p) => fine(plus(next, turnedBack(minus(p, next), pose.turn)))) };
  }
  // A side of a box that is turned goes along its own axis; the other one stays.
  const [axis, side] = [Number(handle[4]), handle[5] === "-" ? -1 : 1];
  const direction = turned(OWN[axis], pose.turn);
  const seen = plus(times(rightOf(view), dot(direction, rightOf(view))), times(upOf(view), dot(direction, upOf(view))));
  const half = times(minus(record.upper, record.lower), 0.5);
  const fixed = plus(center, times(direction, -side * half[axis]));
  const length = Math.max(SMALLEST, (side * dot(minus(at, fixed), seen)) / dot(seen, seen));
  half[axis] = length / 2;
  const next = plus(fixed, times(direction, (side * length) / 2));
  return { ...record, lower: rounded(minus(next, half)), upper: rounded(plus(next, half)) };
}

/** The same record turned about its centre by a vector [rad]. */
export function turnedBy(record, vector) {
  const [center, turn] = [centerInSpace(record), turnOf(vector)];
  const about = (p) => plus(center, turned(minus(p, center), turn));
  if (record.vertices !== undefined) return { ...record, vertices: record.vertices.map((p) => fine(about(p))) };
  if (record.start !== undefined) {
    const { rotation, ...rest } = record;
    const [start, end] = endsOf(record).map((p) => fine(about(p)));
    return { ...rest, start, end };
  }
  return { ...record, rotation: vectorOf(after(turn, turnOfRecord(record))).map((x) => Math.round(x * 1e4) / 1e4) };
}

/** The same surface with its size times a factor, about its middle. */
export function scaledInSpace(record, factor) {
  const center = centerInSpace(record);
  const vertices = record.vertices.map((p) => fine(plus(center, times(minus(p, center), factor))));
  return { ...record, vertices };
}

/** The same cylinder with another length about its middle [m], along an axis (0 to 2), or as it lies. */
export function cylinderAlong(record, length, axis) {
  const [start, end] = endsOf(record);
  const direction = axis === undefined ? unit(minus(end, start)) : OWN[axis];
  const center = centerInSpace(record);
  const { rotation, ...rest } = record;
  return { ...rest, start: fine(plus(center, times(direction, -length / 2))), end: fine(plus(center, times(direction, length / 2))) };
}

/** Length of a cylinder [m], and the axis (0 to 2) along which it lies, or -1. */
export function lieOf(record) {
  const [start, end] = endsOf(record);
  const way = minus(end, start);
  const length = Math.hypot(...way);
  return { length, axis: way.findIndex((x) => Math.abs(x) > 0.9999 * length) };
}
