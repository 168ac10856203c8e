// Lines on the stage, and what the scenery of 2D and 3D scenes shares.

export const OBSTACLE_EDGE = "#93a7c0";
const GRID_STEP = 0.1; // m

/** Begin a path through points of the stage [px]. */
export function trace(context, points, closed = false) {
  context.beginPath();
  points.forEach(([px, py], i) => (i === 0 ? context.moveTo(px, py) : context.lineTo(px, py)));
  if (closed) context.closePath();
}

/** Begin a path through points of the world [m]. */
export function traceWorld(context, view, points, closed = false) {
  trace(context, points.map((point) => view.project(point)), closed);
}

/** Draw grid lines along `across`, one for each tenth of a metre of `axis`; other axes stay at their lower end. */
export function drawGrid(context, view, { lower, upper }, axis, across) {
  context.lineWidth = 1;
  for (let at = lower[axis] + GRID_STEP; at < upper[axis] - 1e-6; at += GRID_STEP) {
    const line = [[...lower], [...lower]];
    line[0][axis] = at;
    line[1][axis] = at;
    line[1][across] = upper[across];
    traceWorld(context, view, line);
    context.stroke();
  }
}
