// Lengths of the picture: its unit is the longest side of the world, so that worlds of any size are drawn alike.

import { lengthOf } from "../frames.js";

/** Names of what is a length, a place or a velocity; those of a scene that are plain numbers are its lengths. */
const LENGTHS = ["radius", "thickness", "spacing", "cell", "reach", "half"];
const PLACES = ["lower", "upper", "center", "start", "end", "point", "points", "path", "region", "outlines", "axes", "centroid", "velocity", "half", "corners", "grip", "target", "vertices"];

/** The sides of the world of a scene, in the longest one. */
export const sidesOf = (scene) => (scene.world?.size ?? [1, 1, 1]).map((side) => side / lengthOf(scene));

const times = (value, factor) => (Array.isArray(value) ? value.map((part) => times(part, factor)) : value * factor);

/** A copy of a scene, of a part of it or of an answer about it, in which all lengths are multiplied. */
export function scaled(value, factor) {
  if (factor === 1 || value === null || typeof value !== "object") return value;
  if (Array.isArray(value)) return value.map((part) => scaled(part, factor));
  return Object.fromEntries(
    Object.entries(value).map(([name, part]) => {
      // An emitter's start is a time, and a number.
      const isLength = (LENGTHS.includes(name) && typeof part === "number") || (PLACES.includes(name) && Array.isArray(part));
      return [name, isLength ? times(part, factor) : scaled(part, factor)];
    }),
  );
}
