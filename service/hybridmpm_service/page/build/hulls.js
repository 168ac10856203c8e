// Convex hulls of points in the plane and in space.

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** Corners of the convex hull of some points in the plane, anticlockwise. */
export function hullOf(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (order) => {
    const chain = [];
    for (const p of order) {
      const bends = ([a, b]) => (b[0] - a[0]) * (p[1] - b[1]) - (b[1] - a[1]) * (p[0] - b[0]) > 0;
      while (chain.length > 1 && !bends(chain.slice(-2))) chain.pop();
      chain.push(p);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

/** Triangles [a, b, c] of the convex hull of some points in space, anticlockwise from outside; none where all lie in a plane. */
export function convexHull(points) {
  const farthest = (measure) => points.reduce((most, p, i) => (measure(p) > measure(points[most]) ? i : most), 0);
  const first = 0;
  const second = farthest((p) => Math.hypot(...minus(p, points[first])));
  const along = minus(points[second], points[first]);
  const third = farthest((p) => Math.hypot(...cross(along, minus(p, points[first]))));
  const normal = cross(along, minus(points[third], points[first]));
  const fourth = farthest((p) => Math.abs(dot(normal, minus(p, points[first]))));
  const size = Math.hypot(...along);
  const height = dot(normal, minus(points[fourth], points[first]));
  if (Math.abs(height) < 1e-9 * size ** 3) return [];
  const base = height > 0 ? [first, third, second] : [first, second, third];
  let faces = [base, ...base.map((a, i) => [base[(i + 1) % 3], a, fourth])].map((corners) => faceOf(points, corners));
  points.forEach((p, i) => {
    const isSeen = ({ normal: n, from }) => dot(n, minus(p, from)) > 1e-9 * size;
    const seen = faces.filter(isSeen);
    if (seen.length === 0) return;
    // The faces that the point sees give way to those from their rim to it.
    const edges = seen.flatMap(({ corners }) => corners.map((a, k) => [a, corners[(k + 1) % 3]]));
    const known = new Set(edges.map(([a, b]) => `${a} ${b}`));
    const rim = edges.filter(([a, b]) => !known.has(`${b} ${a}`));
    faces = [...faces.filter((face) => !seen.includes(face)), ...rim.map(([a, b]) => faceOf(points, [a, b, i]))];
  });
  return faces.map(({ corners }) => corners);
}

function faceOf(points, corners) {
  const [a, b, c] = corners.map((i) => points[i]);
  const normal = cross(minus(b, a), minus(c, a));
  const size = Math.hypot(...normal) || 1;
  return { corners, from: a, normal: normal.map((x) => x / size) };
}
