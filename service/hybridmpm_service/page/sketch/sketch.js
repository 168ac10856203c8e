// Geometry of strokes. Pure functions on lists of [x, y] in world units (metres).

const MAX_POINTS = 96; // enough for any freehand curve, far below the server's limit

/** Stroke widths that mean the back wall and the front of a 3D box [pixels of a 512-pixel raster]. */
export const WIDTH_RANGE = [2, 20];

export const distance = (a, b) => Math.hypot(b[0] - a[0], b[1] - a[1]);

/** Length of the line through the points. */
export function pathLength(points) {
  let total = 0;
  for (let i = 1; i < points.length; i += 1) total += distance(points[i - 1], points[i]);
  return total;
}

/** The same line with `count` points at equal distances; both ends stay where they are. */
export function resample(points, count) {
  const step = pathLength(points) / (count - 1);
  const result = [points[0]];
  let walked = 0;
  for (let i = 1; i < points.length; i += 1) {
    const [a, b] = [points[i - 1], points[i]];
    const piece = distance(a, b);
    while (result.length < count - 1 && walked + piece >= step * result.length) {
      const t = piece > 0 ? (step * result.length - walked) / piece : 0;
      result.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
    }
    walked += piece;
  }
  while (result.length < count) result.push(points.at(-1));
  return result;
}

/** Centre and second moments of the area within a closed polygon (Green's theorem); null without an area. */
function moments(points) {
  // Taken about the first point: the formulas cancel badly far from the origin.
  const [ox, oy] = points[0];
  let [area, mx, my, xx, yy, xy] = [0, 0, 0, 0, 0, 0];
  points.forEach(([px, py], i) => {
    const [qx, qy] = points[(i + 1) % points.length];
    const [ax, ay, bx, by] = [px - ox, py - oy, qx - ox, qy - oy];
    const cross = ax * by - bx * ay;
    area += cross / 2;
    mx += ((ax + bx) * cross) / 6;
    my += ((ay + by) * cross) / 6;
    xx += ((ax * ax + ax * bx + bx * bx) * cross) / 12;
    yy += ((ay * ay + ay * by + by * by) * cross) / 12;
    xy += ((2 * ax * ay + ax * by + bx * ay + 2 * bx * by) * cross) / 24;
  });
  if (area === 0) return null;
  const [cx, cy] = [mx / area, my / area];
  return {
    center: [ox + cx, oy + cy],
    xx: xx / area - cx * cx,
    yy: yy / area - cy * cy,
    xy: xy / area - cx * cy,
  };
}

// The rule for free strokes is that of the library, hybridmpm.control.classify_stroke.
const EVEN = 256; // evenly spaced points by which a stroke is judged, so that a pen that rests has no weight
const ROUND = (310 * Math.PI) / 180; // least angle by which an oval turns around its middle
const SLENDER = 0.1; // least width of an oval over its length, in standard deviations
const STRAYING = 1.8; // largest distance of an oval's line from its middle, over the mean distance

/**
 * A stroke seen from its middle, in the frame in which it spreads equally in all directions: its evenly spaced
 * points, their distances, and the angle by which the pen has turned up to each. Null for a stroke along a line.
 */
function seenFromMiddle(points) {
  const even = resample(points, EVEN);
  const mean = (values) => values.reduce((sum, value) => sum + value, 0) / EVEN;
  const [cx, cy] = [mean(even.map((point) => point[0])), mean(even.map((point) => point[1]))];
  const about = even.map(([x, y]) => [x - cx, y - cy]);
  const [xx, yy] = [mean(about.map(([x]) => x * x)), mean(about.map(([, y]) => y * y))];
  const xy = mean(about.map(([x, y]) => x * y));
  const spread = Math.hypot((xx - yy) / 2, xy);
  const [long, short] = [(xx + yy) / 2 + spread, (xx + yy) / 2 - spread];
  if (!(short >= SLENDER ** 2 * Math.max(long, 1e-12))) return null;
  const tilt = Math.atan2(2 * xy, xx - yy) / 2;
  const [cos, sin] = [Math.cos(tilt), Math.sin(tilt)];
  const level = about.map(([x, y]) => [
    (x * cos + y * sin) / Math.sqrt(long),
    (y * cos - x * sin) / Math.sqrt(short),
  ]);
  const turned = [0];
  for (let i = 1; i < EVEN; i += 1) {
    const [[ax, ay], [bx, by]] = [level[i - 1], level[i]];
    turned.push(turned[i - 1] + Math.atan2(ax * by - ay * bx, ax * bx + ay * by));
  }
  return { even, radius: level.map(([x, y]) => Math.hypot(x, y)), turned };
}

