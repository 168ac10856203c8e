// Estimated goal of a sketch, before the service has planned it.

import { depthOfWidth, ellipseOf, widthsAlong } from "./sketch.js";

/**
 * The way that the centre of mass will go, and the outline that the fluid will fill, as the `goal` of a plan has them.
 *
 * An arrow moves the centre of mass along from its present place, an oval to the oval's middle. What walls, obstacles
 * and the fluid's volume make of it is for the plan to say.
 *
 * @param sketch {kind, points, widths: [start, end]}
 * @param centroid centre of mass, D numbers; null where there is no particle
 * @param walls {lower, upper}
 * @returns {path: [[x, y(, z)], ...], region: [[x, y(, z)], ...] or null}; null where nothing can be said
 */
export function predicted(sketch, centroid, walls) {
  if (centroid === null || sketch.points.length < 2) return null;
  const points = inSpace(sketch, walls);
  if (sketch.kind === "arrow") {
    const path = points.map((point) => point.map((value, axis) => centroid[axis] + value - points[0][axis]));
    return { path, region: null };
  }
  const shape = ellipseOf(sketch.outlines?.flat() ?? sketch.points);
  if (shape === null) return null;
  return { path: [centroid, [...shape.center, ...points[0].slice(2)]], region: points };
}

/** Points of a sketch in the world: in 3D each at the depth that its stroke width means. */
export function inSpace(sketch, { lower, upper }) {
  if (lower.length === 2) return sketch.points;
  const widths = widthsAlong(sketch, sketch.widths);
  return sketch.points.map((point, i) => [...point, lower[2] + depthOfWidth(widths[i]) * (upper[2] - lower[2])]);
}
