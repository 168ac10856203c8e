// The picture of a draft: an SVG in which each thing can be focused.

import { outlineOf } from "./rigid.js";
import { boundsOf, handlesOf, lookOf, nameOf } from "./things.js";

const SIDE = 1000; // units of the picture's side
const MARGIN = 0.04; // of it, around the walls

const element = (name, attributes) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  return made;
};

/** Where metres lie in the picture of a scene: {to(point), from(x, y), scale}. */
export function viewOf({ lower, upper }) {
  const extent = Math.max(upper[0] - lower[0], upper[1] - lower[1]);
  const scale = (SIDE * (1 - 2 * MARGIN)) / extent;
  const middle = [(lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2];
  return {
    scale,
    to: ([x, y]) => [SIDE / 2 + (x - middle[0]) * scale, SIDE / 2 - (y - middle[1]) * scale],
    from: (px, py) => [middle[0] + (px - SIDE / 2) / scale, middle[1] - (py - SIDE / 2) / scale],
  };
}

/** The point of a pointer event in metres. */
export function pointOf(svg, view, event) {
  const box = svg.getBoundingClientRect();
  return view.from(((event.clientX - box.left) / box.width) * SIDE, ((event.clientY - box.top) / box.height) * SIDE);
}

function shapeOf(view, { part, record }) {
  const { to, scale } = view;
  const isTurned = part === "rigid" && record.radius === undefined;
  if (isTurned) return element("polygon", { points: outlineOf(record).map((p) => to(p).join(",")).join(" ") });
  // Of a surface of triangles its box is shown.
  if (record.lower !== undefined || record.triangles !== undefined) {
    const [[left, bottom], [right, top]] = boundsOf({ record }).map((place) => to(place));
    return element("rect", { x: left, y: top, width: Math.max(right - left, 6), height: Math.max(bottom - top, 6) });
  }
  if (record.center !== undefined) {
    const [cx, cy] = to(record.center);
    return element("circle", { cx, cy, r: (record.radius ?? 0.01) * scale });
  }
  if (record.start !== undefined) {
    const [[x1, y1], [x2, y2]] = [to(record.start), to(record.end)];
    return element("line", { x1, y1, x2, y2, "stroke-width": Math.max(record.thickness * scale, 8), "stroke-linecap": "round" });
  }
  const points = record.points ?? record.vertices ?? halfSpace(record);
  return element("polygon", { points: points.map((p) => to(p).join(",")).join(" "), "fill-rule": "evenodd" });
}

/** A large quadrilateral on the solid side of a half-space. */
function halfSpace({ point, normal }) {
  const size = Math.hypot(...normal);
  const [nx, ny] = [normal[0] / size, normal[1] / size];
  return [[-2, 0], [2, 0], [2, 2], [-2, 2]].map(([along, inward]) => [point[0] - along * ny - inward * nx, point[1] + along * nx - inward * ny]);
}

/** An arrow from the middle of an emitter along what it brings. */
function flowOf(view, { record }) {
  const [lower, upper] = boundsOf({ record });
  const [x, y] = view.to([(lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2]);
  const speed = Math.hypot(...record.velocity);
  const [dx, dy] = [record.velocity[0] / speed, -record.velocity[1] / speed];
  const tip = [x + 60 * dx, y + 60 * dy];
  const barb = (side) => [tip[0] - 18 * dx + side * 12 * dy, tip[1] - 18 * dy - side * 12 * dx].join(",");
  return element("path", { class: "flow", d: `M${x},${y} L${tip.join(",")} M${barb(1)} L${tip.join(",")} L${barb(-1)}` });
}

const metres = (x) => `${Number(x.toFixed(3))} m`;

function labelOf(thing, name, wrong) {
  const bounds = boundsOf(thing);
  const where = bounds === null ? "" : `, ${metres(bounds[1][0] - bounds[0][0])} by ${metres(bounds[1][1] - bounds[0][1])}, at ${metres((bounds[0][0] + bounds[1][0]) / 2)}, ${metres((bounds[0][1] + bounds[1][1]) / 2)}`;
  return `${name}${where}${wrong ? ", with a fault" : ""}`;
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
  const bounds = boundsOf(thing);
  const wide = bounds !== null && (bounds[1][0] - bounds[0][0]) * view.scale > 90 && (bounds[1][1] - bounds[0][1]) * view.scale > 40;
  if (wide && thing.record.start === undefined) {
    const [x, y] = view.to([(bounds[0][0] + bounds[1][0]) / 2, (bounds[0][1] + bounds[1][1]) / 2]);
    const text = element("text", { x, y, "aria-hidden": true });
    text.textContent = name;
    group.append(text);
  }
  return group;
}

function drawHandle(view, name, place) {
  const [cx, cy] = view.to(place);
  const group = element("g", { class: name === "turn" ? "handle turn" : "handle", "data-handle": name });
  // A finger needs more room than the dot takes.
  group.append(element("circle", { cx, cy, r: 34, class: "reach" }), element("circle", { cx, cy, r: 11 }));
  return group;
}

/** Draw a draft: {scene, things, selected: index or -1, wrong: set of indices}. Where a thing had the focus, the chosen one gets it. */
export function drawDraft(svg, view, { scene, things, selected, wrong }) {
  const hadFocus = svg.contains(document.activeElement);
  const [left, bottom] = view.to(scene.walls.lower);
  const [right, top] = view.to(scene.walls.upper);
  svg.replaceChildren(
    element("rect", { class: "tank", x: left, y: top, width: right - left, height: bottom - top }),
    ...things.map((thing, index) => drawThing(view, thing, index, { things, selected: index === selected, wrong: wrong.has(index) })),
    ...(selected < 0 ? [] : Object.entries(handlesOf(things[selected])).map(([name, place]) => drawHandle(view, name, place))),
  );
  if (hadFocus) focusThing(svg, selected);
}

/** Give the focus to a thing of the picture, or to the picture where there is no such thing. */
export const focusThing = (svg, index) => (svg.querySelector(`[data-index="${index}"]`) ?? svg).focus();
