// The pictures of a draft: an SVG in which each thing can be focused; in space one from the front and one from above, over what is shaded.

import { edgesOf } from "../stage/scenery2d.js";
import { outlineOf } from "./rigid.js";
import { shade } from "./shading.js";
import { outlineIn, surfaceOf } from "./space.js";
import { boundsOf, handlesOf, lookOf, nameOf } from "./things.js";

const SIDE = 1000; // units of the picture's side
const MARGIN = 0.04; // of it, around the walls
const RIM = 14; // of the picture, in which no handle lies
const SHARPEST = 480; // most pixels of the side of a shaded picture
const COLOURS = {
  water: [46, 148, 238],
  sand: [201, 154, 90],
  elastic: [194, 73, 123],
  liquid: [184, 112, 28],
  rigid: [184, 117, 61],
  obstacles: [104, 122, 148],
  sinks: [255, 138, 128],
};
const GLASS = ["water", "liquid", "sinks"];
/** What a picture shows: unit vectors to the right, upwards, and towards the eye. */
const FRONT = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
export const VIEWS = { front: FRONT, top: [[1, 0, 0], [0, 0, -1], [0, 1, 0]] };

const element = (name, attributes) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  return made;
};

const dot = (a, b) => a.reduce((sum, x, k) => sum + x * b[k], 0);

/**
 * Where metres lie in a picture of a scene.
 *
 * @param scene with walls; @param room sides of the world [m]; @param rows as of VIEWS
 * @returns {dim, room, rows, middle of the walls, scale, to(point), from(x, y, depth: point at the depth that is meant); axes of the world
 *   across and upwards, and along the sight}
 */
export function viewOf({ dim, walls }, room, rows = FRONT, zoom = 1) {
  const { lower, upper } = walls;
  const scale = (zoom * SIDE * (1 - 2 * MARGIN)) / Math.max(...upper.map((x, k) => x - lower[k]));
  const middle = lower.map((x, k) => (x + upper[k]) / 2);
  const [right, up] = rows.map((row) => row.slice(0, dim));
  const axes = [right, up].map((row) => row.findIndex((x) => x !== 0));
  const depth = [0, 1, 2].find((k) => !axes.includes(k));
  const to = (p) => {
    const way = p.map((x, k) => x - middle[k]);
    return [SIDE / 2 + dot(right, way) * scale, SIDE / 2 - dot(up, way) * scale];
  };
  const from = (px, py, at = []) => {
    const [across, upwards] = [(px - SIDE / 2) / scale, -(py - SIDE / 2) / scale];
    return middle.map((x, k) => (k === depth ? at[k] : x + across * right[k] + upwards * up[k]));
  };
  return { dim, room, rows, middle, scale, to, from, axes, depth };
}

/** The point at which what is drawn by hand begins along the sight: the middle. */
export const depthOf = ({ middle }) => middle;

/** The point of a pointer event in metres, in space as deep as `depth`. */
export function pointOf(svg, view, event, depth) {
  const box = svg.getBoundingClientRect();
  return view.from(((event.clientX - box.left) / box.width) * SIDE, ((event.clientY - box.top) / box.height) * SIDE, depth);
}

const pathOf = (points) => points.map((p) => p.join(",")).join(" ");

