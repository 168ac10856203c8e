// Rigid bodies: their surfaces, their look, and what is under a pointer. Pages that play and the page of the service share it.
//
// A `solid` is what `Rigid.solid` of the library returns: {shape, half, radius, corners, triangles} in the body's own frame.
// A `pose` is {center, turn}: an angle in the plane, in space a unit quaternion with the scalar first.

/** Colours of the body, of the other quarters of its mark, and of its edge, sRGB in 0 .. 255. */
export const BODY = [184, 117, 61];
export const BODY_MARK = [138, 84, 42];
export const BODY_EDGE = [236, 178, 118];
const AROUND = 48; // corners of a circle
const BANDS = 16; // of a ball, from pole to pole
const MARK = 0.42; // radius of the mark, over the distance from the centre to the nearest side

const plus = (a, b) => a.map((value, axis) => value + b[axis]);
const minus = (a, b) => a.map((value, axis) => value - b[axis]);
const times = (a, factor) => a.map((value) => value * factor);
const dot = (a, b) => a.reduce((sum, value, axis) => sum + value * b[axis], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => times(a, 1 / (Math.hypot(...a) || 1));

/** A vector of the body's own frame as it points in the world. */
export function turned(v, turn) {
  if (v.length === 2) {
    const [cosine, sine] = [Math.cos(turn), Math.sin(turn)];
    return [cosine * v[0] - sine * v[1], sine * v[0] + cosine * v[1]];
  }
  const axis = turn.slice(1);
  const across = times(cross(axis, v), 2);
  return plus(plus(v, times(across, turn[0])), cross(axis, across));
}

/** A vector of the world in the body's own frame. */
export function turnedBack(v, turn) {
  return v.length === 2 ? turned(v, -turn) : turned(v, [turn[0], ...times(turn.slice(1), -1)]);
}

/** The place in the world of a point of the body [m]. */
export const placeOf = (point, { center, turn }) => plus(center, turned(point, turn));

/** The pose of a body in a table of such rows: centre, then the angle or the quaternion. */
export function poseAt(table, body, dim) {
  const width = dim === 2 ? 3 : 7;
  const row = Array.from(table.subarray(body * width, (body + 1) * width));
  return { center: row.slice(0, dim), turn: dim === 2 ? row[2] : row.slice(3) };
}

const circle = (radius, count = AROUND) =>
  Array.from({ length: count }, (_, i) => [radius * Math.cos((2 * Math.PI * i) / count), radius * Math.sin((2 * Math.PI * i) / count)]);

/** Corners of a solid in the plane, anticlockwise. */
export function outlineOf({ shape, half, radius, corners }) {
  if (shape === "ball") return circle(radius);
  if (shape === "hull") return corners;
  const [a, b] = half;
  return [
    [-a, -b],
    [a, -b],
    [a, b],
    [-a, b],
  ];
}

// Faces in space: {points, anticlockwise from outside; normals, one for each point or one for all; edges: whether they are drawn}.

function boxFaces([a, b, c]) {
  const faces = [];
  for (let axis = 0; axis < 3; axis += 1) {
    for (const side of [-1, 1]) {
      const [u, w] = [(axis + 1) % 3, (axis + 2) % 3];
      const corner = (p, q) => {
        const point = [0, 0, 0];
        [point[axis], point[u], point[w]] = [side, p, q];
        return [point[0] * a, point[1] * b, point[2] * c];
      };
      const points = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
      faces.push({ points: side > 0 ? points : points.reverse(), edges: [true, true, true, true] });
    }
  }
  return faces;
}

function ballFaces(radius) {
  const at = (band, i) => {
    const [down, around] = [(Math.PI * band) / BANDS, (Math.PI * i) / BANDS];
    return [Math.sin(down) * Math.cos(around), Math.cos(down), -Math.sin(down) * Math.sin(around)];
  };
  const faces = [];
  for (let band = 0; band < BANDS; band += 1) {
    for (let i = 0; i < 2 * BANDS; i += 1) {
      const normals = [at(band, i), at(band + 1, i), at(band + 1, i + 1), at(band, i + 1)];
      faces.push({ points: normals.map((n) => times(n, radius)), normals, edges: [false, false, false, false] });
    }
  }
  return faces;
}

function cylinderFaces(radius, half) {
  const rim = circle(radius).map(([x, z]) => [x, -z]);
  const ends = [1, -1].map((side) => {
    const points = rim.map(([x, z]) => [x, side * half, z]);
    return { points: side > 0 ? points : points.reverse(), edges: points.map(() => true) };
  });
  const sides = rim.map(([x, z], i) => {
    const [nextX, nextZ] = rim[(i + 1) % rim.length];
    const points = [
      [x, -half, z],
      [nextX, -half, nextZ],
      [nextX, half, nextZ],
      [x, half, z],
    ];
    const normals = points.map((point) => [point[0] / radius, 0, point[2] / radius]);
    return { points, normals, edges: [true, false, true, false] };
  });
  return [...ends, ...sides];
}

function hullFaces(corners, triangles) {
  const normalOf = ([a, b, c]) => unit(cross(minus(corners[b], corners[a]), minus(corners[c], corners[a])));
  const normals = triangles.map(normalOf);
  const owner = new Map();
  triangles.forEach((triangle, k) => triangle.forEach((a, i) => owner.set(`${a} ${triangle[(i + 1) % 3]}`, k)));
  // Two triangles of one side have no edge between them.
  const isEdge = (k, a, b) => {
    const other = owner.get(`${b} ${a}`);
    return other === undefined || dot(normals[k], normals[other]) < 0.999;
  };
  return triangles.map((triangle, k) => ({
    points: triangle.map((corner) => corners[corner]),
    edges: triangle.map((a, i) => isEdge(k, a, triangle[(i + 1) % 3])),
  }));
}

function facesOf({ shape, half, radius, corners, triangles }) {
  switch (shape) {
    case "box":
      return boxFaces(half);
    case "ball":
      return ballFaces(radius);
    case "cylinder":
      return cylinderFaces(radius, half);
    default:
      return hullFaces(corners, triangles);
  }
}

/** Numbers of each corner in `trianglesOf`. */
export const CORNER_NUMBERS = 9;

/**
 * The surface of a solid in space as triangles, anticlockwise from outside.
 *
 * Each corner has 3 numbers of its place in the own frame [m], 3 of the normal outwards, and 3 of which one falls to 0 at each
 * side that is an edge; that of another side is 1 throughout.
 */
export function trianglesOf(solid) {
  const numbers = [];
  for (const { points, normals, edges } of facesOf(solid)) {
    const flat = unit(cross(minus(points[1], points[0]), minus(points[2], points[0])));
    for (let k = 1; k + 1 < points.length; k += 1) {
      const corners = [0, k, k + 1];
      // The side opposite each corner: from k to k + 1, from k + 1 to 0, from 0 to k.
      const drawn = [edges[k], k + 2 === points.length && edges[k + 1], k === 1 && edges[0]];
      corners.forEach((corner, i) => {
        const heights = drawn.map((isDrawn, side) => (isDrawn && side !== i ? 0 : 1));
        numbers.push(...points[corner], ...(normals?.[corner] ?? flat), ...heights);
      });
    }
  }
  return new Float32Array(numbers);
}

/** Whether a point of the own frame in space is of the darker quarters: octants in turn show how a body is turned. */
const isMarked = ([x, y, z]) => x * y * z < 0;

/** Draw a body in the plane; `project` takes a point of the world to pixels [x, y], `scale` is in pixels per metre. */
export function drawFlatBody(context, project, scale, solid, pose) {
  const css = (rgb) => `rgb(${rgb.join(" ")})`;
  const [x, y] = project(pose.center);
  context.beginPath();
  if (solid.shape === "ball") context.arc(x, y, solid.radius * scale, 0, 2 * Math.PI);
  else outlineOf(solid).forEach((corner) => context.lineTo(...project(placeOf(corner, pose)).slice(0, 2)));
  context.closePath();
  context.fillStyle = css(BODY);
  context.fill();
  context.strokeStyle = css(BODY_EDGE);
  context.lineWidth = 1.5;
  context.lineJoin = "round";
  context.stroke();
  const radius = MARK * inradiusOf(solid) * scale;
  for (const quarter of [0, 2]) {
    // The y of pixels points down.
    const from = -pose.turn - (quarter * Math.PI) / 2;
    context.beginPath();
    context.moveTo(x, y);
    context.arc(x, y, radius, from, from - Math.PI / 2, true);
    context.closePath();
    context.fillStyle = css(quarter === 0 ? BODY_EDGE : BODY_MARK);
    context.fill();
  }
}

/** Distance of a solid's nearest side in the plane from its centre of mass [m]. */
function inradiusOf(solid) {
  if (solid.shape === "ball") return solid.radius;
  return Math.min(...sidesOf(outlineOf(solid)).map(({ point, normal }) => dot(point, normal)));
}

/** Sides of a convex polygon: a point of each, and the normal outwards. */
function sidesOf(corners) {
  return corners.map((point, i) => {
    const [dx, dy] = minus(corners[(i + 1) % corners.length], point);
    return { point, normal: unit([dy, -dx]) };
  });
}

/** The plane of a face. */
function planeOf(points) {
  // Of a face at a pole two corners are one.
  const far = points.length - 1;
  return { point: points[0], normal: unit(cross(minus(points[1], points[0]), minus(points[far], points[1]))) };
}

/** Planes of a solid's surface in space. */
const planesOf = (solid) => facesOf(solid).map(({ points }) => planeOf(points));

/** Where a ray from a point enters a solid, in lengths of its direction; null where it passes by. All in the own frame. */
function entryOf(solid, from, along) {
  let [first, last] = [-Infinity, Infinity];
  for (const { point, normal } of planesOf(solid)) {
    const [gap, pace] = [dot(minus(from, point), normal), dot(along, normal)];
    if (pace === 0 && gap > 0) return null;
    if (pace < 0) first = Math.max(first, -gap / pace);
    if (pace > 0) last = Math.min(last, -gap / pace);
  }
  return first <= last ? first : null;
}

/**
 * The foremost body under a point (x, y) of the front view: {body, grip: the point in the body's own frame, point: the same in
 * the world}; null where there is none.
 */
export function bodyAt(solids, poses, [x, y]) {
  if (poses[0]?.center.length === 3) return bodyOnRay(solids, poses, [x, y, 0], [0, 0, -1]);
  let found = null;
  poses.forEach(({ center, turn }, body) => {
    const grip = turnedBack(minus([x, y], center), turn);
    if (sidesOf(outlineOf(solids[body])).every(({ point, normal }) => dot(minus(grip, point), normal) <= 0)) {
      found = { body, grip, point: [x, y] };
    }
  });
  return found;
}

/** The first body in space that a line enters, from a point along a direction of the world; as `bodyAt`. */
export function bodyOnRay(solids, poses, start, direction) {
  let [found, first] = [null, Infinity];
  poses.forEach(({ center, turn }, body) => {
    const [from, along] = [turnedBack(minus(start, center), turn), turnedBack(direction, turn)];
    const entry = entryOf(solids[body], from, along);
    if (entry === null || entry >= first) return;
    first = entry;
    found = { body, grip: plus(from, times(along, entry)), point: plus(start, times(direction, entry)) };
  });
  return found;
}

/** Middles of the cells of a grid over a face of four corners, with the normals there. */
function* gridOf([a, b, c, d], [p, q, r, s], side) {
  const [columns, rows] = [[b, a, c, d], [d, a, c, b]].map(([to, from, farTo, farFrom]) =>
    Math.max(1, Math.ceil(Math.max(Math.hypot(...minus(to, from)), Math.hypot(...minus(farTo, farFrom))) / side)),
  );
  const between = (from, to, share) => plus(times(from, 1 - share), times(to, share));
  for (let i = 0; i < columns; i += 1) {
    for (let k = 0; k < rows; k += 1) {
      const [x, y] = [(i + 0.5) / columns, (k + 0.5) / rows];
      yield [between(between(a, b, x), between(d, c, x), y), unit(between(between(p, q, x), between(s, r, x), y))];
    }
  }
}

/** Points of a square grid in a flat face; at least its middle. */
function* latticeOf(points, normal, side) {
  const across = unit(minus(points[1], points[0]));
  const up = cross(normal, across);
  const flat = points.map((p) => [dot(minus(p, points[0]), across), dot(minus(p, points[0]), up)]);
  const lines = sidesOf(flat);
  const counts = [0, 1].map((k) => [Math.min, Math.max].map((end) => Math.round(end(...flat.map((p) => p[k])) / side)));
  let isEmpty = true;
  for (let i = counts[0][0]; i <= counts[0][1]; i += 1) {
    for (let k = counts[1][0]; k <= counts[1][1]; k += 1) {
      const at = [i * side, k * side];
      if (!lines.every((line) => dot(minus(at, line.point), line.normal) <= 0)) continue;
      isEmpty = false;
      yield plus(points[0], plus(times(across, at[0]), times(up, at[1])));
    }
  }
  if (isEmpty) yield times(points.reduce(plus), 1 / points.length);
}

/**
 * Points over the surface of a solid in space, about one for each square of a side, and along its edges.
 *
 * @returns [{point, normal, colour}] in the own frame, coloured as the body, its mark, or its edges
 */
export function pointsOf(solid, side) {
  const found = [];
  const add = (point, normal) => found.push({ point, normal, colour: isMarked(point) ? BODY_MARK : BODY });
  for (const { points, normals, edges } of facesOf(solid)) {
    const { normal } = planeOf(points);
    if (points.length === 4) for (const place of gridOf(points, normals ?? points.map(() => normal), side)) add(...place);
    else for (const point of latticeOf(points, normal, side)) add(point, normal);
    points.forEach((from, k) => {
      const way = minus(points[(k + 1) % points.length], from);
      const count = edges[k] ? Math.ceil(Math.hypot(...way) / side) : 0;
      for (let i = 0; i < count; i += 1) found.push({ point: plus(from, times(way, (i + 0.5) / count)), normal, colour: BODY_EDGE });
    });
  }
  return found;
}
