// Mouse, finger and keyboard on the picture of a draft.

import { depthOf, focusThing, pointOf } from "./picture.js";
import { handlesOf, lastHandle, made, moved, resized } from "./things.js";

const STEP = 0.01; // m by which an arrow key moves or resizes
const CLICK = 0.015; // m: a shorter way of a pointer draws nothing
const ARROWS = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], PageUp: [0, 0, -1], PageDown: [0, 0, 1] };

/**
 * Let hands change a draft.
 *
 * @param svg its picture
 * @param parts {draft, view() of the picture, kind() that a drag on free ground draws; null for none}
 */
export function bindHands(svg, { draft, view, kind }) {
  let held = null; // what a pointer holds: {id, from, thing, handle} or {id, from, draws}

  /** The point under a pointer, in space at the depth of another one. */
  const under = (event, depth) => pointOf(svg, view(), event, depth);

  svg.addEventListener("pointerdown", (event) => {
    if (held !== null || event.button !== 0) return;
    const from = under(event, depthOf(view()));
    const handle = event.target.closest("[data-handle]")?.dataset.handle;
    const index = event.target.closest("[data-index]")?.dataset.index;
    if (handle === undefined && index === undefined) {
      draft.select(-1);
      if (kind() !== null) held = { id: event.pointerId, from, draws: kind(), added: false };
    } else {
      if (handle === undefined) draft.select(Number(index));
      held = { id: event.pointerId, from, handle, thing: draft.things[draft.selected], remembered: false };
      focusThing(svg, draft.selected);
    }
    svg.setPointerCapture(event.pointerId);
    event.preventDefault();
  });

  svg.addEventListener("pointermove", (event) => {
    if (held?.id !== event.pointerId) return;
    const at = under(event, held.from);
    const way = at.map((x, k) => x - held.from[k]);
    if (held.draws !== undefined) {
      if (Math.hypot(...way) < CLICK && !held.added) return;
      const thing = made(held.draws, ...roomBetween(held.from, at, view()), draft.room);
      if (held.added) draft.replace(thing);
      else draft.add(thing);
      held.added = true;
      return;
    }
    if (!held.remembered) draft.remember();
    held.remembered = true;
    if (held.handle === undefined) draft.replace(moved(held.thing, way, draft.room));
    else draft.replace(resized(held.thing, held.handle, under(event, handlesOf(held.thing, view())[held.handle]), view()));
  });

  const release = (event) => {
    if (held?.id === event.pointerId) held = null;
  };
  svg.addEventListener("pointerup", release);
  svg.addEventListener("pointercancel", release);

  svg.addEventListener("focusin", ({ target }) => {
    if (target.dataset.index !== undefined) draft.select(Number(target.dataset.index));
  });

  svg.addEventListener("keydown", (event) => {
    const thing = draft.things[draft.selected];
    if (thing === undefined) return;
    const index = draft.selected;
    if (event.key in ARROWS) {
      const by = wayIn(view(), ARROWS[event.key].map((d) => d * STEP));
      const handle = event.shiftKey ? lastHandle(thing, view()) : undefined;
      if (by === null || (event.shiftKey && handle === undefined)) return;
      draft.remember();
      const place = handle === undefined ? null : handlesOf(thing, view())[handle];
      draft.replace(handle === undefined ? moved(thing, by, draft.room) : resized(thing, handle, place.map((x, k) => x + by[k]), view()));
    } else if (event.key === "Delete" || event.key === "Backspace") {
      draft.remove();
      focusThing(svg, Math.min(index, draft.things.length - 1));
    } else return;
    event.preventDefault();
    event.stopPropagation();
  });
}

/** A way to the right, upwards and towards the eye, in the world; null for one along the sight of a flat picture. */
function wayIn({ dim, rows }, way) {
  if (dim === 2) return way[2] === 0 ? way.slice(0, 2) : null;
  return [0, 1, 2].map((k) => rows.reduce((sum, row, i) => sum + row[k] * way[i], 0));
}

/** Corners of the room that a drag between two points opens: in space half as far to the front and to the back as its shorter side. */
function roomBetween(from, to, { dim, depth }) {
  if (dim === 2) return [from, to];
  const half = Math.min(...from.map((x, k) => (k === depth ? Infinity : Math.abs(to[k] - x)))) / 2;
  return [-1, 1].map((side) => (side < 0 ? from : to).map((x, k) => (k === depth ? x + side * half : x)));
}