function shapeOf(view, { part, record }) {
  const { to, scale } = view;
  if (record.shape === "half_space") return element("polygon", { points: pathOf(halfSpace(record, view)) });
  if (record.shape === "ball" || record.center !== undefined && view.dim === 2) {
    const [cx, cy] = to(record.center);
    return element("circle", { cx, cy, r: (record.radius ?? 0.01) * scale });
  }
  if (view.dim === 3) return element("polygon", { points: pathOf(outlineIn(record, view)) });
  if (part === "rigid") return element("polygon", { points: pathOf(outlineOf(record).map(to)) });
  if (record.lower !== undefined) {
    const [[left, bottom], [right, top]] = boundsOf({ record }).map((place) => to(place));
    return element("rect", { x: left, y: top, width: Math.max(right - left, 6), height: Math.max(bottom - top, 6) });
  }
  if (record.start !== undefined) {
    const [[x1, y1], [x2, y2]] = [to(record.start), to(record.end)];
    return element("line", { x1, y1, x2, y2, "stroke-width": Math.max(record.thickness * scale, 8), "stroke-linecap": "round" });
  }
  // Edges that follow each other are one line.
  const lines = edgesOf(record.vertices.map(to)).map(([a, b], k, all) => (String(all[k - 1]?.[1]) === String(a) ? `L${b}` : `M${a}L${b}`));
  return element("path", { d: lines.join(""), "fill-rule": "evenodd" });
}

/** A large quadrilateral of the picture on the solid side of a half-space; nothing of one whose surface is seen from above or below. */
function halfSpace({ point, normal }, view) {
  const [right, up] = view.rows.map((row) => dot(row.slice(0, view.dim), normal));
  const size = Math.hypot(right, up);
  if (size < 1e-6 * Math.hypot(...normal)) return [];
  const [[x, y], nx, ny] = [view.to(point), right / size, -up / size];
  const far = 2 * SIDE;
  return [[-1, 0], [1, 0], [1, 1], [-1, 1]].map(([along, inward]) => [x + far * (along * ny - inward * nx), y - far * (along * nx + inward * ny)]);
}

/** An arrow from the middle of an emitter along what it brings; a ring where that comes along the sight. */
function flowOf(view, { record }) {
  const [lower, upper] = boundsOf({ record });
  const [x, y] = view.to(lower.map((low, k) => (low + upper[k]) / 2));
  const seen = view.rows.slice(0, 2).map((row) => dot(row.slice(0, view.dim), record.velocity));
  const speed = Math.hypot(...seen);
  if (speed < 0.1 * Math.hypot(...record.velocity)) return element("circle", { class: "flow", cx: x, cy: y, r: 16 });
  const [dx, dy] = [seen[0] / speed, -seen[1] / speed];
  const tip = [x + 60 * dx, y + 60 * dy];
  const barb = (side) => [tip[0] - 18 * dx + side * 12 * dy, tip[1] - 18 * dy - side * 12 * dx].join(",");
  return element("path", { class: "flow", d: `M${x},${y} L${tip.join(",")} M${barb(1)} L${tip.join(",")} L${barb(-1)}` });
}

const metres = (x) => `${Number(x.toFixed(3))} m`;

function labelOf(thing, name, wrong) {
  const bounds = boundsOf(thing);
  const sides = () => bounds[1].map((x, k) => metres(x - bounds[0][k])).join(" by ");
  const middle = () => bounds[1].map((x, k) => metres((x + bounds[0][k]) / 2)).join(", ");
  return `${name}${bounds === null ? "" : `, ${sides()}, at ${middle()}`}${wrong ? ", with a fault" : ""}`;
}

/** Corners of the box around a thing in the picture: left and top, right and bottom; null for one without an end. */
function frameOf(view, thing) {
  const bounds = boundsOf(thing);
  if (bounds === null) return null;
  const [[left, bottom], [right, top]] = bounds.map((p) => view.to(p));
  return [[left, Math.min(top, bottom)], [right, Math.max(top, bottom)]];
}

function drawThing(view, thing, index, { things, selected, wrong }) {
  const name = nameOf(thing, things);
  const group = element("g", {
    class: `thing ${lookOf(thing)}${selected ? " selected" : ""}${wrong ? " wrong" : ""}`,
    "data-index": index,
    tabindex: 0,
    role: "button",
    "aria-pressed": selected,
    "aria-label": labelOf(thing, name, wrong),
  });
  group.append(shapeOf(view, thing));
  if (thing.part === "emitters") group.append(flowOf(view, thing));
  const frame = frameOf(view, thing);
  if (frame !== null && frame[1][0] - frame[0][0] > 90 && frame[1][1] - frame[0][1] > 40 && (view.dim === 3 || thing.record.start === undefined)) {
    const [x, y] = [0, 1].map((k) => (frame[0][k] + frame[1][k]) / 2);
    const text = element("text", { x, y, "aria-hidden": true });
    text.textContent = name;
    group.append(text);
  }
  return group;
}

