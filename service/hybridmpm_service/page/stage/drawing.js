// Sketches, their goals, and the pushing hand, painted over the particles.

import { inSpace } from "../sketch/prediction.js";
import { arrowHead, distance, ellipseOf, pathLength, widthsAlong } from "../sketch/sketch.js";
import { trace, traceWorld } from "./lines.js";

const COLORS = { arrow: "#ff6b61", ellipse: "#62e08c", shape: "#62e08c" };
export const HAND_COLOR = "#58b9ff";

/** Points of a sketch on the stage [px]. */
function project(view, scene, sketch) {
  return inSpace(sketch, scene.walls).map((point) => view.project(point));
}

/** Draw a stroke, with its head if it is an arrow. `alpha` fades strokes that are done. */
export function drawSketch(context, view, scene, sketch, alpha) {
  const points = project(view, scene, sketch);
  if (points.length < 2) return;
  context.save();
  context.globalAlpha = alpha;
  context.strokeStyle = COLORS[sketch.kind];
  context.fillStyle = COLORS[sketch.kind];
  context.lineJoin = "round";
  context.lineCap = "round";
  context.shadowColor = "rgb(0 0 0 / 0.55)";
  context.shadowBlur = 6;
  if (sketch.kind !== "arrow") drawOutline(context, view, scene, sketch, points);
  else drawArrow(context, view, scene, sketch, points);
  context.restore();
}

/** Draw a stroke of a flat scene that is not finished yet, as the line that it is. */
export function drawStroke(context, view, sketch) {
  context.save();
  context.strokeStyle = COLORS[sketch.kind];
  context.lineWidth = Math.max(3, (3.2 * view.size) / 512);
  context.lineJoin = "round";
  context.lineCap = "round";
  traceWorld(context, view, sketch.points);
  context.stroke();
  context.restore();
}

/** Line widths on the stage: 4 raster pixels in 2D, in 3D the width that means the depth. */
function lineWidths(view, scene, sketch) {
  const perRasterPixel = view.size / 512;
  if (scene.dim === 2) return sketch.points.map(() => Math.max(3, 3.2 * perRasterPixel));
  return widthsAlong(sketch, sketch.widths).map((width) => Math.max(1.5, width * perRasterPixel));
}

