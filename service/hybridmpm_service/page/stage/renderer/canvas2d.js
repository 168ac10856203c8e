// Particles drawn by Canvas2D, where WebGL2 is missing: the same pictures, computed on the CPU.

import { SAND } from "../../frames.js";
import { LiquidField } from "./liquid-cpu.js";
import { css, grainShade, mix, onScale, SAND_DARK, SAND_LIGHT } from "./palette.js";
import { SpherePicture } from "./spheres-cpu.js";

const GRAIN_SHADES = 6;
const GRAIN_SPACINGS = 1.45; // side of a particle: neighbours overlap, also where the flow has drawn them apart
const SCALE_STEPS = 32; // colours of a quantity

export class CanvasRenderer {
  kind = "canvas2d";
  bodies = null; // rigid ones, which a part of the stage draws
  #context;
  #scene = null;
  #particles = null;
  #liquid = new LiquidField();
  #spheres = new SpherePicture();
  #grains = [];

  static create(canvas) {
    const context = canvas.getContext("2d");
    return context === null ? null : new CanvasRenderer(context);
  }

  constructor(context) {
    this.#context = context;
  }

  /** @param scene {dim, types, ids (null if they are the indices), spacing [m], walls} */
  setScene(scene) {
    this.#scene = scene;
    this.#particles = null;
    this.#grains = Array.from({ length: GRAIN_SHADES }, () => []);
    scene.types.forEach((type, i) => {
      if (type === SAND) this.#grains[Math.floor(grainShade(scene, i) * GRAIN_SHADES)].push(i);
    });
  }

  /** @param quantities bytes that the particles are coloured by; null for the look of their material */
  update(positions, speeds, quantities) {
    this.#particles = { positions, speeds, quantities };
  }

  draw(view) {
    const context = this.#context;
    const { width, height } = context.canvas;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, width, height);
    if (this.#scene === null || this.#particles === null) return;
    context.scale(width / view.width, height / view.height);
    if (this.#scene.dim === 3) {
      this.#spheres.draw(context, view, this.#scene, this.#particles, this.bodies);
      return;
    }
    if (this.#particles.quantities !== null) {
      this.#drawQuantities(view, this.#particles.quantities);
      return;
    }
    this.#liquid.draw(context, view, this.#scene, this.#particles);
    this.#drawGrains(view);
  }

  #drawQuantities(view, quantities) {
    const steps = Array.from({ length: SCALE_STEPS }, () => []);
    quantities.forEach((byte, i) => steps[Math.floor((byte / 256) * SCALE_STEPS)].push(i));
    steps.forEach((indices, step) => this.#drawSquares(view, indices, css(onScale(step / (SCALE_STEPS - 1)))));
  }

  #drawGrains(view) {
    this.#grains.forEach((indices, shade) => {
      this.#drawSquares(view, indices, css(mix(SAND_DARK, SAND_LIGHT, shade / (GRAIN_SHADES - 1))));
    });
  }

  #drawSquares(view, indices, color) {
    const { positions } = this.#particles;
    const side = GRAIN_SPACINGS * this.#scene.spacing * view.pixelsPerMetre;
    this.#context.fillStyle = color;
    for (const i of indices) {
      const [px, py] = view.project([positions[2 * i] / 65535, positions[2 * i + 1] / 65535]);
      this.#context.fillRect(px - side / 2, py - side / 2, side, side);
    }
  }
}
