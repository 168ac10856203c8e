// Rigid bodies in space by WebGL2: lit triangles with edges, and marks that show how they are turned.

import { BODY, BODY_EDGE, BODY_MARK, CORNER_NUMBERS } from "../../modules/bodies.js";
import { program, useProgram } from "./gl.js";
import { glsl } from "./palette.js";

const VERTEX = `#version 300 es
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 heights;
uniform mat4 matrix;
uniform vec3 center;
uniform vec4 turn; // the scalar first
uniform vec3 right;
uniform vec3 up;
uniform vec3 near;
out vec3 own;
out vec3 facing;
out vec3 edges;
vec3 turned(vec3 v) {
  vec3 across = 2.0 * cross(turn.yzw, v);
  return v + turn.x * across + cross(turn.yzw, across);
}
void main() {
  vec3 n = turned(normal);
  own = place;
  facing = vec3(dot(n, right), dot(n, up), dot(n, near));
  edges = heights;
  gl_Position = matrix * vec4(center + turned(place), 1.0);
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 own;
in vec3 facing;
in vec3 edges;
out vec4 color;
void main() {
  float light = 0.45 + 0.6 * max(0.0, dot(normalize(facing), normalize(vec3(-0.37, 0.78, 0.51))));
  vec3 body = own.x * own.y * own.z < 0.0 ? ${glsl(BODY_MARK)} : ${glsl(BODY)};
  vec3 away = edges / max(fwidth(edges), vec3(1e-6));
  float inside = smoothstep(0.7, 1.7, min(away.x, min(away.y, away.z)));
  color = vec4(mix(${glsl(BODY_EDGE)}, body * light, inside), 1.0);
}`;

export class BodiesProgram {
  #gl;
  #program;
  #arrays;

  /** @param surfaces triangles of each body, as trianglesOf gives them */
  constructor(gl, surfaces) {
    this.#gl = gl;
    this.#program = program(gl, VERTEX, FRAGMENT);
    this.#arrays = surfaces.map((numbers) => {
      const array = gl.createVertexArray();
      gl.bindVertexArray(array);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.STATIC_DRAW);
      for (const index of [0, 1, 2]) {
        gl.enableVertexAttribArray(index);
        gl.vertexAttribPointer(index, 3, gl.FLOAT, false, 4 * CORNER_NUMBERS, 12 * index);
      }
      return { array, count: numbers.length / CORNER_NUMBERS };
    });
  }

  draw(view, poses) {
    const gl = this.#gl;
    const [right, up, near] = view.axes();
    gl.disable(gl.BLEND);
    gl.enable(gl.DEPTH_TEST);
    poses.forEach(({ center, turn }, body) => {
      useProgram(gl, this.#program, { matrix: view.matrix(), center, turn, right, up, near });
      gl.bindVertexArray(this.#arrays[body].array);
      gl.drawArrays(gl.TRIANGLES, 0, this.#arrays[body].count);
    });
    gl.bindVertexArray(null);
  }
}
