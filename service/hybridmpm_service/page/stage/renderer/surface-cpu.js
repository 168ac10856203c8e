// Liquids in 3D without a graphics card: what shaders-liquid3d.js does, on a smaller picture.

import { GOOP, LIQUID, SAND } from "../../frames.js";
import * as palette from "./palette.js";

const RADIUS_SPACINGS = 1.05; // larger than a particle, so that neighbours close to a surface
const SMOOTHING_SPACINGS = 2.4; // reach of the filter on the screen
const TAPS = 7; // to each side
const PASSES = 2;
const NONE = -Infinity;
const LIGHT = [-0.367, 0.78, 0.505]; // towards the lamp, of length 1
const HAZE = [13, 23, 38];

const COLORS = [
  [palette.WATER_DEEP, palette.WATER_SHALLOW, palette.WATER_CREST],
  [palette.GOOP_DEEP, palette.GOOP_SHALLOW, palette.WATER_CREST],
  [palette.LIQUID_DEEP, palette.LIQUID_SHALLOW, palette.LIQUID_CREST],
];

/** The liquid of a scene as a surface: depth and colour of each pixel of a square picture. */
export class SurfacePicture {
  #size = 0;
  #look = ""; // of the view for which `entries` holds
  #entries = null; // depth at which the line of sight enters the box; NONE beside it
  #depths = null;
  #other = null; // depths while they are smoothed
  #marks = null; // speed of the particle in front, and 256 more for jelly, 512 for viscous liquids

  /** Compute the surface of the liquid in a view, on a picture with sides of `size` pixels. */
  compute(view, { spacing, types, walls }, { positions, speeds }, size) {
    this.#resize(size);
    this.#enter(view, walls);
    this.#depths.fill(NONE);
    const axes = view.axes();
    const scale = (view.pixelsPerMetre * size) / view.width;
    const reach = RADIUS_SPACINGS * spacing;
    const [center, [right, up, near]] = [view.center, axes];
    for (let i = 0; i < types.length; i += 1) {
      if (types[i] === SAND) continue;
      const x = positions[3 * i] / 65535 - center[0];
      const y = positions[3 * i + 1] / 65535 - center[1];
      const z = positions[3 * i + 2] / 65535 - center[2];
      const depth = near[0] * x + near[1] * y + near[2] * z;
      const zoom = scale / (1 - view.perspective * depth);
      const px = size / 2 + (right[0] * x + right[1] * y + right[2] * z) * zoom;
      const py = size / 2 - (up[0] * x + up[1] * y + up[2] * z) * zoom;
      this.#splat(px, py, depth, reach, reach * zoom, speeds[i] + (types[i] === GOOP ? 256 : types[i] === LIQUID ? 512 : 0));
    }
    this.#smooth(Math.max(1, Math.round((SMOOTHING_SPACINGS * spacing * scale) / TAPS)), 2.5 * spacing);
  }

  #resize(size) {
    if (size === this.#size) return;
    this.#size = size;
    this.#look = "";
    [this.#entries, this.#depths, this.#other] = [0, 0, 0].map(() => new Float32Array(size * size));
    this.#marks = new Uint16Array(size * size);
  }

  /** Where lines of sight enter the box: spheres reach past the walls, and are cut off there. */
  #enter(view, { lower, upper }) {
    const look = [...Object.values(view.look), ...view.center].join();
    if (look === this.#look) return;
    this.#look = look;
    const size = this.#size;
    const [right, up, near] = view.axes();
    const metres = view.width / view.pixelsPerMetre;
    for (let row = 0; row < size; row += 1) {
      for (let column = 0; column < size; column += 1) {
        const [sx, sy] = [metres * ((column + 0.5) / size - 0.5), metres * (0.5 - (row + 0.5) / size)];
        let [entry, exit] = [Infinity, NONE];
        for (let axis = 0; axis < 3; axis += 1) {
          const aside = right[axis] * sx + up[axis] * sy;
          const along = near[axis] - view.perspective * aside || 1e-9;
          const a = (lower[axis] - view.center[axis] - aside) / along;
          const b = (upper[axis] - view.center[axis] - aside) / along;
          entry = Math.min(entry, Math.max(a, b));
          exit = Math.max(exit, Math.min(a, b));
        }
        this.#entries[row * size + column] = entry > exit ? entry : NONE;
      }
    }
  }

  #splat(px, py, depth, reach, radius, mark) {
    const size = this.#size;
    const [depths, entries, marks] = [this.#depths, this.#entries, this.#marks];
    const [left, last] = [Math.max(0, Math.ceil(px - radius)), Math.min(size - 1, Math.floor(px + radius))];
    const [top, bottom] = [Math.max(0, Math.ceil(py - radius)), Math.min(size - 1, Math.floor(py + radius))];
    for (let y = top; y <= bottom; y += 1) {
      const dy = (y - py) / radius;
      for (let x = left; x <= last; x += 1) {
        const dx = (x - px) / radius;
        const inside = 1 - dx * dx - dy * dy;
        if (inside < 0) continue;
        const at = y * size + x;
        const front = Math.min(depth + reach * Math.sqrt(inside), entries[at]);
        if (front <= depths[at]) continue;
        depths[at] = front;
        marks[at] = mark;
      }
    }
  }

  #smooth(step, range) {
    for (let pass = 0; pass < PASSES; pass += 1) {
      this.#smoothAlong(step, range);
      this.#smoothAlong(step * this.#size, range);
    }
  }

