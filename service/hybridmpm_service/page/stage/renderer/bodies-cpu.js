// Rigid bodies in space without a graphics card: triangles filled into a picture with depths, lit as by WebGL.

import { BODY, BODY_EDGE, BODY_MARK, CORNER_NUMBERS, isMarked, placeOf, turned } from "../../modules/bodies.js";

const LIGHT = [-0.37, 0.78, 0.51];
const EDGE = 1.2; // width of an edge within each face [pixels]

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const packed = (rgb, light) => rgb.reduceRight((word, channel) => word * 256 + Math.min(255, Math.round(channel * light)), 255);

/**
 * Fill the triangles of a body.
 *
 * @param picture {size, pixels, depths} of a square picture
 * @param numbers of the corners, as trianglesOf gives them
 */
export function fillTriangles(view, { size, pixels, depths }, numbers, pose) {
  const scale = size / view.width;
  const axes = view.axes();
  const corner = (at) => {
    const own = Array.from(numbers.subarray(at, at + 3));
    const normal = turned(Array.from(numbers.subarray(at + 3, at + 6)), pose.turn);
    const [x, y, depth] = view.project(placeOf(own, pose));
    const facing = axes.map((axis) => dot(axis, normal));
    return { x: x * scale, y: y * scale, depth, own, light: 0.45 + 0.6 * Math.max(0, dot(facing, LIGHT)), heights: numbers.subarray(at + 6, at + 9) };
  };
  for (let at = 0; at < numbers.length; at += 3 * CORNER_NUMBERS) {
    const corners = [0, 1, 2].map((k) => corner(at + k * CORNER_NUMBERS));
    const [a, b, c] = corners;
    // Seen from outside, a triangle runs clockwise where y points down.
    const area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if (area >= 0) continue;
    fillOne(corners, area, { size, pixels, depths });
  }
}

function fillOne(corners, area, { size, pixels, depths }) {
  const [a, b, c] = corners;
  const within = (value) => Math.min(size - 1, Math.max(0, value));
  const [left, right] = [within(Math.floor(Math.min(a.x, b.x, c.x))), within(Math.ceil(Math.max(a.x, b.x, c.x)))];
  const [top, bottom] = [within(Math.floor(Math.min(a.y, b.y, c.y))), within(Math.ceil(Math.max(a.y, b.y, c.y)))];
  // Pixels from the side opposite each corner to that corner; a side that is no edge is never near.
  const reach = [0, 1, 2].map((k) => {
    const [from, to] = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
    const isEdge = corners[(k + 1) % 3].heights[k] === 0;
    return isEdge ? Math.abs(area) / Math.hypot(to.x - from.x, to.y - from.y) : Infinity;
  });
  for (let y = top; y <= bottom; y += 1) {
    for (let x = left; x <= right; x += 1) {
      const [px, py] = [x + 0.5, y + 0.5];
      const one = ((b.x - px) * (c.y - py) - (b.y - py) * (c.x - px)) / area;
      const two = ((c.x - px) * (a.y - py) - (c.y - py) * (a.x - px)) / area;
      const three = 1 - one - two;
      if (one < 0 || two < 0 || three < 0) continue;
      const depth = one * a.depth + two * b.depth + three * c.depth;
      const place = y * size + x;
      if (depth <= depths[place]) continue;
      depths[place] = depth;
      const edge = Math.min(one * reach[0], two * reach[1], three * reach[2]) < EDGE;
      const own = [0, 1, 2].map((k) => one * a.own[k] + two * b.own[k] + three * c.own[k]);
      const light = one * a.light + two * b.light + three * c.light;
      pixels[place] = edge ? packed(BODY_EDGE, 1) : packed(isMarked(own) ? BODY_MARK : BODY, light);
    }
  }
}
