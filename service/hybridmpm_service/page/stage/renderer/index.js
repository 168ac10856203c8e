// The choice of the renderer: WebGL2 where a graphics card runs it, else Canvas2D, or the one that is asked for.

import { CanvasRenderer } from "./canvas2d.js";
import { WebglRenderer } from "./webgl2.js";

/**
 * Make a renderer for a canvas; return {renderer, canvas}. A canvas that once had a WebGL context cannot get
 * one of another kind, so Canvas2D comes with a new element in its place.
 *
 * @param wanted "webgl2" or "canvas2d"; anything else leaves the choice to the machine
 */
export function createRenderer(canvas, wanted) {
  if (wanted !== "canvas2d") {
    const renderer = WebglRenderer.create(canvas, wanted === "webgl2");
    if (renderer !== null) return { renderer, canvas };
  }
  const fresh = canvas.cloneNode();
  canvas.replaceWith(fresh);
  return { renderer: CanvasRenderer.create(fresh), canvas: fresh };
}
