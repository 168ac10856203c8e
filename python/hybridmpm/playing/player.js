// The page of a playing file: controls, camera and picture. The simulation runs in a worker.

const SUBSTANCES = { 3: [120, 130, 150], 5: [70, 150, 235], 6: [216, 168, 96], 7: [88, 176, 104], 0: [150, 125, 175] };
const SOLID = [112, 124, 146];
const GROUND = [10, 15, 22];
const MARK = "#f4f6f9";
const SKETCH = "#e5564f";
const LETTERS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;,=>?@^_`{|}~";
const TINTS = 64; // shades of a scale
const LAYERS = 2048; // of depth, in which particles are drawn
const SCALE = [[30, 60, 150], [40, 130, 220], [90, 210, 230], [250, 240, 140], [250, 150, 70]];
const UNITS = { speed: "m/s", pressure: "Pa", density: "of rest" };
const PICTURE = 30; // longest computation from one picture to the next [ms]
const HAND = { radius: 0.08, cap: 15 }; // m, g
const LIFTED = 0.3; // side of the square or cube of water that a hand can lift, over the shortest way between two walls
const GRASP = "#58b9ff";
const LIGHT = [-0.37, 0.78, 0.51]; // from where bodies are lit: right, up, near
const GRAIN = 0.4; // distance of the points that show bodies, over that of the points of obstacles
const MOST_GRAINS = 40_000;
const MARGIN = 0.04; // of the picture, around the walls
const DRAWN = { frames: 160, hold: 80, cap: 15 * 9.81 }; // until the fluid is there, for which it stays; m/s^2
const ELASTIC = 7; // type of particles
const APART = 0.008; // least distance of two points of a stroke, over the longest side of the world

const part = (id) => document.getElementById(id);
const picture = part("picture");
const pen = picture.getContext("2d");

// Orders to the worker.
const source = new Blob([part("worker").textContent], { type: "text/javascript" });
const worker = new Worker(URL.createObjectURL(source));
const waiting = new Map();
let orders = 0;
worker.onmessage = ({ data }) => {
  const { done, failed } = waiting.get(data.id);
  waiting.delete(data.id);
  if (data.error === undefined) done(data);
  else failed(new Error(data.error));
};

worker.onerror = ({ message }) => say(`The simulation could not be started: ${message}. Reload the page.`, true);

function ask(order, given = {}) {
  orders += 1;
  worker.postMessage({ id: orders, order, ...given });
  return new Promise((done, failed) => waiting.set(orders, { done, failed }));
}

/** Bytes that Python's base 85 has made text of, with a comma for `<`. */
function bytesOf(text) {
  const digits = new Uint8Array(128).fill(255);
  for (let i = 0; i < LETTERS.length; i += 1) digits[LETTERS.charCodeAt(i)] = i;
  const padding = (5 - (text.length % 5)) % 5;
  const bytes = new Uint8Array(((text.length + padding) / 5) * 4);
  const words = new DataView(bytes.buffer);
  for (let i = 0; i < text.length; i += 5) {
    let word = 0;
    for (let k = i; k < i + 5; k += 1) {
      const digit = k < text.length ? digits[text.charCodeAt(k)] : 84;
      if (!(digit < 85)) throw new SyntaxError("not a letter of base 85");
      word = 85 * word + digit;
    }
    words.setUint32((i / 5) * 4, word);
  }
  return bytes.slice(0, bytes.length - padding);
}

function stored(id) {
  return bytesOf(part(id).textContent.trim());
}

// State of the page.
let scene = null; // what the file says of itself
let dim = 2;
let frameDt = 0.0025;
let state = null; // latest state of the simulation
let playing = false;
let busy = false;
let owed = 0; // frames that real time is ahead
let last = 0; // time of the latest picture [ms]
let hand = null; // {point, velocity, time}, with {body, grip, depth} of one that holds a body
let turning = null;
let stroke = null; // points of what is being drawn
let drawn = null; // what was drawn last, as a sketch of the scene
let rates = []; // simulated over real time
let charts = []; // one for each probe
const camera = { yaw: 0.6, pitch: 0.35, distance: 1.7 };

function say(text, isError = false) {
  part("message").textContent = text;
  part("message").classList.toggle("error", isError);
  part("message").hidden = text === "";
}

/** What an error means to a visitor. */
function reason(error) {
  if (error instanceof RangeError) return "This device has no memory left for the picture: close other pages, and reload this one.";
  if (error instanceof SyntaxError) return "This file is damaged: get it once more.";
  return error.message;
}

// Picture.

/** Project a point to the picture: [x, y, depth] with the scale there [px/m]. */
function projection() {
  const [width, height] = [picture.width, picture.height];
  const middle = scene.lower.map((low, axis) => (low + scene.upper[axis]) / 2);
  const size = scene.lower.map((low, axis) => scene.upper[axis] - low);
  if (dim === 2) {
    const scale = (1 - 2 * MARGIN) * Math.min(width / size[0], height / size[1]);
    return (x, y) => [width / 2 + (x - middle[0]) * scale, height / 2 - (y - middle[1]) * scale, 0, scale];
  }
  const { longest, distance, focal, rows } = eye();
  const [right, up, near] = rows;
  return (x, y, z) => {
    const [a, b, c] = [x - middle[0], y - middle[1], z - middle[2]];
    const depth = distance - (near[0] * a + near[1] * b + near[2] * c);
    const scale = focal / depth;
    const across = right[0] * a + right[1] * b + right[2] * c;
    return [width / 2 + across * scale, height / 2 - (up[0] * a + up[1] * b + up[2] * c) * scale, depth / longest, scale];
  };
}

/** From where a scene in space is seen: directions to the right, upwards and to the eye, and its distance from the middle [m]. */
function eye() {
  const [cy, sy, cp, sp] = [Math.cos(camera.yaw), Math.sin(camera.yaw), Math.cos(camera.pitch), Math.sin(camera.pitch)];
  const longest = Math.hypot(...scene.lower.map((low, axis) => scene.upper[axis] - low));
  const rows = [[cy, 0, -sy], [-sp * sy, cp, -sp * cy], [cp * sy, sp, cp * cy]];
  return { longest, distance: camera.distance * longest, focal: 1.75 * Math.min(picture.width, picture.height), rows };
}

/** Where a rigid body is: {center, turn}, as bodies.js has them. */
function poseOf(body) {
  const [x, y, z, ...turn] = state.rigid.subarray(13 * body, 13 * body + 7);
  return dim === 2 ? { center: [x, y], turn: 2 * Math.atan2(turn[3], turn[0]) } : { center: [x, y, z], turn };
}

function ramp(share) {
  const at = Math.min(Math.max(share, 0), 1) * (SCALE.length - 1);
  const low = Math.min(Math.floor(at), SCALE.length - 2);
  return SCALE[low].map((one, i) => one + (SCALE[low + 1][i] - one) * (at - low));
}

/** Values that get the ends of the scale. */
function ends(wanted, values) {
  if (wanted === "density") return [0.9, 1.1];
  const sorted = values.slice().sort();
  const high = sorted[Math.floor(0.99 * (sorted.length - 1))] || 0;
  const step = 10 ** Math.floor(Math.log10(Math.max(high, 1e-3)));
  return [0, Math.ceil(high / step) * step];
}

function draw() {
  if (state === null) return;
  const ratio = Math.min(devicePixelRatio || 1, 2);
  const box = picture.getBoundingClientRect();
  const [width, height] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
  if (picture.width !== width || picture.height !== height) [picture.width, picture.height] = [width, height];
  const project = projection();
  const image = pen.createImageData(width, height);
  const pixels = new Uint32Array(image.data.buffer);
  pixels.fill(packed(GROUND, 1));
  const wanted = part("colour").value;
  const [low, high] = wanted === "material" ? [0, 2.5] : ends(wanted, state.values);
  part("scale").hidden = wanted === "material";
  if (wanted !== "material") {
    part("low").textContent = `${low} ${UNITS[wanted]}`;
    part("high").textContent = `${high} ${UNITS[wanted]}`;
  }
  const solids = scene.resting.concat(state.moved);
  const grains = scene.rigid.reduce((total, { grains: { length } }) => total + length, 0);
  const cloud = new Cloud(solids.reduce((total, solid) => total + solid.length / dim, 0) + grains + state.values.length);
  const add = (x, i, radius, tint, light = 1) => {
    const at = dim === 2 ? project(x[i], x[i + 1]) : project(x[i], x[i + 1], x[i + 2]);
    const shade = dim === 2 ? 1 : light * Math.min(1.25, Math.max(0.35, 1.9 - 0.42 * at[2]));
    cloud.add(at, Math.max(radius * at[3], 0.8), packed(tint, shade));
  };
  for (const solid of solids) {
    for (let i = 0; i < solid.length; i += dim) add(solid, i, 0.75 * scene.solidStep, SOLID);
  }
  if (dim === 3) addBodies(add);
  const tints = scene.types.map((type) => {
    const kind = SUBSTANCES[type] ?? SUBSTANCES[5];
    return Array.from({ length: TINTS }, (_, i) =>
      wanted === "material" ? kind.map((c) => c + (255 - c) * 0.55 * (i / (TINTS - 1))) : ramp(i / (TINTS - 1)),
    );
  });
  for (let k = 0; k < state.values.length; k += 1) {
    const share = (state.values[k] - low) / (high - low || 1);
    const tint = Math.round(Math.min(Math.max(share, 0), 1) * (TINTS - 1)) || 0;
    add(state.positions, k * dim, 0.75 * scene.spacing, tints[state.materials[k]][tint]);
  }
  cloud.draw(pixels, width, height);
  pen.putImageData(image, 0, 0);
  if (dim === 2) {
    scene.rigid.forEach((solid, body) => {
      const pose = poseOf(body);
      drawFlatBody(pen, ([a, b]) => project(a, b), project(...pose.center)[3], solid, pose);
    });
  }
  drawWalls(project);
  for (const { marks } of scene.probes) for (const mark of marks) drawMark(project, ratio, mark);
  for (const sketch of drawn === null ? scene.sketches : [drawn]) {
    if (state.frame >= sketch.first && state.frame < sketch.last) drawSketch(project, ratio, sketch);
  }
  if (stroke !== null) drawSketch(project, ratio, { lines: [stroke], isArrow: stroke.length > 1 && part("drag").value === "arrow" });
  if (hand !== null) drawHand(project, ratio);
}

/** Add the side of the rigid bodies in space that is seen, lit from above. */
function addBodies(add) {
  const { rows, distance } = eye();
  const from = scene.lower.map((low, axis) => (low + scene.upper[axis]) / 2 + distance * rows[2][axis]);
  const light = rows[0].map((_, axis) => LIGHT.reduce((sum, share, i) => sum + share * rows[i][axis], 0));
  const product = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  scene.rigid.forEach(({ grains, grain }, body) => {
    const pose = poseOf(body);
    // In the body's own frame nothing has to be turned.
    const [eyeThere, lightThere] = [turnedBack(from.map((x, axis) => x - pose.center[axis]), pose.turn), turnedBack(light, pose.turn)];
    const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => turned(axis, pose.turn));
    const place = [0, 0, 0];
    for (const { point, normal, colour } of grains) {
      if (product(normal, eyeThere) <= product(normal, point)) continue;
      for (let k = 0; k < 3; k += 1) place[k] = pose.center[k] + point[0] * axes[0][k] + point[1] * axes[1][k] + point[2] * axes[2][k];
      add(place, 0, 0.78 * grain, colour, 0.5 + 0.6 * Math.max(0, product(normal, lightThere)));
    }
  });
}

/** Spread points over the rigid bodies in space. */
function sow() {
  const area = (solid) => scene.solidStep ** 2 * pointsOf(solid, scene.solidStep).length;
  const whole = scene.rigid.reduce((sum, solid) => sum + area(solid), 0);
  const grain = Math.max(GRAIN * scene.solidStep, Math.sqrt(whole / MOST_GRAINS));
  for (const solid of scene.rigid) Object.assign(solid, { grain, grains: pointsOf(solid, grain) });
}

/** Discs, drawn from the farthest to the nearest. */
class Cloud {
  #count = 0;

  constructor(most) {
    for (const name of ["x", "y", "depth", "radius"]) this[name] = new Float32Array(most);
    this.colour = new Uint32Array(most);
  }

  add([x, y, depth], radius, colour) {
    const k = this.#count;
    [this.x[k], this.y[k], this.depth[k], this.radius[k], this.colour[k]] = [x, y, depth, radius, colour];
    this.#count += 1;
  }

  draw(pixels, width, height) {
    const order = dim === 2 ? null : this.#order();
    for (let i = 0; i < this.#count; i += 1) {
      const k = order === null ? i : order[i];
      disc(pixels, width, height, this.x[k], this.y[k], this.radius[k], this.colour[k]);
    }
  }

  /** Numbers of the discs by layers of depth: sorting them one by one would take longer than the rest. */
  #order() {
    const low = this.depth.reduce((least, value) => Math.min(least, value), Infinity);
    const high = this.depth.reduce((most, value) => Math.max(most, value), -Infinity);
    const layer = (k) => Math.floor(((high - this.depth[k]) / (high - low || 1)) * (LAYERS - 1));
    const starts = new Uint32Array(LAYERS + 1);
    for (let k = 0; k < this.#count; k += 1) starts[layer(k) + 1] += 1;
    for (let i = 0; i < LAYERS; i += 1) starts[i + 1] += starts[i];
    const order = new Uint32Array(this.#count);
    for (let k = 0; k < this.#count; k += 1) {
      const at = layer(k);
      order[starts[at]] = k;
      starts[at] += 1;
    }
    return order;
  }
}

function packed([red, green, blue], shade) {
  const byte = (value) => Math.min(255, value * shade) & 255;
  return (255 << 24) | (byte(blue) << 16) | (byte(green) << 8) | byte(red);
}

function disc(pixels, width, height, x, y, radius, colour) {
  const [top, bottom] = [Math.max(0, Math.ceil(y - radius)), Math.min(height - 1, Math.floor(y + radius))];
  for (let row = top; row <= bottom; row += 1) {
    const half = Math.sqrt(radius * radius - (row - y) ** 2);
    const [from, to] = [Math.max(0, Math.ceil(x - half)), Math.min(width - 1, Math.floor(x + half))];
    if (from <= to) pixels.fill(colour, row * width + from, row * width + to + 1);
  }
}

function drawWalls(project) {
  const corners = Array.from({ length: 2 ** dim }, (_, bits) =>
    scene.lower.map((low, axis) => ((bits >> axis) & 1 ? scene.upper[axis] : low)),
  );
  pen.strokeStyle = "rgb(150 178 212 / 0.45)";
  pen.lineWidth = Math.max(1, picture.width / 900);
  pen.beginPath();
  for (let a = 0; a < corners.length; a += 1) {
    for (let axis = 0; axis < dim; axis += 1) {
      const b = a | (1 << axis);
      if (b === a) continue;
      pen.moveTo(...project(...corners[a]).slice(0, 2));
      pen.lineTo(...project(...corners[b]).slice(0, 2));
    }
  }
  pen.stroke();
}

/** A line through points of the world. */
function drawLine(project, width, line, colour) {
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.beginPath();
  for (const point of line) pen.lineTo(...project(...point).slice(0, 2));
  pen.stroke();
}

/** What is followed: the outline of an oval, those of a shape, or an arrow, which has a head. */
function drawSketch(project, ratio, { lines, isArrow }) {
  for (const line of lines) drawLine(project, 2.5 * ratio, line, SKETCH);
  if (!isArrow) return;
  const [before, tip] = lines[0].slice(-2).map((point) => project(...point));
  const along = Math.atan2(tip[1] - before[1], tip[0] - before[0]);
  pen.beginPath();
  for (const turn of [-2.6, 0, 2.6]) {
    const reach = turn === 0 ? 0 : 14 * ratio;
    pen.lineTo(tip[0] + reach * Math.cos(along + turn), tip[1] + reach * Math.sin(along + turn));
  }
  pen.stroke();
}

/** Where a probe is: a ring around a point, or a line. */
function drawMark(project, ratio, mark) {
  if (mark.length > 1) drawLine(project, 1.5 * ratio, mark, MARK);
  else {
    const [x, y] = project(...mark[0]);
    [pen.strokeStyle, pen.lineWidth] = [MARK, 1.5 * ratio];
    pen.beginPath();
    pen.arc(x, y, 4 * ratio, 0, 2 * Math.PI);
    pen.stroke();
  }
}

function drawHand(project, ratio) {
  const [x, y, , scale] = project(...hand.point);
  if (hand.body !== undefined) {
    const [gripX, gripY] = project(...placeOf(hand.grip, poseOf(hand.body)));
    drawLine((a, b) => [a, b], 2 * ratio, [[gripX, gripY], [x, y]], GRASP);
    pen.fillStyle = GRASP;
    pen.beginPath();
    pen.arc(gripX, gripY, 4 * ratio, 0, 2 * Math.PI);
    pen.fill();
  }
  pen.strokeStyle = GRASP;
  pen.lineWidth = 1.5 * ratio;
  pen.beginPath();
  pen.arc(x, y, hand.body === undefined ? HAND.radius * scale : 8 * ratio, 0, 2 * Math.PI);
  pen.stroke();
}

// Time.

async function advance(frames) {
  busy = true;
  try {
    const found = await ask("advance", { frames, hand: push(), wanted: part("colour").value });
    state = found;
    note(found.readings);
    if (frames > 0) rates.push({ simulated: found.frames * frameDt * 1000, took: found.took });
    rates = rates.slice(-30);
    report();
    draw();
  } catch (error) {
    pause();
    say(reason(error), true);
  } finally {
    busy = false;
  }
}

function tick(now) {
  requestAnimationFrame(tick);
  const passed = Math.min(now - last, 100);
  last = now;
  if (!playing || busy) {
    if (playing) owed += (passed / 1000 / frameDt) * Number(part("speed").value);
    return;
  }
  owed += (passed / 1000 / frameDt) * Number(part("speed").value);
  const [simulated, took] = spent();
  const most = took > 0 ? Math.max(1, Math.floor((PICTURE * simulated) / took / (1000 * frameDt))) : 1;
  const frames = Math.min(Math.floor(owed), most);
  // What a slow device cannot make up for is dropped: the picture then plays slower.
  owed = Math.min(owed - frames, most);
  if (frames > 0) advance(frames);
}

/** Take readings into the charts. */
function note(readings) {
  for (const [frame, values] of readings) charts.forEach((chart, i) => chart.add(frame * frameDt, values[i]));
  if (readings.length > 0) for (const chart of charts) chart.draw();
}

/** Time that was simulated of late, and what it took [ms]. */
function spent() {
  return ["simulated", "took"].map((key) => rates.reduce((sum, one) => sum + one[key], 0));
}

function report() {
  const seconds = (state.frame * frameDt).toFixed(2);
  const [simulated, took] = spent();
  const fastest = took > 0 ? ` · can play ${(simulated / took).toPrecision(2)} times as fast as real time` : "";
  part("frame").textContent = `frame ${state.frame} · ${seconds} s${fastest}`;
  document.body.dataset.frame = state.frame;
  if (part("digest").dataset.frame !== String(state.frame)) part("digest").value = "";
}

function play() {
  playing = true;
  owed = 0;
  part("play").textContent = "Pause";
}

function pause() {
  playing = false;
  part("play").textContent = "Play";
}

part("play").onclick = () => (playing ? pause() : play());
part("step").onclick = () => {
  pause();
  if (!busy) advance(1);
};
part("reset").onclick = async () => {
  pause();
  drawn = null;
  say("");
  state = await ask("reset", { wanted: part("colour").value });
  for (const chart of charts) chart.clear();
  note(state.readings);
  rates = [];
  report();
  draw();
};
part("colour").onchange = () => !busy && advance(0);
part("show-digest").onclick = async () => {
  pause();
  const { digest, frame } = await ask("digest");
  part("digest").dataset.frame = frame;
  part("digest").value = digest;
};
document.onkeydown = ({ key, target }) => {
  if (target.closest("select, button, textarea, output")) return;
  if (key === " ") part("play").click();
  else if (key === ".") part("step").click();
  else if (key === "r") part("reset").click();
};

// Hand and camera.

/** The point of the world under the pointer: in 3D, in a plane that faces the eye, at its distance [m] or through the middle. */
function under({ clientX, clientY }, depth = null) {
  const box = picture.getBoundingClientRect();
  const [x, y] = [((clientX - box.left) / box.width) * picture.width, ((clientY - box.top) / box.height) * picture.height];
  const middle = scene.lower.map((low, axis) => (low + scene.upper[axis]) / 2);
  const [mx, my, , scale] = projection()(...middle);
  if (dim === 2) return [middle[0] + (x - mx) / scale, middle[1] + (my - y) / scale];
  const { distance, focal, rows } = eye();
  const away = depth ?? distance;
  const way = [((x - mx) / focal) * away, ((my - y) / focal) * away, distance - away];
  return middle.map((value, axis) => value + way.reduce((sum, part, i) => sum + part * rows[i][axis], 0));
}

/** The rigid body under the pointer: {body, grip, depth: its distance from the eye}; null where there is none. */
function bodyUnder(event) {
  if (scene.rigid.length === 0) return null;
  const poses = scene.rigid.map((_, body) => poseOf(body));
  if (dim === 2) return bodyAt(scene.rigid, poses, under(event));
  const { distance } = eye();
  const [from, to] = [under(event, 0), under(event)];
  const direction = to.map((x, axis) => x - from[axis]);
  const found = bodyOnRay(scene.rigid, poses, from, direction);
  if (found === null) return null;
  // The direction leads from the eye to the plane through the middle.
  const share = Math.hypot(...found.point.map((x, axis) => x - from[axis])) / Math.hypot(...direction);
  return { ...found, depth: share * distance };
}

/** Largest force of a hand that holds a body [N], in 2D per metre of depth, as on the page of the service. */
function pullStrength() {
  const side = LIFTED * Math.min(...scene.upper.map((high, axis) => high - scene.lower[axis]));
  return 1000 * side ** dim * (Math.hypot(...scene.gravity) || 9.81);
}

/** The hand as the solver takes it: a hand that rests longer than a moment pushes no more. */
function push() {
  if (hand === null) return null;
  if (hand.body !== undefined) {
    return { body: hand.body, grip: hand.grip, target: hand.point, reach: HAND.radius * scene.unit, strength: pullStrength() };
  }
  const rests = performance.now() - hand.time > 80;
  return { ...HAND, point: hand.point, velocity: rests ? hand.velocity.map(() => 0) : hand.velocity };
}

/** Take up the next point of a stroke; an arrow is straight. */
function trace(point) {
  if (part("drag").value === "arrow") stroke = [stroke[0], point];
  else if (Math.hypot(...point.map((x, axis) => x - stroke.at(-1)[axis])) >= APART * scene.unit) stroke.push(point);
}

/** Let the fluid follow what was drawn. */
async function sketch(points, isArrow) {
  const elastic = state.materials.filter((material) => scene.types[material] === ELASTIC).length;
  if (!isArrow && 2 * elastic > state.materials.length) {
    say("Elastic bodies keep their shape and fill no outline: draw an arrow.", true);
    return;
  }
  const { frames, hold, cap } = DRAWN;
  const head = [isArrow ? 0 : 1, frames, hold, scene.frameDt, scene.unit, scene.spacing, cap];
  const numbers = [...head, ...scene.gravity, ...scene.lower, ...scene.upper, ...points.flat()];
  try {
    const { frame } = await ask("sketch", { numbers });
    const lines = [isArrow ? points : [...points, points[0]]];
    drawn = { first: frame, last: frame + frames + hold, lines, isArrow };
    say("");
    play();
  } catch (error) {
    const text = reason(error);
    say(`${text[0].toUpperCase()}${text.slice(1)}.`, true);
  }
}

picture.onpointerdown = (event) => {
  if (!event.isPrimary || state === null) return; // a second finger does nothing
  picture.setPointerCapture(event.pointerId);
  if (["arrow", "shape"].includes(part("drag").value)) stroke = [under(event)];
  else if (dim === 3 && (part("drag").value === "turn" || event.button === 2)) turning = event;
  else {
    const held = bodyUnder(event);
    const point = held?.point ?? under(event);
    hand = { ...held, point, velocity: new Array(dim).fill(0), time: performance.now() };
  }
  if (!playing) draw();
};
picture.onpointermove = (event) => {
  if (!event.isPrimary) return;
  if (turning !== null) {
    camera.yaw -= 0.006 * (event.clientX - turning.clientX);
    camera.pitch = Math.min(1.5, Math.max(-0.2, camera.pitch + 0.006 * (event.clientY - turning.clientY)));
    turning = event;
    if (!playing) draw();
  } else if (stroke !== null) {
    trace(under(event));
    if (!playing) draw();
  } else if (hand !== null) {
    const [point, now] = [under(event, hand.depth), performance.now()];
    const seconds = Math.max(now - hand.time, 4) / 1000;
    const velocity = point.map((value, axis) => (value - hand.point[axis]) / seconds);
    hand = { ...hand, point, velocity: velocity.map((v, axis) => 0.5 * v + 0.5 * hand.velocity[axis]), time: now };
    if (!playing) draw();
  }
};
picture.onpointerup = picture.onpointercancel = ({ type, isPrimary }) => {
  if (!isPrimary) return;
  const [line, isArrow] = [stroke, part("drag").value === "arrow"];
  [hand, turning, stroke] = [null, null, null];
  if (type === "pointerup" && line !== null && line.length > (isArrow ? 1 : 2)) sketch(line, isArrow);
  if (!playing) draw();
};
picture.oncontextmenu = (event) => event.preventDefault();
picture.addEventListener(
  "wheel",
  (event) => {
    if (dim === 2) return;
    event.preventDefault();
    camera.distance = Math.min(6, Math.max(1.2, camera.distance * Math.exp(0.001 * event.deltaY)));
    if (!playing) draw();
  },
  { passive: false },
);
new ResizeObserver(draw).observe(picture);
picture.addEventListener("contextlost", () =>
  say("The browser has taken the picture's memory away. It is drawn again when there is some; else reload the page.", true),
);
picture.addEventListener("contextrestored", () => {
  say("");
  draw();
});
new ResizeObserver(() => charts.forEach((chart) => chart.draw())).observe(part("charts"));

function unpackedNumbers(text) {
  return new Float32Array(bytesOf(text).buffer);
}

async function start() {
  try {
    scene = JSON.parse(part("scene").textContent);
    scene.resting = scene.solids.filter(({ moves }) => !moves).map(({ points }) => unpackedNumbers(points));
    const moving = scene.solids
      .filter(({ moves }) => moves)
      .map(({ obstacle, points }) => ({ obstacle, points: unpackedNumbers(points) }));
    const modules = [stored("module"), stored("module-exact")];
    charts = scene.probes.map((probe) => new Chart(probe, part("charts")));
    const given = { modules, start: stored("start"), path: stored("ways"), moving, about: scene };
    const opened = await ask("open", given);
    ({ dim, frameDt } = opened);
    for (const body of scene.rigid) body.grains = [];
    if (dim === 3) sow();
    if (scene.rigid.length > 0) part("drag").options[0].text = "push or pull";
    // In space a hand draws in no plane of its own.
    for (const one of [...part("drag").options]) {
      if (one.value !== "push" && (one.value === "turn") === (dim === 2)) one.remove();
    }
    // The particles that are shown in coarse mode have neither.
    for (const one of part("colour").options) {
      if (opened.isCoarse && (one.value === "density" || one.value === "pressure")) one.disabled = true;
    }
    await advance(0);
    note(opened.readings);
    say("");
    document.body.dataset.ready = "true";
    requestAnimationFrame(tick);
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) play();
  } catch (error) {
    say(reason(error), true);
    document.body.dataset.ready = "false";
  }
}

if (typeof DecompressionStream === "undefined" || typeof WebAssembly === "undefined") {
  say("This browser is too old to play: Chrome 91, Firefox 113 and Safari 16.4 can, and all later ones.", true);
  document.body.dataset.ready = "false";
} else start();
