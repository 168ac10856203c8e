// Colours of the particles in sRGB, 0 .. 255, for both renderers.

export const WATER_DEEP = [12, 74, 168];
export const WATER_SHALLOW = [46, 148, 238];
export const WATER_FAST = [98, 186, 250];
export const WATER_CREST = [196, 236, 255];
export const GOOP_DEEP = [150, 38, 92];
export const GOOP_SHALLOW = [236, 98, 146];
export const SAND_DARK = [168, 120, 62];
export const SAND_LIGHT = [240, 205, 140];

/** A colour as GLSL writes it. */
export const glsl = (rgb) => `vec3(${rgb.map((channel) => (channel / 255).toFixed(4)).join(", ")})`;

export const mix = (a, b, t) => a.map((channel, i) => channel + (b[i] - channel) * t);
export const css = (rgb) => `rgb(${rgb.map(Math.round).join(" ")})`;

/** A smooth step from 0 at `low` to 1 at `high`, as in GLSL. */
export function smoothstep(low, high, value) {
  const t = Math.min(1, Math.max(0, (value - low) / (high - low)));
  return t * t * (3 - 2 * t);
}

/** A repeatable pseudo-random number in [0, 1) for particle `i` of a scene, which it keeps: the shade of its grain. */
export const grainShade = ({ ids }, i) => (Math.imul(ids === null ? i : ids[i], 0x9e3779b1) >>> 22) / 1024;
