// Rigid bodies in space without a graphics card: triangles filled into a picture with depths, lit as by WebGL.

import { BODY, BODY_EDGE, BODY_MARK, CORNER_NUMBERS, placeOf, turnedBack } from "../../modules/bodies.js";

const LIGHT = [-0.37, 0.78, 0.51];
const EDGE = 1.2; // largest width of an edge within each face [pixels]
const EDGE_SHARE = 0.06; // the same over the size of the face
const LEVELS = 64; // brightnesses

const packed = (rgb, light) => rgb.reduceRight((word, channel) => word * 256 + Math.min(255, Math.round(channel * light)), 255) >>> 0;
const rampOf = (rgb) => Uint32Array.from({ length: LEVELS }, (_, level) => packed(rgb, 0.45 + (0.6 * level) / (LEVELS - 1)));
const RAMPS = [rampOf(BODY), rampOf(BODY_MARK)];
const EDGE_WORD = packed(BODY_EDGE, 1);

// Of the three corners of a triangle: place on the picture, depth, light, and place in the body's own frame.
const [X, Y, Z, L] = [0, 0, 0, 0].map(() => new Float64Array(3));
const OWN = new Float64Array(9);

/**
 * Fill the triangles of a body.
 *
 * @param picture {size, pixels, depths} of a square picture
 * @param numbers of the corners, as trianglesOf gives them
 */
export function fillTriangles(view, picture, numbers, pose) {
  // Rows of the own frame to the view: right, up, near.
  const [right, up, near] = view.axes().map((axis) => turnedBack(axis, pose.turn));
  const light = [0, 1, 2].map((k) => LIGHT[0] * right[k] + LIGHT[1] * up[k] + LIGHT[2] * near[k]);
  const along = (row, at) => row[0] * numbers[at] + row[1] * numbers[at + 1] + row[2] * numbers[at + 2];
  const center = placeOf([0, 0, 0], pose).map((value, axis) => value - view.center[axis]);
  const [a, b, c] = view.axes().map((axis) => axis[0] * center[0] + axis[1] * center[1] + axis[2] * center[2]);
  const scale = picture.size / view.width;
  for (let at = 0; at < numbers.length; at += 3 * CORNER_NUMBERS) {
    for (let k = 0; k < 3; k += 1) {
      const corner = at + k * CORNER_NUMBERS;
      Z[k] = c + along(near, corner);
      const wide = view.pixelsPerMetre / (1 - view.perspective * Z[k]);
      X[k] = (view.width / 2 + (a + along(right, corner)) * wide) * scale;
      Y[k] = (view.height / 2 - (b + along(up, corner)) * wide) * scale;
    }
    // Seen from outside, a triangle runs clockwise where y points down.
    const area = (X[1] - X[0]) * (Y[2] - Y[0]) - (Y[1] - Y[0]) * (X[2] - X[0]);
    if (area >= 0) continue;
    for (let k = 0; k < 3; k += 1) {
      const corner = at + k * CORNER_NUMBERS;
      L[k] = Math.max(0, along(light, corner + 3));
      for (let axis = 0; axis < 3; axis += 1) OWN[3 * k + axis] = numbers[corner + axis];
    }
    fillOne(area, picture, [0, 1, 2].map((k) => reachOf(area, k, numbers[at + ((k + 1) % 3) * CORNER_NUMBERS + 6 + k] === 0)));
  }
}

/** Pixels from the side opposite a corner to that corner; a side that is no edge is never near. */
function reachOf(area, k, isEdge) {
  const [from, to] = [(k + 1) % 3, (k + 2) % 3];
  return isEdge ? Math.abs(area) / Math.hypot(X[to] - X[from], Y[to] - Y[from]) : Infinity;
}

function fillOne(area, { size, pixels, depths }, reach) {
  const within = (value) => Math.min(size - 1, Math.max(0, value));
  const [left, right] = [within(Math.floor(Math.min(X[0], X[1], X[2]))), within(Math.ceil(Math.max(X[0], X[1], X[2])))];
  const [top, bottom] = [within(Math.floor(Math.min(Y[0], Y[1], Y[2]))), within(Math.ceil(Math.max(Y[0], Y[1], Y[2])))];
  const least = Math.min(reach[0], reach[1], reach[2]);
  const width = Math.min(EDGE, EDGE_SHARE * least);
  for (let y = top; y <= bottom; y += 1) {
    const py = y + 0.5;
    for (let x = left; x <= right; x += 1) {
      const px = x + 0.5;
      const one = ((X[1] - px) * (Y[2] - py) - (Y[1] - py) * (X[2] - px)) / area;
      const two = ((X[2] - px) * (Y[0] - py) - (Y[2] - py) * (X[0] - px)) / area;
      const three = 1 - one - two;
      if (one < 0 || two < 0 || three < 0) continue;
      const place = y * size + x;
      const depth = one * Z[0] + two * Z[1] + three * Z[2];
      if (depth <= depths[place]) continue;
      depths[place] = depth;
      if (least < Infinity && Math.min(one * reach[0], two * reach[1], three * reach[2]) < width) {
        pixels[place] = EDGE_WORD;
        continue;
      }
      // Octants of the own frame in turn, as isMarked.
      const sides = (one * OWN[0] + two * OWN[3] + three * OWN[6]) * (one * OWN[1] + two * OWN[4] + three * OWN[7]) * (one * OWN[2] + two * OWN[5] + three * OWN[8]);
      const level = Math.min(LEVELS - 1, Math.round((one * L[0] + two * L[1] + three * L[2]) * (LEVELS - 1)));
      pixels[place] = RAMPS[sides < 0 ? 1 : 0][level];
    }
  }
}
