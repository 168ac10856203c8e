// The box and the obstacles of 3D scenes.

import { drawGrid, OBSTACLE_EDGE, traceWorld } from "./lines.js";
import { cornersOf } from "./motion.js";

/** Draw the floor with a grid, and those edges of the box that lie behind the particles. */
export function drawBox(context, view, walls) {
  const { lower, upper } = walls;
  const corners = [
    [lower[0], lower[1], lower[2]],
    [upper[0], lower[1], lower[2]],
    [upper[0], lower[1], upper[2]],
    [lower[0], lower[1], upper[2]],
  ];
  traceWorld(context, view, corners, true);
  context.fillStyle = "#111a27";
  context.fill();
  context.strokeStyle = "rgb(140 170 210 / 0.14)";
  drawGrid(context, view, walls, 0, 2);
  drawGrid(context, view, walls, 2, 0);
  drawEdges(context, view, cornersOf(walls), false);
}

/**
 * Draw those of a box's twelve edges that lie in front of the particles, or those behind.
 *
 * In front are the three that meet in the corner nearest to the viewer.
 */
export function drawEdges(context, view, corners, inFront) {
  const depth = (bits) => view.project(corners[bits])[2];
  const nearest = [0, 1, 2, 3, 4, 5, 6, 7].reduce((best, bits) => (depth(bits) > depth(best) ? bits : best));
  context.strokeStyle = inFront ? "rgb(150 178 212 / 0.28)" : "rgb(150 178 212 / 0.5)";
  context.lineWidth = 1.25;
  for (let bits = 0; bits < 8; bits += 1) {
    for (let axis = 0; axis < 3; axis += 1) {
      const other = bits | (1 << axis);
      if (other === bits || (bits === nearest || other === nearest) !== inFront) continue;
      traceWorld(context, view, [corners[bits], corners[other]]);
      context.stroke();
    }
  }
}

/** Draw an obstacle by its outline. */
export function drawSolidObstacle(context, view, obstacle) {
  context.strokeStyle = OBSTACLE_EDGE;
  context.lineWidth = 1.25;
  if (obstacle.shape === "box") {
    const corners = obstacle.corners ?? cornersOf(obstacle);
    drawEdges(context, view, corners, true);
    drawEdges(context, view, corners, false);
  } else if (obstacle.shape === "ball") {
    drawRings(context, view, obstacle.center, obstacle.radius);
  } else if (obstacle.shape === "cylinder") {
    drawCylinder(context, view, obstacle);
  } else if (obstacle.shape === "segment") {
    traceWorld(context, view, [obstacle.start, obstacle.end]);
    context.lineCap = "round";
    context.lineWidth = Math.max(2, obstacle.thickness * view.pixelsPerMetre);
    context.strokeStyle = "rgb(147 167 192 / 0.55)";
    context.stroke();
  } else if (obstacle.shape === "mesh") {
    drawMesh(context, view, obstacle);
  } else {
    drawPlane(context, view, obstacle);
  }
}

/** Draw the outline of a mesh: the edges at which it turns away from the viewer. */
function drawMesh(context, view, { vertices, triangles }) {
  const places = vertices.map((vertex) => view.project(vertex));
  const turns = ([a, b, c]) =>
    (places[b][0] - places[a][0]) * (places[c][1] - places[a][1]) - (places[b][1] - places[a][1]) * (places[c][0] - places[a][0]) > 0;
  const edges = new Set();
  for (const corners of triangles.filter(turns)) {
    // An edge between two triangles that face the viewer is met both ways round.
    corners.forEach((a, k) => {
      const b = corners[(k + 1) % 3];
      if (!edges.delete(b * vertices.length + a)) edges.add(a * vertices.length + b);
    });
  }
  context.beginPath();
  for (const edge of edges) {
    const [a, b] = [Math.floor(edge / vertices.length), edge % vertices.length];
    context.moveTo(places[a][0], places[a][1]);
    context.lineTo(places[b][0], places[b][1]);
  }
  context.stroke();
}

function drawRings(context, view, center, radius) {
  for (let skip = 0; skip < 3; skip += 1) {
    const [u, w] = [0, 1, 2].filter((axis) => axis !== skip);
    const ring = Array.from({ length: 48 }, (_, i) => {
      const point = [...center];
      point[u] += radius * Math.cos((2 * Math.PI * i) / 48);
      point[w] += radius * Math.sin((2 * Math.PI * i) / 48);
      return point;
    });
    traceWorld(context, view, ring, true);
    context.stroke();
  }
}

/** Two unit vectors that are normal to each other and to a direction. */
function across(direction) {
  const size = Math.hypot(...direction);
  const n = direction.map((value) => value / size);
  const helper = Math.abs(n[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const side = cross(helper, n);
  const u = side.map((value) => value / Math.hypot(...side));
  return [u, cross(n, u)];
}

/** Draw both ends of a cylinder, and four lines along its side. */
function drawCylinder(context, view, { start, end, radius }) {
  const [u, w] = across(end.map((value, axis) => value - start[axis]));
  const at = (center, turn) =>
    center.map((value, axis) => value + radius * (Math.cos(turn) * u[axis] + Math.sin(turn) * w[axis]));
  for (const center of [start, end]) {
    const ring = Array.from({ length: 48 }, (_, i) => at(center, (2 * Math.PI * i) / 48));
    traceWorld(context, view, ring, true);
    context.stroke();
  }
  for (let quarter = 0; quarter < 4; quarter += 1) {
    const turn = (Math.PI * quarter) / 2;
    traceWorld(context, view, [at(start, turn), at(end, turn)]);
    context.stroke();
  }
}

/** Draw a square patch of the plane, around its point. */
function drawPlane(context, view, { point, normal }) {
  const [u, w] = across(normal).map((side) => side.map((value) => 0.4 * value));
  const patch = [
    [1, 1],
    [1, -1],
    [-1, -1],
    [-1, 1],
  ].map(([s, t]) => point.map((value, axis) => value + s * u[axis] + t * w[axis]));
  traceWorld(context, view, patch, true);
  context.stroke();
}
