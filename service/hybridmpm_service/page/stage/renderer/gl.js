// Helpers for WebGL2: programs, uniforms and textures to draw into.

/** Link a program; return it with the locations of its uniforms by name. */
export function program(gl, vertex, fragment) {
  const linked = gl.createProgram();
  for (const [type, source] of [
    [gl.VERTEX_SHADER, vertex],
    [gl.FRAGMENT_SHADER, fragment],
  ]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(linked, shader);
  }
  gl.linkProgram(linked);
  if (!gl.getProgramParameter(linked, gl.LINK_STATUS) && !gl.isContextLost()) {
    const logs = gl.getAttachedShaders(linked).map((shader) => gl.getShaderInfoLog(shader));
    throw new Error(`the graphics driver refused a shader: ${logs.join(" ")} ${gl.getProgramInfoLog(linked)}`);
  }
  const uniforms = {};
  const count = gl.getProgramParameter(linked, gl.ACTIVE_UNIFORMS) ?? 0;
  for (let i = 0; i < count; i += 1) {
    const { name } = gl.getActiveUniform(linked, i);
    uniforms[name] = gl.getUniformLocation(linked, name);
  }
  return { linked, uniforms };
}

/**
 * A texture to draw into, with its framebuffer and, if asked for, a depth buffer.
 *
 * It holds half floats, which can be blended and filtered everywhere, or, if `precise`, full floats where allowed.
 */
export class FieldTarget {
  #gl;
  #filter;
  #precise;
  width = 0;
  height = 0;

  constructor(gl, { filter = gl.LINEAR, depth = false, precise = false } = {}) {
    this.#gl = gl;
    this.#filter = filter;
    this.#precise = precise && gl.getExtension("EXT_color_buffer_float") !== null;
    this.texture = gl.createTexture();
    this.framebuffer = gl.createFramebuffer();
    this.depth = depth ? gl.createRenderbuffer() : null;
  }

  /** Draw into this target from now on. */
  bind() {
    this.#gl.bindFramebuffer(this.#gl.FRAMEBUFFER, this.framebuffer);
    this.#gl.viewport(0, 0, this.width, this.height);
  }

  resize(width, height) {
    if (width === this.width && height === this.height) return;
    const gl = this.#gl;
    [this.width, this.height] = [width, height];
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    const [format, type] = this.#precise ? [gl.RGBA32F, gl.FLOAT] : [gl.RGBA16F, gl.HALF_FLOAT];
    gl.texImage2D(gl.TEXTURE_2D, 0, format, width, height, 0, gl.RGBA, type, null);
    for (const [name, value] of [
      [gl.TEXTURE_MIN_FILTER, this.#filter],
      [gl.TEXTURE_MAG_FILTER, this.#filter],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE],
      [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
    ]) {
      gl.texParameteri(gl.TEXTURE_2D, name, value);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.texture, 0);
    if (this.depth !== null) {
      gl.bindRenderbuffer(gl.RENDERBUFFER, this.depth);
      gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, this.depth);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }
}

/** Make a program current and set its uniforms: numbers, vectors, 4 x 4 matrices. Samplers stay at unit 0. */
export function useProgram(gl, { linked, uniforms }, values) {
  gl.useProgram(linked);
  for (const [name, value] of Object.entries(values)) {
    if (typeof value === "number") gl.uniform1f(uniforms[name], value);
    else if (value.length === 16) gl.uniformMatrix4fv(uniforms[name], false, value);
    else gl[`uniform${value.length}fv`](uniforms[name], value);
  }
}
