// The rigid bodies of a scene on the stage. Loaded where a scene has some.

import { bodyAt, drawFlatBody, placeOf, poseAt, trianglesOf } from "../modules/bodies.js";
import { HAND_COLOR } from "./drawing.js";
import { trace } from "./lines.js";
import { fillTriangles } from "./renderer/bodies-cpu.js";
import { BodiesProgram } from "./renderer/bodies-gl.js";

export class Bodies {
  #solids; // in the lengths of the picture
  #dim;
  #length;
  #surfaces; // triangles of each, in space
  #poses = [];
  #program = null; // of WebGL; null before the first picture, and after its context was lost

  /** @param solids as the hello message has them, in lengths of the picture; @param length longest side of the world [m] */
  constructor(solids, dim, length) {
    [this.#solids, this.#dim, this.#length] = [solids, dim, length];
    this.#surfaces = dim === 3 ? solids.map(trianglesOf) : [];
  }

  /** Take the places in a frame. */
  show({ poses }) {
    if (poses === null) return;
    this.#poses = this.#solids.map((_, body) => {
      const { center, turn } = poseAt(poses, body, this.#dim);
      return { center: center.map((x) => x / this.#length), turn };
    });
  }

  /** Draw those of a flat scene. */
  drawFlat(context, view) {
    this.#poses.forEach((pose, body) => {
      drawFlatBody(context, (point) => view.project(point), view.pixelsPerMetre, this.#solids[body], pose);
    });
  }

  /** The foremost body under a point of the front view: {body, grip, point}; null where there is none. */
  at(point) {
    return bodyAt(this.#solids, this.#poses, point);
  }

  /** Draw the hand that holds a body at `grip`: a line from there to the hand. */
  drawGrip(context, view, { body, grip, point }) {
    if (this.#poses[body] === undefined) return; // before the first frame
    const [[x, y], [toX, toY]] = [placeOf(grip, this.#poses[body]), point].map((end) => view.project(end));
    context.save();
    context.lineCap = "round";
    for (const [color, width] of [
      ["rgb(8 12 18 / 0.7)", 5],
      [HAND_COLOR, 2],
    ]) {
      [context.strokeStyle, context.lineWidth] = [color, width];
      trace(context, [
        [x, y],
        [toX, toY],
      ]);
      context.stroke();
    }
    context.fillStyle = HAND_COLOR;
    context.beginPath();
    context.arc(x, y, 4, 0, 2 * Math.PI);
    context.fill();
    context.beginPath();
    context.arc(toX, toY, 8, 0, 2 * Math.PI);
    context.stroke();
    context.restore();
  }

  /** Draw those in space by WebGL, with their depth. */
  drawGl(gl, view) {
    this.#program ??= new BodiesProgram(gl, this.#surfaces);
    this.#program.draw(view, this.#poses);
  }

  /** The context of WebGL was lost. */
  forget() {
    this.#program = null;
  }

  /** Draw those in space into a square picture of packed pixels with depths. */
  fill(view, picture) {
    this.#poses.forEach((pose, body) => fillTriangles(view, picture, this.#surfaces[body], pose));
  }
}
