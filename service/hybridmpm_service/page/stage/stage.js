// The picture: three canvases on top of each other, which are drawn again when something has changed.

import { RADIUS } from "../sketch/hand.js";
import { FlatView, OrbitView } from "./camera.js";
import { predicted } from "../sketch/prediction.js";
import {
  drawCursor,
  drawFittedEllipse,
  drawGhostHand,
  drawGoal,
  drawGuess,
  drawHand,
  drawPrediction,
  drawSketch,
  drawStroke,
} from "./drawing.js";
import { drawForces } from "./forces.js";
import { SpeedEstimate } from "./particles.js";
import { densityOf, pressureOf, QUANTITIES } from "./quantities.js";
import { createRenderer } from "./renderer/index.js";
import { backdropMoves, drawBackdrop, drawForeground } from "./scenery.js";

const MAX_PIXEL_RATIO = 2; // beyond this the eye gains nothing and phones get warm
const GROUND = "#0a0f16"; // behind the picture
const TAP_REACH = 0.02; // distance from a tap within which a particle is hit [m]
const DOT_SPEED = 0.03; // px/ms at which the dots of a prediction walk

let rigid = null; // the part for rigid bodies, once a scene has needed it

export class Stage {
  highest = null; // what the upper end of the scale of colours stands for; null where there is none
  view = new FlatView({ lower: [0.1, 0.1], upper: [0.9, 0.9] });
  #scene = { dim: 2, walls: { lower: [0.1, 0.1], upper: [0.9, 0.9] }, obstacles: [] };
  #types = null; // types of the particles; null where each frame has its own
  #spacing = 0.01; // distance of neighbouring particles at rest [m]
  #length = 1; // longest side of the world [m]
  #fit;
  #canvases;
  #renderer;
  #bodies = null; // rigid ones; null without, and until their part is loaded
  #speeds = new SpeedEstimate();
  #quantity = "material"; // name of what the particles are coloured by
  #pressure = null; // the newest answer of the server; null where nobody asks
  frame = null; // the frame that is shown
  #described = false; // whether the renderer has the particles
  #time = 0; // simulated time of the frame that is shown [s]
  #shown; // {steering, hand, presenter, seen, forces}: what is drawn over the particles
  #centroid = null; // centre of mass of the fluid
  #cursor = null; // cursor of the keyboard [px]; null while it has none
  #stale = false; // something has changed since the last drawing
  #backdropStale = true;

  /**
   * @param canvases {backdrop, particles, overlay}, the layers from behind
   * @param shown {steering, hand, presenter, seen, forces}: what is drawn over the particles
   * @param wantedRenderer as for createRenderer
   * @param fit(aspect) -> width of a picture with this aspect [px]
   */
  constructor(canvases, shown, wantedRenderer, fit) {
    this.#shown = shown;
    this.#fit = fit;
    const { renderer, canvas } = createRenderer(canvases.particles, wantedRenderer);
    this.#renderer = renderer;
    this.#canvases = { ...canvases, particles: canvas };
    this.resize();
  }

  get rendererKind() {
    return this.#renderer.kind;
  }

  /** @param length longest side of the world [m], in which the lengths of the scene and the spacing are given */
  setScene(scene, types, spacing, length = 1) {
    this.#scene = scene;
    this.#types = types;
    this.#spacing = spacing;
    this.#length = length;
    this.#speeds = new SpeedEstimate(length);
    this.#described = false;
    this.#time = 0;
    this.frame = null;
    this.#pressure = null;
    this.#takeBodies(scene);
    this.view = scene.dim === 2 ? new FlatView(scene.walls) : new OrbitView(scene.walls);
    this.resize();
  }

  /** Prepare for the rigid bodies of the scene. */
  async #takeBodies(scene) {
    this.#bodies = this.#renderer.bodies = null;
    if ((scene.solids ?? []).length === 0) return;
    rigid ?? (rigid = await import("./rigid.js"));
    if (this.#scene !== scene) return;
    this.#bodies = this.#renderer.bodies = new rigid.Bodies(scene.solids, scene.dim, this.#length);
    if (this.frame !== null) this.#bodies.show(this.frame);
    this.invalidate();
  }

