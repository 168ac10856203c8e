// Walls, obstacles, the box of a 3D scene: everything but the particles. Drawn with Canvas2D, hence crisp.

import { cornersOf, placed } from "./motion.js";

const WALL_COLOR = "#3a4a5f";
const OBSTACLE_FILL = "#4a5a70";
const OBSTACLE_EDGE = "#93a7c0";
const GRID_STEP = 0.1;

/** Behind the particles, at a simulated time [s]. */
export function drawBackdrop(context, view, scene, time) {
  if (scene.dim === 2) drawTank(context, view, scene);
  else drawBox(context, view, scene, time);
}

/** Whether the backdrop changes with time. */
export function backdropMoves(scene) {
  return scene.dim === 3 && scene.obstacles.some((obstacle) => obstacle.motion !== undefined);
}

/** In front of the particles, at a simulated time [s]. */
export function drawForeground(context, view, scene, time) {
  if (scene.dim === 2) {
    scene.obstacles.forEach((obstacle) => drawFlatObstacle(context, view, placed(obstacle, time)));
    drawFlatWalls(context, view, scene);
  } else {
    drawEdges(context, view, cornersOf(scene.walls), true);
  }
}

function path(context, view, points, closed) {
  context.beginPath();
  points.forEach((point, i) => {
    const [px, py] = view.project(point);
    if (i === 0) context.moveTo(px, py);
    else context.lineTo(px, py);
  });
  if (closed) context.closePath();
}

// ---- 2D -------------------------------------------------------------------------------------------------

function rectangleOf(view, { lower, upper }) {
  const [left, bottom] = view.project(lower);
  const [right, top] = view.project(upper);
  return [left, top, right - left, bottom - top];
}

function drawTank(context, view, { walls }) {
  const [left, top, width, height] = rectangleOf(view, walls);
  const shade = context.createLinearGradient(0, top, 0, top + height);
  shade.addColorStop(0, "#121b28");
  shade.addColorStop(1, "#0b111a");
  context.fillStyle = shade;
  context.fillRect(left, top, width, height);
  context.strokeStyle = "rgb(140 170 210 / 0.06)";
  context.lineWidth = 1;
  for (let axis = 0; axis < 2; axis += 1) {
    for (let at = walls.lower[axis] + GRID_STEP; at < walls.upper[axis] - 1e-6; at += GRID_STEP) {
      const line = [[...walls.lower], [...walls.upper]];
      line[0][axis] = at;
      line[1][axis] = at;
      path(context, view, line, false);
      context.stroke();
    }
  }
}

/** The frame hides the liquid's soft rim, which reaches a little past the wall. */
function drawFlatWalls(context, view, { walls }) {
  const [left, top, width, height] = rectangleOf(view, walls);
  context.fillStyle = "#0a0f16";
  context.beginPath();
  context.rect(0, 0, view.size, view.size);
  context.roundRect(left, top, width, height, 3);
  context.fill("evenodd");
  context.strokeStyle = WALL_COLOR;
  context.lineWidth = 1.5;
  context.beginPath();
  context.roundRect(left, top, width, height, 3);
  context.stroke();
}

function drawFlatObstacle(context, view, obstacle) {
  const scale = view.pixelsPerMetre;
  context.fillStyle = OBSTACLE_FILL;
  context.strokeStyle = OBSTACLE_EDGE;
  context.lineWidth = 1.25;
  context.lineCap = "round";
  if (obstacle.shape === "segment") {
    const width = Math.max(obstacle.thickness * scale, 3);
    path(context, view, [obstacle.start, obstacle.end], false);
    context.strokeStyle = OBSTACLE_EDGE;
    context.lineWidth = width;
    context.stroke();
    context.strokeStyle = OBSTACLE_FILL;
    context.lineWidth = Math.max(width - 2.5, 1);
    context.stroke();
    return;
  }
  if (obstacle.shape === "ball") {
    const [px, py] = view.project(obstacle.center);
    context.beginPath();
    context.arc(px, py, obstacle.radius * scale, 0, 2 * Math.PI);
  } else if (obstacle.corners !== undefined) {
    const [a, b, d, c] = obstacle.corners;
    path(context, view, [a, b, c, d], true);
  } else if (obstacle.shape === "box") {
    context.beginPath();
    context.roundRect(...rectangleOf(view, obstacle), 2);
  } else {
    path(context, view, halfSpaceOutline(obstacle), true);
  }
  context.fill();
  context.stroke();
}

