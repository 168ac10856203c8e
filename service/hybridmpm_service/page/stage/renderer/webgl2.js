// Particles by WebGL2: liquids as a smooth surface, sand as grains (2D) or lit spheres (3D).

import { DEPTH_SCALE } from "../camera.js";
import { SAND } from "../../frames.js";
import { FieldTarget, program, useProgram } from "./gl.js";
import { grainShade, smoothstep } from "./palette.js";
import * as shaders from "./shaders.js";
import { LiquidSurface } from "./surface3d.js";

const GRAIN_SPACINGS = 1.5; // diameter of a grain of sand: grains overlap a little, so that a heap looks closed
const SPHERE_SPACINGS = 0.82; // radius of a sphere: neighbours overlap, so that the body looks closed
const FIELD_RESOLUTION = 0.5; // field texels per device pixel: the field is smooth, half is enough

/** Whether a program imitates the graphics card; not every browser counts that as a performance caveat. */
function isImitated(gl) {
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  const name = gl.getParameter(info === null ? gl.RENDERER : info.UNMASKED_RENDERER_WEBGL);
  return /swiftshader|llvmpipe|softpipe|software/i.test(name);
}

export class WebglRenderer {
  kind = "webgl2";
  bodies = null; // rigid ones, which a part of the stage draws
  #canvas;
  #gl;
  #programs;
  #field;
  #surface;
  #vertexArray;
  #buffers;
  #scene = null;
  #has = { liquid: false, sand: false };
  #pending = null;

  /**
   * Return a renderer; null where WebGL2 or drawing into half floats is missing. Unless `forced` it is also null
   * where the browser imitates a graphics card in software: Canvas2D is faster there.
   */
  static create(canvas, forced) {
    const gl = canvas.getContext("webgl2", {
      antialias: true,
      alpha: true,
      premultipliedAlpha: true,
      failIfMajorPerformanceCaveat: !forced,
    });
    if (gl === null || (!forced && isImitated(gl))) return null;
    const renderer = new WebglRenderer(canvas, gl);
    return renderer.#build() ? renderer : null;
  }

  constructor(canvas, gl) {
    this.#canvas = canvas;
    this.#gl = gl;
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => {
      this.#build();
      this.bodies?.forget();
      const particles = this.#pending;
      if (this.#scene !== null) this.setScene(this.#scene);
      this.#pending = particles;
    });
  }

