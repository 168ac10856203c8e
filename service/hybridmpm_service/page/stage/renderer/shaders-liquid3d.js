// GLSL of liquids in 3D: the depth of the spheres is smoothed until it is a surface, then lit
// (van der Laan et al. 2009, "Screen space fluid rendering with curvature flow", with a bilateral filter).

import { GOOP, LIQUID, SAND } from "../../frames.js";
import * as palette from "./palette.js";
import { ATTRIBUTES, FRAGMENT } from "./shaders.js";

/** Nearest sphere surface: R depth [m, towards the viewer], G speed, B 1 goop, -1 viscous liquid, A 1 where there is liquid. */
export const DEPTH_VERTEX = `${ATTRIBUTES}
uniform vec4 near;
uniform float radius;
out vec4 surface;
out float reach;
void main() {
  gl_Position = type == ${SAND}.0 ? vec4(2.0, 2.0, 2.0, 1.0) : matrix * vec4(position, 1.0);
  gl_PointSize = pointSize / gl_Position.w;
  surface = vec4(dot(near, vec4(position, 1.0)), speed, type == ${GOOP}.0 ? 1.0 : type == ${LIQUID}.0 ? -1.0 : 0.0, 1.0);
  reach = radius;
}`;

/** Spheres reach past the walls: they are cut off where the line of sight enters the box, so that faces there are flat. */
export const DEPTH_FRAGMENT = `${FRAGMENT}
in vec4 surface;
in float reach;
uniform float size;
uniform float metres;
uniform float perspective;
uniform vec3 right;
uniform vec3 up;
uniform vec3 towards;
uniform vec3 center;
uniform vec3 lower;
uniform vec3 upper;
void main() {
  vec2 p = 2.0 * gl_PointCoord - 1.0;
  float inside = 1.0 - dot(p, p);
  if (inside < 0.0) discard;
  vec2 at = metres * (gl_FragCoord.xy / size - 0.5);
  vec3 aside = right * at.x + up * at.y;
  // The points center + aside + depth * along lie on the line of sight.
  vec3 along = towards - perspective * aside;
  along += vec3(1e-6) * vec3(greaterThanEqual(along, vec3(0.0))) - vec3(5e-7);
  vec3 a = (lower - center - aside) / along;
  vec3 b = (upper - center - aside) / along;
  vec3 first = max(a, b);
  vec3 last = min(a, b);
  float entry = min(first.x, min(first.y, first.z));
  if (entry <= max(last.x, max(last.y, last.z))) discard;
  float depth = min(surface.r + reach * sqrt(inside), entry);
  color = vec4(depth, surface.gba);
  gl_FragDepth = 0.5 - 0.5 * depth;
}`;

/** One direction of the smoothing; across a silhouette (a jump in depth) nothing is mixed. */
export const SMOOTH_FRAGMENT = `${FRAGMENT}
in vec2 at;
uniform sampler2D field;
uniform vec2 along;
uniform float range;
void main() {
  vec4 here = texture(field, at);
  if (here.a < 0.5) {
    color = vec4(0.0);
    return;
  }
  vec4 sum = here;
  float total = 1.0;
  float covered = 0.0;
  for (int i = -7; i <= 7; i += 1) {
    if (i == 0) continue;
    vec4 other = texture(field, at + float(i) * along);
    float jump = (other.r - here.r) / range;
    float same = other.a * exp(-jump * jump);
    float weight = same * exp(-float(i * i) / 20.0);
    covered += same / 14.0;
    sum += weight * other;
    total += weight;
  }
  // Single drops have little around them: they stay round instead of becoming flat discs.
  color = vec4(mix(here.rgb, (sum / total).rgb, smoothstep(0.45, 0.7, covered)), 1.0);
}`;

/** The smoothed surface lit, with its depth, so that sand can lie in front of it or behind. */
export const SURFACE_FRAGMENT = `${FRAGMENT}
in vec2 at;
uniform sampler2D field;
uniform vec2 texel;
uniform float metresPerTexel;
uniform float depthScale;
uniform float perspective;
float slopeAlong(vec2 step, float depth) {
  vec4 ahead = texture(field, at + step);
  vec4 behind = texture(field, at - step);
  float forward = ahead.a > 0.5 ? ahead.r - depth : 1e3;
  float backward = behind.a > 0.5 ? depth - behind.r : 1e3;
  // The smaller difference: the other one may reach across a silhouette.
  return abs(forward) < abs(backward) ? forward : backward;
}
void main() {
  vec4 here = texture(field, at);
  if (here.a < 0.5) discard;
  float dx = slopeAlong(vec2(texel.x, 0.0), here.r);
  float dy = slopeAlong(vec2(0.0, texel.y), here.r);
  vec3 normal = normalize(vec3(-dx, -dy, metresPerTexel * (1.0 - perspective * here.r)));
  vec3 light = normalize(vec3(-0.4, 0.85, 0.55));
  float facing = max(0.0, dot(normal, light));
  float gleam = pow(max(0.0, dot(reflect(-light, normal), vec3(0.0, 0.0, 1.0))), 40.0);
  float grazing = pow(1.0 - max(0.0, normal.z), 3.0);
  bool goop = here.b > 0.5;
  bool viscous = here.b < -0.5;
  vec3 deep = goop ? ${palette.glsl(palette.GOOP_DEEP)} : viscous ? ${palette.glsl(palette.LIQUID_DEEP)} : ${palette.glsl(palette.WATER_DEEP)};
  vec3 bright = goop ? ${palette.glsl(palette.GOOP_SHALLOW)} : viscous ? ${palette.glsl(palette.LIQUID_SHALLOW)} : ${palette.glsl(palette.WATER_SHALLOW)};
  vec3 crest = viscous ? ${palette.glsl(palette.LIQUID_CREST)} : ${palette.glsl(palette.WATER_CREST)};
  vec3 body = mix(deep, bright, 0.1 + 0.95 * facing);
  if (!goop && !viscous) body = mix(body, ${palette.glsl(palette.WATER_FAST)}, 0.55 * smoothstep(0.3, 0.95, here.g));
  body = mix(body, crest, 0.38 * grazing) + 0.28 * gleam;
  float haze = clamp(0.32 - 0.62 * here.r, 0.0, 0.5);
  color = vec4(mix(body, vec3(0.05, 0.09, 0.15), haze), 1.0);
  gl_FragDepth = 0.5 - 0.5 * depthScale * here.r / (1.0 - perspective * here.r);
}`;