  /** One direction of the smoothing; across a silhouette (a jump in depth) nothing is mixed. */
  #smoothAlong(stride, range) {
    const [from, to] = [this.#depths, this.#other];
    for (let at = 0; at < from.length; at += 1) {
      const here = from[at];
      if (here === NONE) {
        to[at] = NONE;
        continue;
      }
      let [sum, total, covered] = [here, 1, 0];
      for (let i = -TAPS; i <= TAPS; i += 1) {
        const other = from[at + i * stride];
        if (i === 0 || other === undefined || other === NONE) continue;
        const jump = (other - here) / range;
        const same = 1 - jump * jump;
        if (same <= 0) continue;
        covered += same;
        const weight = same * same * FADES[i + TAPS];
        sum += weight * other;
        total += weight;
      }
      // Single drops have little around them: they stay round instead of becoming flat discs.
      const part = palette.smoothstep(0.45, 0.7, covered / (2 * TAPS));
      to[at] = here + part * (sum / total - here);
    }
    [this.#depths, this.#other] = [to, from];
  }

  /** Light the pixels of the surface that nothing hides, `nearest` being the depths of all else, as packed RGBA. */
  light(view, pixels, nearest) {
    const [size, depths, marks] = [this.#size, this.#depths, this.#marks];
    const metres = view.width / view.pixelsPerMetre / size;
    const slope = (ahead, behind, depth) => {
      const [forward, backward] = [ahead - depth, depth - behind];
      // The smaller difference: the other one may reach across a silhouette.
      return Math.abs(forward) < Math.abs(backward) ? forward : backward;
    };
    for (let at = size + 1; at < depths.length - size - 1; at += 1) {
      const depth = depths[at];
      if (depth === NONE || depth < nearest[at]) continue;
      const dx = slope(depths[at + 1], depths[at - 1], depth);
      const dy = slope(depths[at - size], depths[at + size], depth);
      const dz = metres * (1 - view.perspective * depth);
      const long = Number.isFinite(dx + dy) ? Math.hypot(dx, dy, dz) : Infinity;
      const [nx, ny, nz] = long === Infinity ? [0, 0, 1] : [-dx / long, -dy / long, dz / long];
      const toLight = nx * LIGHT[0] + ny * LIGHT[1] + nz * LIGHT[2];
      const facing = Math.max(0, toLight);
      const gleam = 0.28 * 255 * Math.max(0, 2 * toLight * nz - LIGHT[2]) ** 40;
      const kind = marks[at] >> 8; // 0 water, 1 jelly, 2 viscous liquid
      const fast = kind > 0 ? 0 : 0.55 * palette.smoothstep(0.3, 0.95, (marks[at] & 255) / 255);
      const grazing = 0.38 * (1 - nz) ** 3;
      const haze = Math.min(0.5, Math.max(0, 0.32 - 0.62 * depth));
      const [deep, bright, crest] = COLORS[kind];
      let packed = 255;
      for (let channel = 2; channel >= 0; channel -= 1) {
        let value = deep[channel] + (bright[channel] - deep[channel]) * (0.1 + 0.95 * facing);
        value += fast * (palette.WATER_FAST[channel] - value);
        value += grazing * (crest[channel] - value) + gleam;
        value += haze * (HAZE[channel] - value);
        packed = packed * 256 + Math.min(255, Math.max(0, Math.round(value)));
      }
      pixels[at] = packed;
    }
  }
}

const FADES = Float64Array.from({ length: 2 * TAPS + 1 }, (_, i) => Math.exp(-((i - TAPS) ** 2) / 20));
