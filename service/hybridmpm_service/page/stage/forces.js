// Arrows of the acceleration that steers the fluid, one for each cell of a coarse grid.

import { arrowHead } from "../sketch/sketch.js";
import { trace } from "./lines.js";

const COLOR = "#ff9f43";
const LONGEST = 1.6; // length of the longest arrow, in cells
const SHORTEST = 4; // arrows below this length would be specks [px]

/**
 * Draw the arrows of a field.
 *
 * @param field {cell [m], points: [[x, y(, z)], ...], force: [[...], ...] [m/s^2]}
 */
export function drawForces(context, view, { cell, points, force }) {
  const sizes = force.map((vector) => Math.hypot(...vector));
  const largest = Math.max(...sizes, 1e-9);
  context.save();
  context.strokeStyle = COLOR;
  context.lineWidth = 1.75;
  context.lineCap = "round";
  context.lineJoin = "round";
  context.shadowColor = "rgb(0 0 0 / 0.6)";
  context.shadowBlur = 3;
  points.forEach((point, i) => {
    const reach = (LONGEST * cell) / largest;
    const start = view.project(point);
    const end = view.project(point.map((value, axis) => value + reach * force[i][axis]));
    const length = Math.hypot(end[0] - start[0], end[1] - start[1]);
    if (length < SHORTEST) return;
    trace(context, [start.slice(0, 2), end.slice(0, 2)]);
    context.stroke();
    trace(context, arrowHead([start, end], Math.min(6, 0.45 * length)));
    context.stroke();
  });
  context.restore();
}
