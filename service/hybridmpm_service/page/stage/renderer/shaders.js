// GLSL of the WebGL2 renderer.

import { GOOP, LIQUID, SAND } from "../../frames.js";
import { FASTEST } from "../particles.js";
import * as palette from "./palette.js";

/**
 * Reach of a particle's kernel, and field values at the surface and inside, in units of one particle's peak.
 *
 * A kernel of (1 - q^2)^2 over a radius of 3 spacings adds up to 9.4 inside the liquid.
 */
export const KERNEL_SPACINGS = 3;
export const SURFACE = 0.78;
export const INTERIOR = 8.2;

/** Beginning of a vertex shader that runs for each particle. */
export const ATTRIBUTES = `#version 300 es
precision highp float;
layout(location = 0) in vec3 position;
layout(location = 1) in float type;
layout(location = 2) in float speed;
layout(location = 3) in float grain;
layout(location = 4) in float quantity;
uniform bool byQuantity;
uniform mat4 matrix;
uniform float pointSize;
`;

/** Whether a particle is drawn as one by itself: grains of sand are, and all where they are coloured by a quantity. */
const ALONE = `(byQuantity || type == ${SAND}.0)`;

/** Beginning of a fragment shader. */
export const FRAGMENT = `#version 300 es
precision highp float;
out vec4 color;
`;

/** Each liquid particle as a soft blob: R water, G water x speed, B goop, A viscous liquid. */
export const BLOB_VERTEX = `${ATTRIBUTES}
out vec4 weight;
void main() {
  gl_Position = type == ${SAND}.0 ? vec4(2.0, 2.0, 2.0, 1.0) : matrix * vec4(position, 1.0);
  gl_PointSize = pointSize;
  weight = vec4(1.0, speed, 0.0, 0.0);
  if (type == ${GOOP}.0) weight = vec4(0.0, 0.0, 1.0, 0.0);
  if (type == ${LIQUID}.0) weight = vec4(0.0, 0.0, 0.0, 1.0);
}`;

export const BLOB_FRAGMENT = `${FRAGMENT}
in vec4 weight;
void main() {
  vec2 p = 2.0 * gl_PointCoord - 1.0;
  float q = max(0.0, 1.0 - dot(p, p));
  color = weight * q * q;
}`;

export const SCREEN_VERTEX = `#version 300 es
out vec2 at;
void main() {
  at = vec2(gl_VertexID == 1 ? 2.0 : 0.0, gl_VertexID == 2 ? 2.0 : 0.0);
  gl_Position = vec4(2.0 * at - 1.0, 0.0, 1.0);
}`;

/** The field as a lit liquid: alpha from the threshold, a dome near the surface gives the normals. */
export const LIQUID_FRAGMENT = `${FRAGMENT}
in vec2 at;
uniform sampler2D field;
uniform vec2 texel;
const float SURFACE = ${SURFACE.toFixed(3)};
const float INTERIOR = ${INTERIOR.toFixed(3)};
float dome(float density) { return smoothstep(SURFACE * 0.6, INTERIOR * 0.62, density); }
vec3 lit(vec3 deep, vec3 shallow, vec3 crest, float density, vec2 slope, float height) {
  vec3 normal = normalize(vec3(-slope * 5.0, 1.0));
  vec3 light = normalize(vec3(-0.45, 0.8, 0.55));
  float facing = dot(normal, light);
  vec3 body = mix(shallow, deep, 0.75 * dome(density)) * (0.88 + 0.16 * height);
  float rim = 1.0 - smoothstep(SURFACE, SURFACE * 4.5, density);
  body = mix(body, crest, rim * (0.25 + 0.55 * max(0.0, facing)));
  return body + pow(max(0.0, facing), 24.0) * 0.28;
}
void main() {
  vec4 here = texture(field, at);
  vec2 dx = vec2(1.5 * texel.x, 0.0);
  vec2 dy = vec2(0.0, 1.5 * texel.y);
  vec4 east = texture(field, at + dx), west = texture(field, at - dx);
  vec4 north = texture(field, at + dy), south = texture(field, at - dy);
  bool viscous = here.a > max(here.r, here.b);
  bool goop = !viscous && here.b > here.r;
  vec4 mine = viscous ? vec4(0.0, 0.0, 0.0, 1.0) : goop ? vec4(0.0, 0.0, 1.0, 0.0) : vec4(1.0, 0.0, 0.0, 0.0);
  float density = dot(here, mine);
  vec2 slope = vec2(dome(dot(east, mine)) - dome(dot(west, mine)), dome(dot(north, mine)) - dome(dot(south, mine)));
  float blur = max(fwidth(density), 0.02);
  float alpha = smoothstep(SURFACE - blur, SURFACE + blur, density);
  float fast = here.g / max(here.r, 0.05) * ${FASTEST.toFixed(1)};
  vec3 deep = ${palette.glsl(palette.WATER_DEEP)}, shallow = ${palette.glsl(palette.WATER_SHALLOW)}, crest = ${palette.glsl(palette.WATER_CREST)};
  if (goop) {
    deep = ${palette.glsl(palette.GOOP_DEEP)};
    shallow = ${palette.glsl(palette.GOOP_SHALLOW)};
    crest = vec3(1.0, 0.86, 0.92);
  } else if (viscous) {
    deep = ${palette.glsl(palette.LIQUID_DEEP)};
    shallow = ${palette.glsl(palette.LIQUID_SHALLOW)};
    crest = ${palette.glsl(palette.LIQUID_CREST)};
  }
  vec3 body = lit(deep, shallow, crest, density, slope, at.y);
  if (!goop && !viscous) body = mix(body, ${palette.glsl(palette.WATER_FAST)}, 0.5 * smoothstep(1.2, 3.8, fast));
  float glow = 0.22 * smoothstep(0.0, SURFACE, density) * (1.0 - alpha);
  color = vec4(body * alpha + vec3(0.02, 0.09, 0.2) * glow, alpha + glow);
}`;