/**
 * The kind of a freehand stroke: "ellipse" if it goes round, else "arrow".
 *
 * It goes round if the pen turns by at least 310 degrees around the stroke's middle without straying far from
 * it. So a stroke that stops short of its start is an oval, and so is one that overshoots it.
 */
export function classify(points) {
  const seen = points.length < 2 ? null : seenFromMiddle(points);
  if (seen === null) return "arrow";
  const mean = seen.radius.reduce((sum, radius) => sum + radius, 0) / EVEN;
  if (Math.max(...seen.radius) > STRAYING * mean) return "arrow";
  return Math.abs(seen.turned.at(-1)) >= ROUND ? "ellipse" : "arrow";
}

const OVAL = 0.1; // largest mean distance of an oval's line from its ellipse, over the ellipse's size

/** Whether an outline is an oval, which its ellipse stands for, and no other shape. */
export function isOval(points) {
  const ellipse = ellipseOf(points);
  if (ellipse === null) return false;
  const [cos, sin] = [Math.cos(ellipse.angle), Math.sin(ellipse.angle)];
  const away = resample(points, EVEN).map(([x, y]) => {
    const [dx, dy] = [x - ellipse.center[0], y - ellipse.center[1]];
    return Math.abs(Math.hypot((dx * cos + dy * sin) / ellipse.axes[0], (dy * cos - dx * sin) / ellipse.axes[1]) - 1);
  });
  return away.reduce((sum, one) => sum + one, 0) / EVEN <= OVAL;
}

/** The kind of a freehand stroke: what goes round and is no oval is a shape. */
export function kindOf(points) {
  const kind = classify(points);
  return kind === "ellipse" && !isOval(points) ? "shape" : kind;
}

/** The first time round of a stroke; what overshoots its start would count twice. */
function firstRound(points) {
  const seen = points.length < 2 ? null : seenFromMiddle(points);
  const end = seen === null ? -1 : seen.turned.findIndex((angle) => Math.abs(angle) >= 2 * Math.PI);
  return end < 0 ? points : seen.even.slice(0, end + 1);
}

/** The ellipse with the area moments of an outline; null for an outline without area. */
export function ellipseOf(points) {
  const shape = moments(firstRound(points));
  if (shape === null) return null;
  const mean = (shape.xx + shape.yy) / 2;
  const spread = Math.hypot((shape.xx - shape.yy) / 2, shape.xy);
  return {
    center: shape.center,
    // A filled ellipse has variance a^2 / 4 along its half axis a.
    axes: [2 * Math.sqrt(mean + spread), 2 * Math.sqrt(Math.max(mean - spread, 0))],
    angle: Math.atan2(2 * shape.xy, shape.xx - shape.yy) / 2,
  };
}

/** The outline that a drag with the oval tool means: the one traced, if it goes round, else that in its box. */
export function ovalFrom(points) {
  return classify(points) === "ellipse" ? points : ovalBetween(points[0], points.at(-1));
}

/** Outline of the oval in the rectangle with opposite corners a and b; its last point repeats the first. */
export function ovalBetween(a, b, count = 49) {
  const [cx, cy] = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
  const [rx, ry] = [Math.abs(b[0] - a[0]) / 2, Math.abs(b[1] - a[1]) / 2];
  return Array.from({ length: count }, (_, i) => {
    const angle = (2 * Math.PI * i) / (count - 1);
    return [cx + rx * Math.cos(angle), cy + ry * Math.sin(angle)];
  });
}