  /** What `setScene` was called with last. */
  get setting() {
    return [this.#scene, this.#types, this.#spacing, this.#length];
  }

  /** All that the picture shows, for another stage of the same setting; null before the first frame. */
  get moment() {
    if (this.frame === null) return null;
    const shown = Object.entries(this.#shown).map(([name, part]) => [name, { ...part }]);
    return {
      frame: this.frame,
      speeds: this.#speeds.bytes,
      quantity: this.#quantity,
      pressure: this.#pressure,
      centroid: this.#centroid,
      look: this.view.look,
      shown: Object.fromEntries(shown),
    };
  }

  /** Show a moment of another stage. */
  recall({ frame, speeds, quantity, pressure, centroid, look, shown }) {
    [this.#quantity, this.#pressure, this.#centroid, this.#shown] = [quantity, pressure, centroid, shown];
    Object.assign(this.view, look);
    this.#speeds.bytes = speeds;
    this.#describe(frame);
    this.#updateParticles();
    this.invalidateView();
  }

  /** Show a decoded frame from now on. */
  show(frame) {
    const { dim } = frame;
    const types = frame.types ?? this.#types;
    if (frame.count !== types?.length || dim !== this.#scene.dim) return;
    this.#speeds.update(frame);
    this.#describe(frame);
    if (backdropMoves(this.#scene)) this.#backdropStale = true;
    this.#updateParticles();
  }

  #describe(frame) {
    const { dim, ids } = frame;
    if (!this.#described || ids !== null) {
      const types = frame.types ?? this.#types;
      this.#renderer.setScene({ dim, types, ids, spacing: this.#spacing, walls: this.#scene.walls });
      this.#described = true;
    }
    this.#time = frame.time;
    this.frame = frame;
    this.#bodies?.show(frame);
  }

  #updateParticles() {
    if (this.frame === null) return;
    this.#renderer.update(this.frame.positions, this.#speeds.bytes, this.#quantities());
    this.invalidate();
  }

  /** The bytes that the particles are coloured by; null for the look of their material. */
  #quantities() {
    switch (this.#quantity) {
      case "speed":
        return this.#speeds.bytes;
      case "density":
        return densityOf(this.frame, this.#spacing).bytes;
      case "pressure": {
        if (this.#pressure === null) return null;
        const { bytes, most } = pressureOf(this.frame, this.#pressure);
        this.highest = most;
        return bytes;
      }
      default:
        return null;
    }
  }

  /** Colour the particles by a quantity, one of QUANTITIES, or by "material" from now on. */
  colourBy(quantity) {
    this.#quantity = quantity;
    this.highest = QUANTITIES[quantity]?.most ?? null;
    this.#updateParticles();
  }

  /** Show pressures, as the service answers them, from now on; null where they are not known. */
  showPressure(field) {
    this.#pressure = field;
    this.#updateParticles();
  }

  /** Volume of the matter that is shown [m^dim]; null where nothing is. */
  get volume() {
    return this.frame === null ? null : densityOf(this.frame, this.#spacing).volume;
  }

  /** Number and type of the particle under a point of the front view, the foremost of those; null where there is none. */
  particleAt([x, y]) {
    if (this.frame === null) return null;
    const { positions, count, dim, ids } = this.frame;
    const reach = Math.max(TAP_REACH, this.#spacing) ** 2;
    let [found, best] = [-1, Infinity];
    for (let i = 0; i < count; i += 1) {
      const [dx, dy] = [positions[i * dim] / 65535 - x, positions[i * dim + 1] / 65535 - y];
      const away = dx * dx + dy * dy;
      const rank = dim === 3 ? -positions[i * dim + 2] : away;
      if (away <= reach && rank < best) [found, best] = [i, rank];
    }
    if (found < 0) return null;
    return { particle: ids === null ? found : ids[found], type: (this.frame.types ?? this.#types)[found] };
  }

  /** The foremost rigid body under a point of the front view: {body, grip, point}; null where there is none. */
  bodyAt(point) {
    return this.#bodies?.at(point) ?? null;
  }

  /** Begin predictions at this centre of mass from now on; null where there is no particle. */
  showCentroid(centroid) {
    this.#centroid = centroid;
  }

  /** Show the cursor of the keyboard at a place [px]; null takes it away. */
  showCursor(at) {
    this.#cursor = at;
    this.invalidate();
  }

  /** Draw again at the next opportunity. */
  invalidate() {
    this.#stale = true;
  }

  /** The camera moved: everything behind the particles has to be drawn again as well. */
  invalidateView() {
    this.#backdropStale = true;
    this.invalidate();
  }

  /** Take the size that the picture has now. */
  resize() {
    const width = this.#fit(this.view.aspect);
    if (width === 0) return;
    this.view.width = width;
    const pixels = (side) => Math.round(side * Math.min(window.devicePixelRatio, MAX_PIXEL_RATIO));
    const [across, down] = [pixels(width), pixels(this.view.height)];
    for (const canvas of Object.values(this.#canvases)) {
      if (canvas.width === across && canvas.height === down) continue;
      [canvas.width, canvas.height] = [across, down];
    }
    this.invalidateView();
  }

  /** Draw if something has changed; return whether it has. */
  draw(now) {
    if (this.view.settle(now)) this.invalidateView();
    if (this.#shown.steering.phase === "planning") this.invalidate();
    if (!this.#stale) return false;
    this.#stale = false;
    if (this.#backdropStale) {
      this.#backdropStale = false;
      drawBackdrop(this.#clear(this.#canvases.backdrop), this.view, this.#scene, this.#time);
    }
    this.#renderer.draw(this.view);
    this.#drawOverlay(now);
    return true;
  }

  /** Paint the picture as it is shown onto a canvas, which takes its size, of even numbers as films need them. */
  paintOn(canvas) {
    // What WebGL has drawn can be read only before the browser shows it.
    this.#renderer.draw(this.view);
    const { backdrop, particles, overlay } = this.#canvases;
    const [width, height] = [overlay.width, overlay.height].map((side) => 2 * Math.ceil(side / 2));
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    const context = canvas.getContext("2d");
    context.fillStyle = GROUND;
    context.fillRect(0, 0, width, height);
    for (const layer of [backdrop, particles, overlay]) context.drawImage(layer, 0, 0, width, height);
  }

  #clear(canvas) {
    const context = canvas.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.scale(canvas.width / this.view.width, canvas.height / this.view.height);
    return context;
  }

  #drawOverlay(now) {
    const context = this.#clear(this.#canvases.overlay);
    const { steering, hand, presenter, seen, forces } = this.#shown;
    drawForeground(context, this.view, this.#scene, this.#time, this.#bodies);
    if (forces.latest !== null) drawForces(context, this.view, forces.latest);
    if (steering.sketch !== null) this.#drawSteering(context, steering, now);
    else if (presenter.ghost !== null) this.#drawGhost(context, presenter.ghost);
    else this.#drawSeen(context, seen);
    if (hand.point !== null) this.#drawHand(context, { radius: RADIUS, ...hand.held, point: hand.point });
    else if (seen.hand !== null) this.#drawHand(context, seen.hand);
    if (this.#cursor !== null) drawCursor(context, this.#cursor);
  }

  #drawHand(context, { body, grip, point, radius }) {
    if (body === undefined) drawHand(context, this.view, point, radius);
    else this.#bodies?.drawGrip(context, this.view, { body, grip, point });
  }

  #drawSteering(context, { sketch, plan, phase }, now) {
    drawSketch(context, this.view, this.#scene, sketch, plan === null ? 1 : 0.55);
    if (plan !== null) {
      drawGoal(context, this.view, plan.goal);
      return;
    }
    const goal = predicted(sketch, this.#centroid, this.#scene.walls);
    if (goal !== null) drawPrediction(context, this.view, goal, phase === "planning" ? DOT_SPEED * now : 0);
    if (phase === "planning") return;
    if (phase === "staged" && sketch.kind === "ellipse") drawFittedEllipse(context, this.view, this.#scene, sketch);
    drawGuess(context, this.view, this.#scene, sketch);
  }

  #drawSeen(context, { sketch, goal }) {
    if (sketch !== null) drawSketch(context, this.view, this.#scene, sketch, 0.55);
    if (goal !== null) drawGoal(context, this.view, goal);
  }

  #drawGhost(context, { sketch, hand }) {
    // An oval that is not closed yet is drawn as the line that it is.
    drawStroke(context, this.view, sketch);
    drawGhostHand(context, this.view, hand);
  }
}
