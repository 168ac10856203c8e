// Colours of the particles, shared by both renderers. sRGB, 0 .. 255.

export const WATER_DEEP = [12, 74, 168];
export const WATER_SHALLOW = [46, 148, 238];
export const WATER_FAST = [98, 186, 250];
export const WATER_CREST = [196, 236, 255];
export const GOOP_DEEP = [150, 38, 92];
export const GOOP_SHALLOW = [236, 98, 146];
export const SAND_DARK = [168, 120, 62];
export const SAND_LIGHT = [240, 205, 140];

/** A colour for GLSL. */
export const glsl = (rgb) => `vec3(${rgb.map((channel) => (channel / 255).toFixed(4)).join(", ")})`;

export const mix = (a, b, t) => a.map((channel, i) => channel + (b[i] - channel) * t);
export const css = (rgb) => `rgb(${rgb.map(Math.round).join(" ")})`;

/** Smooth step from 0 at `low` to 1 at `high`, as GLSL has it. */
export function smoothstep(low, high, value) {
  const t = Math.min(1, Math.max(0, (value - low) / (high - low)));
  return t * t * (3 - 2 * t);
}

/** A repeatable pseudo-random number in [0, 1) for a particle: the shade of its grain. */
export const grainShade = (index) => (((index * 2654435761) >>> 0) % 1024) / 1024;