/** Left barb, tip and right barb of an arrow's head; `size` is the length of the head. */
export function arrowHead(points, size) {
  const tip = points.at(-1);
  // The direction over one head length, not the last segment: hands tremble at the end of a stroke.
  let back = points[0];
  for (let i = points.length - 2; i >= 0; i -= 1) {
    back = points[i];
    if (distance(back, tip) >= size) break;
  }
  const angle = Math.atan2(tip[1] - back[1], tip[0] - back[0]);
  const barb = (turn) => [tip[0] - size * Math.cos(angle + turn), tip[1] - size * Math.sin(angle + turn)];
  return [barb(0.45), tip, barb(-0.45)];
}

/** Whether a stroke is large enough to be a sketch; a click is not. */
export function isDrawable({ kind, points }) {
  if (points.length < 2) return false;
  if (kind === "arrow") return distance(points[0], points.at(-1)) >= 0.02;
  const shape = ellipseOf(points);
  return shape !== null && shape.axes[1] >= 0.015;
}

const STRAIGHT = 0.06; // largest distance of an arrow's line from its chord that is a hand's trembling, over the chord
const BENDS = 24; // points of an arrow that bends

/** The line that an arrow means: straight where the hand wanted it so, else evenly along the stroke, which keeps its bends. */
export function arrowAlong(points) {
  const [first, last] = [points[0], points.at(-1)];
  const chord = distance(first, last);
  const aside = ([x, y]) => Math.abs((last[0] - first[0]) * (y - first[1]) - (last[1] - first[1]) * (x - first[0])) / Math.max(chord, 1e-9);
  const isStraight = points.every((point) => aside(point) <= STRAIGHT * chord) && pathLength(points) < 1.2 * chord;
  if (points.length < 3 || isStraight) return [first, last];
  // The mean of neighbours takes out the steps of a mouse.
  const even = resample(points, BENDS);
  return even.map((point, i) => (i === 0 || i === BENDS - 1 ? point : [0, 1].map((axis) => (even[i - 1][axis] + point[axis] + even[i + 1][axis]) / 3)));
}

/** The same line with another start; its end stays, and what lies between moves by as much less as it is nearer to the end. */
export function startingAt(start, points) {
  const length = Math.max(pathLength(points), 1e-9);
  return points.map((point, i) => {
    const rest = 1 - pathLength(points.slice(0, i + 1)) / length;
    return point.map((value, axis) => value + rest * (start[axis] - points[0][axis]));
  });
}

/** Depth that a stroke width means, from 0 at the back wall to 1 at the front. */
export const depthOfWidth = (width) => (width - WIDTH_RANGE[0]) / (WIDTH_RANGE[1] - WIDTH_RANGE[0]);

/** The stroke width that means a depth. */
export const widthOfDepth = (depth) => WIDTH_RANGE[0] + Math.min(1, Math.max(0, depth)) * (WIDTH_RANGE[1] - WIDTH_RANGE[0]);

/** Stroke width at each point: from `start` to `end` for an arrow, `end` alone for an oval. */
export function widthsAlong({ kind, points }, [start, end]) {
  if (kind !== "arrow") return points.map(() => end);
  return points.map((_, i) => start + ((end - start) * i) / Math.max(points.length - 1, 1));
}

/** A sketch as the service takes it. `widths` are [start, end] in 3D, null in 2D. */
export function strokeOf(sketch, widths) {
  const points = sketch.points.length > MAX_POINTS ? resample(sketch.points, MAX_POINTS) : sketch.points;
  if (sketch.kind === "shape") return { kind: "shape", outlines: sketch.outlines ?? [points], ...(widths === null ? {} : { width: widths[1] }) };
  const stroke = { kind: sketch.kind, points };
  if (widths !== null) stroke.widths = widthsAlong({ kind: sketch.kind, points }, widths);
  return stroke;
}
