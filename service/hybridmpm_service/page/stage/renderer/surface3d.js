// Liquids in 3D as one smooth surface: depth of the spheres, smoothed twice in each direction, then lit.

import { DEPTH_SCALE } from "../camera.js";
import { FieldTarget, program, useProgram } from "./gl.js";
import { DEPTH_FRAGMENT, DEPTH_VERTEX, SMOOTH_FRAGMENT, SURFACE_FRAGMENT } from "./shaders-liquid3d.js";
import { SCREEN_VERTEX } from "./shaders.js";

const RADIUS_SPACINGS = 1.05; // larger than a particle, so that neighbours close to a surface
const SMOOTHING_SPACINGS = 2.4; // reach of the filter on the screen
const TAPS = 7; // to each side, as in SMOOTH_FRAGMENT
const PASSES = 2;
const MAX_SIZE = 720; // texels of the smoothed picture: the filter is the expensive part

export class LiquidSurface {
  #gl;
  #programs;
  #front;
  #back;

  constructor(gl) {
    this.#gl = gl;
    this.#programs = {
      depth: program(gl, DEPTH_VERTEX, DEPTH_FRAGMENT),
      smooth: program(gl, SCREEN_VERTEX, SMOOTH_FRAGMENT),
      surface: program(gl, SCREEN_VERTEX, SURFACE_FRAGMENT),
    };
    // Depths must not be mixed across silhouettes (no linear filtering), and half floats would show as facets.
    this.#front = new FieldTarget(gl, { filter: gl.NEAREST, precise: true, depth: true });
    this.#back = new FieldTarget(gl, { filter: gl.NEAREST, precise: true });
  }

  /**
   * @param scene {spacing [m], walls}
   * @param canvasSize size of the canvas [pixels]
   * @param drawPoints issues the draw call of all particles
   */
  draw(view, { spacing, walls }, canvasSize, drawPoints) {
    const gl = this.#gl;
    const size = Math.min(canvasSize, MAX_SIZE);
    const texelsPerMetre = (view.pixelsPerMetre * size) / view.width;
    this.#front.resize(size, size);
    this.#back.resize(size, size);

    gl.disable(gl.BLEND);
    gl.enable(gl.DEPTH_TEST);
    this.#front.bind();
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const [right, up, near] = view.axes();
    const offset = near.reduce((sum, value, axis) => sum - value * view.center[axis], 0);
    useProgram(gl, this.#programs.depth, {
      matrix: view.matrix(),
      near: [...near, offset],
      pointSize: 2 * RADIUS_SPACINGS * spacing * texelsPerMetre,
      radius: RADIUS_SPACINGS * spacing,
      size,
      metres: size / texelsPerMetre,
      perspective: view.perspective,
      right,
      up,
      towards: near,
      center: view.center,
      lower: walls.lower,
      upper: walls.upper,
    });
    drawPoints();

    gl.disable(gl.DEPTH_TEST);
    this.#smooth(size, (SMOOTHING_SPACINGS * spacing * texelsPerMetre) / TAPS, spacing);

    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvasSize, canvasSize);
    gl.enable(gl.DEPTH_TEST);
    useProgram(gl, this.#programs.surface, {
      texel: [1 / size, 1 / size],
      metresPerTexel: 1 / texelsPerMetre,
      depthScale: DEPTH_SCALE,
      perspective: view.perspective,
    });
    gl.bindTexture(gl.TEXTURE_2D, this.#front.texture);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  #smooth(size, texelsPerTap, spacing) {
    const gl = this.#gl;
    const step = Math.max(1, texelsPerTap) / size;
    for (let pass = 0; pass < PASSES; pass += 1) {
      for (const [source, target, along] of [
        [this.#front, this.#back, [step, 0]],
        [this.#back, this.#front, [0, step]],
      ]) {
        target.bind();
        useProgram(gl, this.#programs.smooth, { along, range: 2.5 * spacing });
        gl.bindTexture(gl.TEXTURE_2D, source.texture);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
      }
    }
  }
}
