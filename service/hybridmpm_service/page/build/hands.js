// Mouse, finger and keyboard on the picture of a draft.

import { focusThing, pointOf } from "./picture.js";
import { handlesOf, lastHandle, made, moved, resized } from "./things.js";

const STEP = 0.01; // m by which an arrow key moves or resizes
const CLICK = 0.015; // m: a shorter way of a pointer draws nothing
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/**
 * Let hands change a draft.
 *
 * @param svg its picture
 * @param parts {draft, view() of the picture, kind() that a drag on free ground draws; null for none}
 */
export function bindHands(svg, { draft, view, kind }) {
  let held = null; // what a pointer holds: {id, from, thing, handle} or {id, from, draws}

  svg.addEventListener("pointerdown", (event) => {
    if (held !== null || event.button !== 0) return;
    const from = pointOf(svg, view(), event);
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
    const at = pointOf(svg, view(), event);
    const way = [at[0] - held.from[0], at[1] - held.from[1]];
    if (held.draws !== undefined) {
      if (Math.hypot(...way) < CLICK && !held.added) return;
      if (held.added) draft.replace(made(held.draws, held.from, at));
      else draft.add(made(held.draws, held.from, at));
      held.added = true;
      return;
    }
    if (!held.remembered) draft.remember();
    held.remembered = true;
    if (held.handle === undefined) draft.replace(moved(held.thing, way));
    else draft.replace(resized(held.thing, held.handle, at));
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
      const by = ARROWS[event.key].map((d) => d * STEP);
      const handle = event.shiftKey ? lastHandle(thing) : undefined;
      if (event.shiftKey && handle === undefined) return;
      draft.remember();
      const place = handle === undefined ? null : handlesOf(thing)[handle];
      draft.replace(handle === undefined ? moved(thing, by) : resized(thing, handle, [place[0] + by[0], place[1] + by[1]]));
    } else if (event.key === "Delete" || event.key === "Backspace") {
      draft.remove();
      focusThing(svg, Math.min(index, draft.things.length - 1));
    } else return;
    event.preventDefault();
    event.stopPropagation();
  });
}
