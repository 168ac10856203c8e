// The depth of strokes in a 3D scene, seen from above: the fluid, the pen, the sketch and its goal.

import { inSpace } from "./prediction.js";
import { depthOfWidth } from "./sketch.js";

const FLUID = "rgb(88 185 255 / 0.55)";
const PEN = "#ffd166";
const COLORS = { arrow: "#ff6b61", ellipse: "#62e08c", shape: "#62e08c" };
const CELL = 2; // side of a dot of the fluid [px of the map]

/**
 * Draw the map of a scene from above.
 *
 * @param canvas  the map, its back wall at the top
 * @param scene   {walls}
 * @param shown   {frame, sketch, plan}, each null where there is none
 * @param widths  stroke widths at the start and the end of a stroke
 */
export function drawDepths(canvas, { walls: { lower, upper } }, { frame, sketch, plan }, widths) {
  const context = canvas.getContext("2d");
  const { width, height } = canvas;
  context.clearRect(0, 0, width, height);
  const across = (x) => ((x - lower[0]) / (upper[0] - lower[0])) * width;
  const down = (z) => ((z - lower[2]) / (upper[2] - lower[2])) * height;
  if (frame !== null) {
    context.fillStyle = FLUID;
    const seen = new Set();
    for (let i = 0; i < frame.positions.length; i += 3) {
      const [x, y] = [across(frame.positions[i] / 65535), down(frame.positions[i + 2] / 65535)].map((at) => CELL * Math.floor(at / CELL));
      const key = y * width + x;
      if (seen.has(key)) continue;
      seen.add(key);
      context.fillRect(x, y, CELL, CELL);
    }
  }
  const line = (points, color, thick, dashes = []) => {
    context.strokeStyle = color;
    context.lineWidth = thick;
    context.setLineDash(dashes);
    context.beginPath();
    for (const point of points) context.lineTo(across(point[0]), down(point[2]));
    context.stroke();
  };
  const levels = [...new Set(widths)].map((one) => lower[2] + depthOfWidth(one) * (upper[2] - lower[2]));
  for (const z of levels) line([[lower[0], 0, z], [upper[0], 0, z]], PEN, 2, [6, 5]);
  if (sketch !== null && sketch.points.length > 1) line(inSpace(sketch, { lower, upper }), COLORS[sketch.kind], 5);
  if (plan !== null) line(plan.goal.path, "#ffffff", 3, [3, 5]);
}
