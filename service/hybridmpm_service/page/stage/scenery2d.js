// Walls and obstacles of 2D scenes.

import { drawGrid, OBSTACLE_EDGE, traceWorld } from "./lines.js";

const WALL_COLOR = "#3a4a5f";
const OBSTACLE_FILL = "#4a5a70";

function rectangleOf(view, { lower, upper }) {
  const [left, bottom] = view.project(lower);
  const [right, top] = view.project(upper);
  return [left, top, right - left, bottom - top];
}

/** Draw the ground inside the walls, with a grid. */
export function drawTank(context, view, walls) {
  const [left, top, width, height] = rectangleOf(view, walls);
  const shade = context.createLinearGradient(0, top, 0, top + height);
  shade.addColorStop(0, "#121b28");
  shade.addColorStop(1, "#0b111a");
  context.fillStyle = shade;
  context.fillRect(left, top, width, height);
  context.strokeStyle = "rgb(140 170 210 / 0.06)";
  drawGrid(context, view, walls, 0, 1);
  drawGrid(context, view, walls, 1, 0);
}

/** Draw the walls as a frame. It hides the liquid's soft rim, which reaches a little past them. */
export function drawFlatWalls(context, view, walls) {
  const [left, top, width, height] = rectangleOf(view, walls);
  context.fillStyle = "#0a0f16";
  context.beginPath();
  context.rect(0, 0, view.width, view.height);
  context.roundRect(left, top, width, height, 3);
  context.fill("evenodd");
  context.strokeStyle = WALL_COLOR;
  context.lineWidth = 1.5;
  context.beginPath();
  context.roundRect(left, top, width, height, 3);
  context.stroke();
}

export function drawFlatObstacle(context, view, obstacle) {
  const scale = view.pixelsPerMetre;
  context.fillStyle = OBSTACLE_FILL;
  context.strokeStyle = OBSTACLE_EDGE;
  context.lineWidth = 1.25;
  context.lineCap = "round";
  if (obstacle.shape === "segment") {
    const width = Math.max(obstacle.thickness * scale, 3);
    traceWorld(context, view, [obstacle.start, obstacle.end]);
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
    traceWorld(context, view, [a, b, c, d], true);
  } else if (obstacle.shape === "box") {
    context.beginPath();
    context.roundRect(...rectangleOf(view, obstacle), 2);
  } else if (obstacle.shape === "polygon") {
    drawPolygon(context, view, obstacle.vertices);
    return;
  } else {
    traceWorld(context, view, halfSpaceOutline(obstacle), true);
  }
  context.fill();
  context.stroke();
}

/** Draw a polygon by the even-odd rule. */
function drawPolygon(context, view, vertices) {
  traceWorld(context, view, vertices, true);
  context.fill("evenodd");
  for (const ends of edgesOf(vertices)) {
    traceWorld(context, view, ends);
    context.stroke();
  }
}

/** The edges of a polygon in order; ways there and back, as lead to holes, are none. */
export function edgesOf(vertices) {
  const edges = vertices.map((start, k) => [start, vertices[(k + 1) % vertices.length]]);
  const names = edges.map((ends) => ends.map(String).sort().join(" "));
  const times = new Map();
  for (const name of names) times.set(name, (times.get(name) ?? 0) + 1);
  return edges.filter((_, k) => times.get(names[k]) % 2);
}

/** A large quadrilateral on the solid side of the half-space; the walls' frame hides what sticks out. */
function halfSpaceOutline({ point, normal }) {
  const size = Math.hypot(...normal);
  const [nx, ny] = [normal[0] / size, normal[1] / size];
  const corner = (along, inward) => [point[0] - along * ny - inward * nx, point[1] + along * nx - inward * ny];
  return [corner(-2, 0), corner(2, 0), corner(2, 2), corner(-2, 2)];
}