function drawHandle(view, name, place) {
  // One beyond the picture lies at its rim.
  const [cx, cy] = view.to(place).map((x) => Math.min(SIDE - RIM, Math.max(RIM, x)));
  const group = element("g", { class: name === "turn" ? "handle turn" : "handle", "data-handle": name });
  // A finger needs more room than the dot takes.
  group.append(element("circle", { cx, cy, r: 34, class: "reach" }), element("circle", { cx, cy, r: 11 }));
  return group;
}

/** In space what looks larger is drawn first, so that a hand reaches what lies in it. */
function order(view, things) {
  const areas = things.map((thing) => {
    const frame = frameOf(view, thing);
    return frame === null ? Infinity : (frame[1][0] - frame[0][0]) * (frame[1][1] - frame[0][1]);
  });
  const indices = things.map((_, index) => index);
  return view.dim === 2 ? indices : indices.sort((a, b) => areas[b] - areas[a]);
}

/** Draw a draft: {scene, things, selected: index or -1, wrong: set of indices}. Where a thing had the focus, the chosen one gets it. */
export function drawDraft(svg, view, { base, things, selected, wrong }) {
  const hadFocus = svg.contains(document.activeElement);
  const [left, bottom] = view.to(view.middle.map((x, k) => (view.rows[1][k] < 0 ? base.walls.upper : base.walls.lower)[k]));
  const [right, top] = view.to(view.middle.map((x, k) => (view.rows[1][k] < 0 ? base.walls.lower : base.walls.upper)[k]));
  svg.replaceChildren(
    element("rect", { class: "tank", x: left, y: top, width: right - left, height: bottom - top }),
    ...order(view, things).map((index) => drawThing(view, things[index], index, { things, selected: index === selected, wrong: wrong.has(index) })),
    ...(selected < 0 ? [] : Object.entries(handlesOf(things[selected], view)).map(([name, place]) => drawHandle(view, name, place))),
  );
  if (hadFocus) focusThing(svg, selected);
}

/** Draw the surfaces of a draft in space into a canvas, and the edges of its walls where these are seen aslant. */
export function shadeDraft(canvas, view, { base, things }, edges = false) {
  const side = Math.min(SHARPEST, Math.round(canvas.getBoundingClientRect().width * Math.min(devicePixelRatio, 2)));
  if (side === 0) return;
  [canvas.width, canvas.height] = [side, side];
  const parts = things.map((thing) => ({ surface: surfaceOf(thing.record), rgb: COLOURS[lookOf(thing)], isGlass: GLASS.includes(lookOf(thing)) }));
  shade(canvas, { ...view, scale: view.scale / SIDE }, parts);
  if (edges) drawEdges(canvas, view, base.walls);
}

function drawEdges(canvas, view, { lower, upper }) {
  const context = canvas.getContext("2d");
  const corner = (bits) => lower.map((low, k) => ((bits >> k) & 1 ? upper[k] : low));
  context.strokeStyle = "rgb(150 178 212 / 0.5)";
  context.beginPath();
  for (let bits = 0; bits < 8; bits += 1) {
    for (const axis of [1, 2, 4].filter((one) => (bits & one) === 0)) {
      const ends = [corner(bits), corner(bits | axis)].map((p) => view.to(p).map((x) => (x / SIDE) * canvas.width));
      context.moveTo(...ends[0]);
      context.lineTo(...ends[1]);
    }
  }
  context.stroke();
}

/** Give the focus to a thing of the picture, or to the picture where there is no such thing. */
export const focusThing = (svg, index) => (svg.querySelector(`[data-index="${index}"]`) ?? svg).focus();