/** Begin a closed curve through the middles of the sides: a freehand outline without corners. */
function traceSmooth(context, points) {
  const middle = (i) => {
    const [a, b] = [points[i % points.length], points[(i + 1) % points.length]];
    return [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
  };
  context.beginPath();
  context.moveTo(...middle(0));
  for (let i = 1; i <= points.length; i += 1) {
    const [px, py] = points[i % points.length];
    context.quadraticCurveTo(px, py, ...middle(i));
  }
}

/** Begin the closed lines of a shape that no hand has drawn, with its holes. */
function traceAll(context, view, scene, sketch) {
  context.beginPath();
  for (const points of sketch.outlines) {
    const [first, ...rest] = project(view, scene, { ...sketch, points });
    context.moveTo(...first);
    for (const point of rest) context.lineTo(...point);
    context.closePath();
  }
}

function drawOutline(context, view, scene, sketch, points) {
  context.lineWidth = Math.min(lineWidths(view, scene, sketch)[0], 12);
  if (sketch.kind !== "shape") traceSmooth(context, points);
  else if (sketch.outlines === undefined) trace(context, points, true);
  else traceAll(context, view, scene, sketch);
  context.stroke();
  context.globalAlpha *= 0.12;
  context.fill("evenodd");
}

/** Draw shaft and head as one shape, so that a faded arrow has no seams. */
function drawArrow(context, view, scene, sketch, points) {
  const widths = lineWidths(view, scene, sketch);
  const head = arrowHead(points, Math.min(0.5 * pathLength(points), 10 + 2.2 * Math.max(...widths)));
  const base = [(head[0][0] + head[2][0]) / 2, (head[0][1] + head[2][1]) / 2];
  const reach = distance(base, points.at(-1));
  const shaft = points.filter((point) => distance(point, points.at(-1)) > reach);
  shaft.push(base);
  const sides = shaft.map((point, i) => {
    const [a, b] = [shaft[Math.max(i - 1, 0)], shaft[Math.min(i + 1, shaft.length - 1)]];
    const along = Math.max(distance(a, b), 1e-6);
    const half = widths[Math.min(i, widths.length - 1)] / 2;
    const [nx, ny] = [(-(b[1] - a[1]) / along) * half, ((b[0] - a[0]) / along) * half];
    return { left: [point[0] + nx, point[1] + ny], right: [point[0] - nx, point[1] - ny] };
  });
  const left = sides.map((side) => side.left);
  const right = sides.map((side) => side.right).reverse();
  // The barbs change sides where the direction of y does: join each to the nearer side of the shaft.
  const crossed = distance(left.at(-1), head[0]) > distance(left.at(-1), head[2]);
  trace(context, [...left, ...(crossed ? [...head].reverse() : head), ...right], true);
  context.lineWidth = 1;
  context.fill();
  context.stroke();
}

/** Draw a word beside the end of the stroke, for what the stroke is taken for. */
export function drawGuess(context, view, scene, sketch) {
  const [px, py] = project(view, scene, sketch).at(-1);
  const label = { arrow: "arrow", ellipse: "oval", shape: "shape" }[sketch.kind];
  context.save();
  context.font = "600 13px system-ui, sans-serif";
  const width = context.measureText(label).width + 18;
  const left = Math.min(Math.max(px + 14, 4), view.width - width - 4);
  const top = Math.max(py - 36, 4);
  context.fillStyle = "rgb(8 12 18 / 0.85)";
  context.beginPath();
  context.roundRect(left, top, width, 26, 13);
  context.fill();
  context.fillStyle = COLORS[sketch.kind];
  context.textBaseline = "middle";
  context.fillText(label, left + 9, top + 13);
  context.restore();
}

/**
 * Draw where a sketch leads: what is to be filled, and the way of the centre of mass.
 *
 * @param goal of the service's answer to the sketch
 */
export function drawGoal(context, view, goal) {
  context.save();
  for (const line of goal.outlines ?? (goal.region === null ? [] : [goal.region])) {
    context.strokeStyle = COLORS.ellipse;
    context.fillStyle = COLORS.ellipse;
    context.lineWidth = 1.5;
    context.setLineDash([5, 5]);
    traceWorld(context, view, line, true);
    context.stroke();
    context.globalAlpha = 0.1;
    context.fill();
    context.globalAlpha = 1;
  }
  context.lineCap = "round";
  context.strokeStyle = "rgb(255 255 255 / 0.65)";
  context.lineWidth = 1.5;
  context.setLineDash([2, 6]);
  traceWorld(context, view, goal.path);
  context.stroke();
  context.setLineDash([]);
  context.fillStyle = "rgb(255 255 255 / 0.7)";
  drawDot(context, view.project(goal.path[0]), 3);
  drawTarget(context, ...view.project(goal.path.at(-1)));
  context.restore();
}

/**
 * Draw where a sketch is likely to lead, as long as the service has not said it: dots that walk along the way.
 *
 * @param goal as `predicted` gives it
 * @param steps how far the dots have walked [px]
 */
export function drawPrediction(context, view, { path, region }, steps) {
  context.save();
  context.lineCap = "round";
  context.lineDashOffset = -steps;
  if (region !== null) {
    context.strokeStyle = COLORS.ellipse;
    context.globalAlpha = 0.5;
    context.lineWidth = 1.5;
    context.setLineDash([5, 5]);
    traceWorld(context, view, region, true);
    context.stroke();
  }
  context.globalAlpha = 1;
  context.strokeStyle = "rgb(255 255 255 / 0.6)";
  context.fillStyle = "rgb(255 255 255 / 0.6)";
  context.lineWidth = 2.5;
  context.setLineDash([0.1, 8]);
  traceWorld(context, view, path);
  context.stroke();
  drawDot(context, view.project(path[0]), 3);
  drawDot(context, view.project(path.at(-1)), 4);
  context.restore();
}

/** Draw the hand that draws by itself, at a point of the world: a fingertip, and the ring of its touch. */
export function drawGhostHand(context, view, point) {
  const [px, py] = view.project(point);
  context.save();
  context.shadowColor = "rgb(0 0 0 / 0.5)";
  context.shadowBlur = 10;
  context.fillStyle = "rgb(255 255 255 / 0.9)";
  context.strokeStyle = "rgb(255 255 255 / 0.55)";
  context.lineWidth = 2;
  context.beginPath();
  context.arc(px, py, 16, 0, 2 * Math.PI);
  context.stroke();
  drawDot(context, [px, py], 7);
  context.restore();
}

/** Draw the hand that pushes the fluid. */
export function drawHand(context, view, point, radius) {
  const [px, py] = view.project(point);
  context.save();
  context.strokeStyle = HAND_COLOR;
  context.fillStyle = HAND_COLOR;
  context.lineWidth = 1.5;
  context.beginPath();
  context.arc(px, py, radius * view.pixelsPerMetre, 0, 2 * Math.PI);
  context.stroke();
  context.globalAlpha = 0.1;
  context.fill();
  context.globalAlpha = 1;
  drawDot(context, [px, py], 3);
  context.restore();
}

/** Draw the cursor of the keyboard at a place of the stage [px]. */
export function drawCursor(context, [px, py]) {
  context.save();
  for (const [color, width] of [
    ["rgb(0 0 0 / 0.7)", 5],
    ["#ffffff", 2],
  ]) {
    context.strokeStyle = color;
    context.lineWidth = width;
    for (const [dx, dy] of [
      [12, 0],
      [0, 12],
    ]) {
      trace(context, [
        [px - dx, py - dy],
        [px + dx, py + dy],
      ]);
      context.stroke();
    }
  }
  context.restore();
}

function drawTarget(context, px, py) {
  context.strokeStyle = "#ffd166";
  context.lineWidth = 2;
  context.beginPath();
  context.arc(px, py, 11, 0, 2 * Math.PI);
  context.stroke();
  for (const [ux, uy] of [
    [1, 0],
    [-1, 0],
    [0, 1],
    [0, -1],
  ]) {
    trace(context, [
      [px + 6 * ux, py + 6 * uy],
      [px + 16 * ux, py + 16 * uy],
    ]);
    context.stroke();
  }
}

function drawDot(context, [px, py], radius) {
  context.beginPath();
  context.arc(px, py, radius, 0, 2 * Math.PI);
  context.fill();
}

/** Draw the ellipse that a freehand outline stands for, so that the user sees what the service will read. */
export function drawFittedEllipse(context, view, scene, sketch) {
  const fitted = ellipseOf(sketch.points);
  if (fitted === null || scene.dim !== 2) return;
  const [px, py] = view.project(fitted.center);
  const scale = view.pixelsPerMetre;
  context.save();
  context.strokeStyle = COLORS.ellipse;
  context.setLineDash([4, 5]);
  context.lineWidth = 1.5;
  context.beginPath();
  context.ellipse(px, py, fitted.axes[0] * scale, fitted.axes[1] * scale, -fitted.angle, 0, 2 * Math.PI);
  context.stroke();
  context.restore();
}