/** Sand in 2D: every grain a small disc of its own shade. */
export const GRAIN_VERTEX = `${ATTRIBUTES}
${palette.SCALE_GLSL}
out vec3 shade;
void main() {
  gl_Position = ${ALONE} ? matrix * vec4(position, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
  gl_PointSize = pointSize;
  shade = mix(${palette.glsl(palette.SAND_DARK)}, ${palette.glsl(palette.SAND_LIGHT)}, grain) * (0.94 + 0.2 * speed);
  if (byQuantity) shade = onScale(quantity);
}`;

export const GRAIN_FRAGMENT = `${FRAGMENT}
in vec3 shade;
uniform float pointSize;
void main() {
  float edge = (1.0 - length(2.0 * gl_PointCoord - 1.0)) * pointSize * 0.5;
  float alpha = clamp(edge + 0.3, 0.0, 1.0);
  color = vec4(shade * alpha, alpha);
}`;

/** 3D: a soft shadow of every particle on the floor, the strongest cue for height. */
export const SHADOW_VERTEX = `${ATTRIBUTES}
uniform float floorHeight;
void main() {
  gl_Position = matrix * vec4(position.x, floorHeight, position.z, 1.0);
  gl_PointSize = 3.2 * pointSize / gl_Position.w;
}`;

export const SHADOW_FRAGMENT = `${FRAGMENT}
uniform float strength;
void main() {
  vec2 p = 2.0 * gl_PointCoord - 1.0;
  float q = max(0.0, 1.0 - dot(p, p));
  color = vec4(0.0, 0.0, 0.0, strength * q);
}`;

/** 3D: each grain of sand as a lit sphere with true depth. */
export const SPHERE_VERTEX = `${ATTRIBUTES}
${palette.SCALE_GLSL}
uniform float depthRadius;
out vec3 deep;
out vec3 bright;
out float haze;
out float reach;
void main() {
  gl_Position = ${ALONE} ? matrix * vec4(position, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
  gl_PointSize = max(1.5, pointSize / gl_Position.w);
  bright = mix(${palette.glsl(palette.SAND_DARK)}, ${palette.glsl(palette.SAND_LIGHT)}, 0.35 + 0.65 * grain);
  if (byQuantity) bright = onScale(quantity);
  deep = 0.42 * bright;
  haze = clamp(0.5 + 0.9 * gl_Position.z / gl_Position.w, 0.0, 1.0);
  reach = depthRadius / gl_Position.w;
}`;

export const SPHERE_FRAGMENT = `${FRAGMENT}
in vec3 deep;
in vec3 bright;
in float haze;
in float reach;
void main() {
  vec2 p = vec2(2.0, -2.0) * (gl_PointCoord - 0.5);
  float inside = 1.0 - dot(p, p);
  if (inside < 0.0) discard;
  vec3 normal = vec3(p, sqrt(inside));
  vec3 light = normalize(vec3(-0.4, 0.85, 0.55));
  float facing = max(0.0, dot(normal, light));
  float gleam = pow(max(0.0, dot(reflect(-light, normal), vec3(0.0, 0.0, 1.0))), 28.0);
  vec3 body = mix(deep, bright, 0.12 + 0.88 * facing) + 0.3 * gleam;
  color = vec4(mix(body, vec3(0.05, 0.09, 0.15), 0.5 * haze), 1.0);
  gl_FragDepth = gl_FragCoord.z - 0.5 * reach * normal.z;
}`;