  #build() {
    const gl = this.#gl;
    if (!gl.getExtension("EXT_color_buffer_half_float") && !gl.getExtension("EXT_color_buffer_float")) return false;
    this.#programs = {
      blob: program(gl, shaders.BLOB_VERTEX, shaders.BLOB_FRAGMENT),
      liquid: program(gl, shaders.SCREEN_VERTEX, shaders.LIQUID_FRAGMENT),
      grain: program(gl, shaders.GRAIN_VERTEX, shaders.GRAIN_FRAGMENT),
      shadow: program(gl, shaders.SHADOW_VERTEX, shaders.SHADOW_FRAGMENT),
      sphere: program(gl, shaders.SPHERE_VERTEX, shaders.SPHERE_FRAGMENT),
    };
    this.#field = new FieldTarget(gl);
    this.#surface = new LiquidSurface(gl);
    this.#vertexArray = gl.createVertexArray();
    this.#buffers = { positions: gl.createBuffer(), types: gl.createBuffer(), speeds: gl.createBuffer(), grains: gl.createBuffer(), quantities: gl.createBuffer() };
    return true;
  }

  /** @param scene {dim, types, ids (null if they are the indices), spacing [m], walls} */
  setScene(scene) {
    const gl = this.#gl;
    this.#scene = scene;
    this.#has = {
      liquid: scene.types.some((type) => type !== SAND),
      sand: scene.types.includes(SAND),
    };
    this.#pending = null;
    gl.bindVertexArray(this.#vertexArray);
    this.#attribute(0, this.#buffers.positions, scene.dim, gl.UNSIGNED_SHORT, true);
    this.#attribute(1, this.#buffers.types, 1, gl.UNSIGNED_BYTE, false);
    gl.bufferData(gl.ARRAY_BUFFER, scene.types, gl.STATIC_DRAW);
    this.#attribute(2, this.#buffers.speeds, 1, gl.UNSIGNED_BYTE, true);
    this.#attribute(4, this.#buffers.quantities, 1, gl.UNSIGNED_BYTE, true);
    gl.bufferData(gl.ARRAY_BUFFER, new Uint8Array(scene.types.length), gl.DYNAMIC_DRAW);
    this.#attribute(3, this.#buffers.grains, 1, gl.UNSIGNED_BYTE, true);
    gl.bufferData(gl.ARRAY_BUFFER, scene.types.map((_, i) => 256 * grainShade(scene, i)), gl.STATIC_DRAW);
  }

  #attribute(index, buffer, size, type, normalized) {
    const gl = this.#gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(index);
    gl.vertexAttribPointer(index, size, type, normalized, 0, 0);
  }

  /** @param quantities bytes that the particles are coloured by; null for the look of their material */
  update(positions, speeds, quantities) {
    this.#pending = { positions, speeds, quantities };
  }

  draw(view) {
    const gl = this.#gl;
    if (gl.isContextLost()) return;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, this.#canvas.width, this.#canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (this.#scene === null || this.#pending === null) return;
    gl.bindVertexArray(this.#vertexArray);
    for (const name of ["positions", "speeds", "quantities"]) {
      if (this.#pending[name] === null) continue;
      gl.bindBuffer(gl.ARRAY_BUFFER, this.#buffers[name]);
      gl.bufferData(gl.ARRAY_BUFFER, this.#pending[name], gl.DYNAMIC_DRAW);
    }
    const pixels = view.pixelsPerMetre * (this.#canvas.width / view.width) * this.#scene.spacing;
    if (this.#scene.dim === 2) this.#drawFlat(view.matrix(), pixels);
    else this.#drawSolid(view, pixels);
  }

  #points = () => this.#gl.drawArrays(this.#gl.POINTS, 0, this.#scene.types.length);

  #drawFlat(matrix, spacing) {
    const gl = this.#gl;
    gl.disable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    const byQuantity = this.#pending.quantities !== null;
    if (this.#has.liquid && !byQuantity) this.#drawLiquid(matrix, spacing);
    if (!this.#has.sand && !byQuantity) return;
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    useProgram(gl, this.#programs.grain, { byQuantity: Number(byQuantity), matrix, pointSize: Math.max(1.6, GRAIN_SPACINGS * spacing) });
    this.#points();
  }

  #drawLiquid(matrix, spacing) {
    const gl = this.#gl;
    const width = Math.max(64, Math.round(this.#canvas.width * FIELD_RESOLUTION));
    const height = Math.round((width * this.#canvas.height) / this.#canvas.width);
    this.#field.resize(width, height);
    this.#field.bind();
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.blendFunc(gl.ONE, gl.ONE);
    const pointSize = (2 * shaders.KERNEL_SPACINGS * spacing * width) / this.#canvas.width;
    useProgram(gl, this.#programs.blob, { matrix, pointSize });
    this.#points();

    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, this.#canvas.width, this.#canvas.height);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    useProgram(gl, this.#programs.liquid, { texel: [1 / width, 1 / height] });
    gl.bindTexture(gl.TEXTURE_2D, this.#field.texture);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  #drawSolid(view, spacing) {
    const gl = this.#gl;
    const matrix = view.matrix();
    gl.disable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    // The darkest shadow wins: adding them up would turn every body's shadow black.
    gl.blendEquation(gl.MAX);
    useProgram(gl, this.#programs.shadow, {
      matrix,
      pointSize: spacing,
      floorHeight: this.#scene.walls.lower[1],
      strength: 0.5 * smoothstep(0.02, 0.25, view.pitch), // none where the floor is seen from the edge
    });
    this.#points();
    gl.blendEquation(gl.FUNC_ADD);

    if (this.bodies !== null) {
      this.bodies.drawGl(gl, view);
      gl.bindVertexArray(this.#vertexArray);
    }
    const byQuantity = this.#pending.quantities !== null;
    if (this.#has.liquid && !byQuantity) this.#surface.draw(view, this.#scene, this.#canvas.width, this.#points);
    if (!this.#has.sand && !byQuantity) return;
    gl.disable(gl.BLEND);
    gl.enable(gl.DEPTH_TEST);
    useProgram(gl, this.#programs.sphere, {
      byQuantity: Number(byQuantity),
      matrix,
      pointSize: 2 * SPHERE_SPACINGS * spacing,
      depthRadius: SPHERE_SPACINGS * this.#scene.spacing * DEPTH_SCALE,
    });
    this.#points();
  }
}