/** A large quadrilateral on the solid side of the half-space; the walls' frame hides what sticks out. */
function halfSpaceOutline({ point, normal }) {
  const size = Math.hypot(...normal);
  const [nx, ny] = [normal[0] / size, normal[1] / size];
  const corner = (along, inward) => [point[0] - along * ny - inward * nx, point[1] + along * nx - inward * ny];
  return [corner(-2, 0), corner(2, 0), corner(2, 2), corner(-2, 2)];
}

// ---- 3D -------------------------------------------------------------------------------------------------

function drawBox(context, view, scene, time) {
  const { lower, upper } = scene.walls;
  const corners = [
    [lower[0], lower[1], lower[2]],
    [upper[0], lower[1], lower[2]],
    [upper[0], lower[1], upper[2]],
    [lower[0], lower[1], upper[2]],
  ];
  path(context, view, corners, true);
  context.fillStyle = "#111a27";
  context.fill();
  context.strokeStyle = "rgb(140 170 210 / 0.14)";
  context.lineWidth = 1;
  for (const [axis, across] of [
    [0, 2],
    [2, 0],
  ]) {
    for (let at = lower[axis] + GRID_STEP; at < upper[axis] - 1e-6; at += GRID_STEP) {
      const line = [[...lower], [...lower]];
      line[0][axis] = at;
      line[1][axis] = at;
      line[1][across] = upper[across];
      path(context, view, line, false);
      context.stroke();
    }
  }
  drawEdges(context, view, cornersOf(scene.walls), false);
  scene.obstacles.forEach((obstacle) => drawSolidObstacle(context, view, placed(obstacle, time)));
}

/** The twelve edges; those that meet in the corner nearest to the viewer lie in front of the particles. */
function drawEdges(context, view, corners, inFront) {
  const depth = (bits) => view.project(corners[bits])[2];
  const nearest = [0, 1, 2, 3, 4, 5, 6, 7].reduce((best, bits) => (depth(bits) > depth(best) ? bits : best));
  context.strokeStyle = inFront ? "rgb(150 178 212 / 0.28)" : "rgb(150 178 212 / 0.5)";
  context.lineWidth = 1.25;
  for (let bits = 0; bits < 8; bits += 1) {
    for (let axis = 0; axis < 3; axis += 1) {
      const other = bits | (1 << axis);
      if (other === bits || (bits === nearest || other === nearest) !== inFront) continue;
      path(context, view, [corners[bits], corners[other]], false);
      context.stroke();
    }
  }
}

/** Obstacles of 3D scenes as outlines. */
function drawSolidObstacle(context, view, obstacle) {
  context.strokeStyle = OBSTACLE_EDGE;
  context.lineWidth = 1.25;
  if (obstacle.shape === "box") {
    const corners = obstacle.corners ?? cornersOf(obstacle);
    drawEdges(context, view, corners, true);
    drawEdges(context, view, corners, false);
  } else if (obstacle.shape === "ball") {
    drawRings(context, view, obstacle.center, obstacle.radius);
  } else if (obstacle.shape === "segment") {
    const [ax, ay] = view.project(obstacle.start);
    const [bx, by] = view.project(obstacle.end);
    context.lineCap = "round";
    context.lineWidth = Math.max(2, obstacle.thickness * view.pixelsPerMetre);
    context.strokeStyle = "rgb(147 167 192 / 0.55)";
    context.beginPath();
    context.moveTo(ax, ay);
    context.lineTo(bx, by);
    context.stroke();
  } else {
    drawPlane(context, view, obstacle);
  }
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
    path(context, view, ring, true);
    context.stroke();
  }
}

/** A square patch of the plane around its point. */
function drawPlane(context, view, { point, normal }) {
  const size = Math.hypot(...normal);
  const n = normal.map((value) => value / size);
  const helper = Math.abs(n[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const across = cross(helper, n);
  const u = across.map((value) => (0.4 * value) / Math.hypot(...across));
  const w = cross(n, u);
  const patch = [
    [1, 1],
    [1, -1],
    [-1, -1],
    [-1, 1],
  ].map(([s, t]) => point.map((value, axis) => value + s * u[axis] + t * w[axis]));
  path(context, view, patch, true);
  context.stroke();
}
