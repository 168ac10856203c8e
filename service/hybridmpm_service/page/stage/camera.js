// Views: where points of the world appear on the stage. Both views have the same surface: matrix (world -> clip space,
// column-major), project, unproject, pixelsPerMetre, settle, and aspect, width and height of the stage with its longer side.

const MARGIN = 0.035; // room around the walls [longest side of the world]
const WIDEST = 3; // most width over height of the stage: a longer channel has room above and below it
const HIGHEST = 2; // most height over width
export const DEPTH_SCALE = 0.6; // keeps every corner of [0, 1]^3 inside the clip volume, see OrbitView.matrix
const GLIDE_MS = 520;

const FRONT = { yaw: 0, pitch: 0, perspective: 0, zoom: 1 };
const CORNER = { yaw: -0.6, pitch: 0.34, perspective: 0.3, zoom: 0.66 };

const middleOf = ({ lower, upper }) => upper.map((value, axis) => (value + lower[axis]) / 2);
const sidesOf = ({ lower, upper }) => upper.map((value, axis) => value - lower[axis] + 2 * MARGIN);

/** The place of a picture on the screen. */
class View {
  width = 1; // of the stage [px]

  /** @param aspect width over height */
  constructor(center, aspect) {
    this.center = center;
    this.aspect = aspect;
  }

  get height() {
    return this.width / this.aspect;
  }

  /** The longer side [px]. */
  get size() {
    return Math.max(this.width, this.height);
  }

  /** The world's (x, y) under a pixel, in space of the front view. */
  unproject(px, py) {
    const scale = this.pixelsPerMetre;
    return [this.center[0] + (px - this.width / 2) / scale, this.center[1] - (py - this.height / 2) / scale];
  }
}

/** A 2D scene, y up, the walls filling the stage, which is as wide and high as they are, within limits. */
export class FlatView extends View {
  constructor(walls) {
    const [across, up] = sidesOf(walls);
    super(middleOf(walls), Math.min(WIDEST, Math.max(1 / HIGHEST, across / up)));
    this.extent = Math.max(across, up * this.aspect);
  }

  get pixelsPerMetre() {
    return this.width / this.extent;
  }

  matrix() {
    const [kx, ky] = [2 / this.extent, (2 * this.aspect) / this.extent];
    const [cx, cy] = this.center;
    return new Float32Array([kx, 0, 0, 0, 0, ky, 0, 0, 0, 0, 1, 0, -kx * cx, -ky * cy, 0, 1]);
  }

  project([x, y]) {
    const scale = this.pixelsPerMetre;
    return [this.width / 2 + (x - this.center[0]) * scale, this.height / 2 - (y - this.center[1]) * scale, 0];
  }

  /** A flat view has one look. */
  get look() {
    return {};
  }

  /** Nothing moves by itself in a flat view. */
  settle() {
    return false;
  }
}

/**
 * A 3D scene on an orbit around its middle.
 *
 * The front view is orthographic (perspective 0), so that a stroke has the same world position at every depth.
 */
export class OrbitView extends View {
  #glide = null;

  constructor(walls) {
    super(middleOf(walls), 1);
    this.extent = Math.max(...sidesOf(walls));
    Object.assign(this, CORNER);
    this.home = { ...CORNER };
  }

  get pixelsPerMetre() {
    return (this.size * this.zoom) / this.extent;
  }

  /** Rows of the rotation: right, up, towards the viewer. */
  axes() {
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    return [
      [cy, 0, -sy],
      [-sp * sy, cp, -sp * cy],
      [cp * sy, sp, cp * cy],
    ];
  }

  matrix() {
    const [right, up, near] = this.axes();
    const k = (2 * this.zoom) / this.extent;
    const dot = (row) => row.reduce((sum, value, axis) => sum + value * this.center[axis], 0);
    const columns = [0, 1, 2].flatMap((axis) => [
      k * right[axis],
      k * up[axis],
      -DEPTH_SCALE * near[axis],
      -this.perspective * near[axis],
    ]);
    const last = [-k * dot(right), -k * dot(up), DEPTH_SCALE * dot(near), 1 + this.perspective * dot(near)];
    return new Float32Array([...columns, ...last]);
  }

  /** A point on the stage: x and y in pixels, and the depth, which is larger nearer to the viewer. */
  project(point) {
    const [right, up, near] = this.axes();
    const offset = point.map((value, axis) => value - this.center[axis]);
    const along = (row) => row[0] * offset[0] + row[1] * offset[1] + row[2] * offset[2];
    const depth = along(near);
    const scale = this.pixelsPerMetre / (1 - this.perspective * depth);
    return [this.width / 2 + along(right) * scale, this.height / 2 - along(up) * scale, depth];
  }

  /** From where the scene is seen. */
  get look() {
    return { yaw: this.yaw, pitch: this.pitch, perspective: this.perspective, zoom: this.zoom };
  }

  orbit(dx, dy) {
    this.#glide = null;
    this.yaw -= dx * 0.008;
    this.pitch = Math.min(1.45, Math.max(-0.35, this.pitch + dy * 0.008));
    this.#remember();
  }

  zoomBy(factor) {
    this.#glide = null;
    this.zoom = Math.min(2.5, Math.max(0.45, this.zoom * factor));
    this.#remember();
  }

  #remember() {
    this.home = this.look;
  }

  /** Go to the front view, where strokes are taken, or back to where the viewer was. */
  glideTo(front, now, animated) {
    // The way to the front leaves out whole turns.
    this.yaw = Math.atan2(Math.sin(this.yaw), Math.cos(this.yaw));
    this.#glide = { from: this.look, to: front ? FRONT : this.home, start: animated ? now : now - GLIDE_MS };
  }

  /** Move on with a glide (to its end, if `now` is Infinity); true while the picture changes. */
  settle(now) {
    if (this.#glide === null) return false;
    const { from, to, start } = this.#glide;
    const t = Math.min(1, Math.max(0, (now - start) / GLIDE_MS));
    const eased = t * t * (3 - 2 * t);
    for (const key of Object.keys(to)) this[key] = from[key] + (to[key] - from[key]) * eased;
    if (t === 1) this.#glide = null;
    return true;
  }
}
