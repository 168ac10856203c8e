// Colours of the particles in sRGB, 0 .. 255, for both renderers.

export const WATER_DEEP = [12, 74, 168];
export const WATER_SHALLOW = [46, 148, 238];
export const WATER_FAST = [98, 186, 250];
export const WATER_CREST = [196, 236, 255];
export const GOOP_DEEP = [150, 38, 92];
export const GOOP_SHALLOW = [236, 98, 146];
export const LIQUID_DEEP = [134, 70, 8];
export const LIQUID_SHALLOW = [232, 150, 36];
export const LIQUID_CREST = [255, 226, 160];
export const SAND_DARK = [168, 120, 62];
export const SAND_LIGHT = [240, 205, 140];

/** A colour as GLSL writes it. */
export const glsl = (rgb) => `vec3(${rgb.map((channel) => (channel / 255).toFixed(4)).join(", ")})`;

export const mix = (a, b, t) => a.map((channel, i) => channel + (b[i] - channel) * t);
export const css = (rgb) => `rgb(${rgb.map(Math.round).join(" ")})`;

/** Colours of a scale from low to high, ever brighter, from blue to yellow: also distinct for colour-blind visitors. */
const SCALE = [[138, 122, 240], [72, 142, 236], [40, 164, 166], [136, 204, 100], [252, 236, 90]];

/** The colour at a place of the scale, in [0, 1]. */
export function onScale(t) {
  const at = Math.min(0.9999, Math.max(0, t)) * (SCALE.length - 1);
  return mix(SCALE[Math.floor(at)], SCALE[Math.floor(at) + 1], at % 1);
}

/** The same as a function of GLSL, `onScale(t)`. */
export const SCALE_GLSL = `vec3 onScale(float t) {
  float at = ${(SCALE.length - 1).toFixed(1)} * clamp(t, 0.0, 1.0);
  vec3 found = ${glsl(SCALE[0])};
${SCALE.slice(1)
  .map((rgb, i) => `  found = mix(found, ${glsl(rgb)}, clamp(at - ${i.toFixed(1)}, 0.0, 1.0));`)
  .join("\n")}
  return found;
}`;

/** A smooth step from 0 at `low` to 1 at `high`, as in GLSL. */
export function smoothstep(low, high, value) {
  const t = Math.min(1, Math.max(0, (value - low) / (high - low)));
  return t * t * (3 - 2 * t);
}

/** A repeatable pseudo-random number in [0, 1) for particle `i` of a scene, which it keeps: the shade of its grain. */
export const grainShade = ({ ids }, i) => (Math.imul(ids === null ? i : ids[i], 0x9e3779b1) >>> 22) / 1024;
