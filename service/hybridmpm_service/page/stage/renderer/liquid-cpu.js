// The liquid's surface without a graphics card: blobs added into a coarse field, thresholded and shaded.

import { FASTEST } from "../particles.js";
import { GOOP, LIQUID, SAND } from "../../frames.js";
import * as palette from "./palette.js";
import { INTERIOR, KERNEL_SPACINGS, SURFACE } from "./shaders.js";

const CELLS = 300 ** 2; // field cells on the stage

export class LiquidField {
  #columns = 0;
  #rows = 0;
  #water;
  #speed;
  #goop;
  #viscous;
  #image;
  #canvas = document.createElement("canvas");

  draw(context, view, scene, particles) {
    if (scene.types.every((type) => type === SAND)) return;
    const along = (side) => Math.round(side * Math.sqrt(CELLS / (view.width * view.height)));
    this.#resize(along(view.width), along(view.height));
    this.#add(view, scene, particles);
    this.#shade();
    this.#canvas.getContext("2d").putImageData(this.#image, 0, 0);
    context.imageSmoothingQuality = "high";
    context.drawImage(this.#canvas, 0, 0, view.width, view.height);
  }

  #resize(columns, rows) {
    if (columns === this.#columns && rows === this.#rows) return;
    [this.#columns, this.#rows] = [columns, rows];
    [this.#canvas.width, this.#canvas.height] = [columns, rows];
    [this.#water, this.#speed, this.#goop, this.#viscous] = [0, 0, 0, 0].map(() => new Float32Array(columns * rows));
    this.#image = new ImageData(columns, rows);
  }

  #add(view, scene, { positions, speeds }) {
    for (const field of [this.#water, this.#speed, this.#goop, this.#viscous]) field.fill(0);
    const cells = this.#columns / view.width;
    const radius = KERNEL_SPACINGS * scene.spacing * view.pixelsPerMetre * cells;
    for (let i = 0; i < scene.types.length; i += 1) {
      const type = scene.types[i];
      if (type === SAND) continue;
      const [px, py] = view.project([positions[2 * i] / 65535, positions[2 * i + 1] / 65535]);
      if (type === GOOP) this.#blob(this.#goop, null, px * cells, py * cells, radius, 0);
      else if (type === LIQUID) this.#blob(this.#viscous, null, px * cells, py * cells, radius, 0);
      else this.#blob(this.#water, this.#speed, px * cells, py * cells, radius, speeds[i] / 255);
    }
  }

  #blob(field, weighted, cx, cy, radius, weight) {
    const columns = this.#columns;
    const top = Math.max(0, Math.ceil(cy - radius - 0.5));
    const bottom = Math.min(this.#rows - 1, Math.floor(cy + radius - 0.5));
    const left = Math.max(0, Math.ceil(cx - radius - 0.5));
    const right = Math.min(columns - 1, Math.floor(cx + radius - 0.5));
    for (let row = top; row <= bottom; row += 1) {
      const down = ((row + 0.5 - cy) / radius) ** 2;
      for (let column = left; column <= right; column += 1) {
        const q = 1 - down - ((column + 0.5 - cx) / radius) ** 2;
        if (q <= 0) continue;
        field[row * columns + column] += q * q;
        if (weighted !== null) weighted[row * columns + column] += q * q * weight;
      }
    }
  }

  #shade() {
    const pixels = this.#image.data;
    pixels.fill(0);
    // Inside the outermost cells, so that every cell has four neighbours.
    const columns = this.#columns;
    for (let cell = columns; cell < columns * (this.#rows - 1); cell += 1) {
      let [field, colors] = [this.#water, WATER_COLORS];
      if (this.#goop[cell] > field[cell]) [field, colors] = [this.#goop, GOOP_COLORS];
      if (this.#viscous[cell] > field[cell]) [field, colors] = [this.#viscous, LIQUID_COLORS];
      const density = field[cell];
      if (density <= 0.5 * SURFACE) continue;
      const fast = colors !== WATER_COLORS ? 0 : (this.#speed[cell] / density) * FASTEST;
      paint(pixels, 4 * cell, {
        colors,
        depth: 0.75 * dome(density),
        crest: crestOf(field, cell, columns),
        foam: fast > 1.2 ? 0.5 * palette.smoothstep(1.2, 3.8, fast) : 0,
      });
      pixels[4 * cell + 3] = 255 * palette.smoothstep(0.5 * SURFACE, 1.4 * SURFACE, density);
    }
  }
}

const WATER_COLORS = {
  deep: palette.WATER_DEEP,
  shallow: palette.WATER_SHALLOW,
  crest: palette.WATER_CREST,
  fast: palette.WATER_FAST,
};
const GOOP_COLORS = {
  deep: palette.GOOP_DEEP,
  shallow: palette.GOOP_SHALLOW,
  crest: [255, 220, 235],
  fast: palette.GOOP_SHALLOW,
};
const LIQUID_COLORS = {
  deep: palette.LIQUID_DEEP,
  shallow: palette.LIQUID_SHALLOW,
  crest: palette.LIQUID_CREST,
  fast: palette.LIQUID_SHALLOW,
};

const dome = (density) => palette.smoothstep(0.6 * SURFACE, 0.62 * INTERIOR, density);

/** Mix one pixel channel by channel: new arrays for every pixel would cost most of the time. */
function paint(pixels, at, { colors, depth, crest, foam }) {
  for (let channel = 0; channel < 3; channel += 1) {
    let value = colors.shallow[channel] + (colors.deep[channel] - colors.shallow[channel]) * depth;
    value += (colors.crest[channel] - value) * crest;
    pixels[at + channel] = value + (colors.fast[channel] - value) * foam;
  }
}

/** How much a cell belongs to the bright rim: near the surface, most where it faces the light (upper left). */
function crestOf(field, cell, columns) {
  if (field[cell] >= 4.5 * SURFACE) return 0;
  const slopeX = dome(field[cell + 1]) - dome(field[cell - 1]);
  const slopeY = dome(field[cell - columns]) - dome(field[cell + columns]);
  const facing = Math.max(0, (2.2 * slopeX - 4 * slopeY + 0.55) / Math.hypot(5 * slopeX, 5 * slopeY, 1));
  const rim = 1 - palette.smoothstep(SURFACE, 4.5 * SURFACE, field[cell]);
  return Math.min(1, rim * (0.25 + 0.55 * facing));
}
