// The controls: player, speed, tools, depth of a stroke, keyboard.

import { byId, setText } from "./dom.js";

// ---- what the controls show ----

/** A speed as a multiple of real time. */
export const speedText = (value) => `${value >= 0.1 ? value.toFixed(2) : value.toFixed(3)}×`;

export function showPlaying(playing) {
  document.body.dataset.playing = String(playing);
  byId("play-icon").setAttribute("href", playing ? "#icon-pause" : "#icon-play");
  byId("play").setAttribute("aria-label", playing ? "Pause" : "Play");
}

export function showSpeed(value) {
  byId("speed").value = String(Math.log10(value));
  setText("speed-out", `${speedText(value)} real time`);
}

/** Offer the tools of a dimension: the camera and the depth of a stroke are for 3D alone. */
export function showTools(dim) {
  const orbit = document.querySelector('[data-tool="orbit"].tool');
  orbit.hidden = dim !== 3;
  byId("depth-card").hidden = dim !== 3;
  document.body.dataset.dim = dim;
}

export function showTool(tool) {
  document.body.dataset.tool = tool;
  for (const button of byId("tools").children) {
    const checked = button.dataset.tool === tool;
    button.setAttribute("aria-checked", String(checked));
    button.tabIndex = checked ? 0 : -1;
  }
}

/** Stroke widths [px of a 512-pixel raster] at the start and the end of a stroke, for 3D. */
export const depthWidths = () => [Number(byId("depth-start").value), Number(byId("depth-end").value)];

const placeOf = (width) => (width < 7 ? "back" : width > 15 ? "front" : "middle");

/** Move the depth of strokes by steps towards the viewer; of their end alone, if `endOnly`. */
export function deepen(steps, endOnly) {
  for (const id of endOnly ? ["depth-end"] : ["depth-start", "depth-end"]) byId(id).value = Number(byId(id).value) + steps;
  describeDepths();
}

function describeDepths() {
  for (const id of ["depth-start", "depth-end"]) {
    const width = Number(byId(id).value);
    setText(`${id}-out`, `${placeOf(width)}, ${width} px`);
  }
  const [start, end] = depthWidths();
  byId("depth").value = end;
  byId("depth").setAttribute("aria-valuetext", placeOf(end));
  setText("depth-text", start === end ? placeOf(end) : `${placeOf(start)} to ${placeOf(end)}`);
}

// ---- what the user does ----

/**
 * Call an action whenever the user asks for it.
 *
 * @param actions {play, step, reset, speed(value), tool(name), undo, switchKind, escape, forces, depth}
 */
export function bindControls(actions) {
  byId("play").addEventListener("click", actions.play);
  byId("step").addEventListener("click", actions.step);
  byId("reset").addEventListener("click", actions.reset);
  byId("undo").addEventListener("click", actions.undo);
  byId("switch-kind").addEventListener("click", actions.switchKind);
  byId("everyone").addEventListener("click", actions.everyone);
  byId("help-open").addEventListener("click", () => byId("help").showModal());
  byId("speed").addEventListener("input", () => actions.speed(10 ** Number(byId("speed").value)));
  for (const id of ["depth-start", "depth-end"]) byId(id).addEventListener("input", actions.depth);
  byId("depth").addEventListener("input", () => {
    byId("depth-start").value = byId("depth-end").value = byId("depth").value;
    actions.depth();
  });
  for (const id of ["depth", "depth-start", "depth-end"]) byId(id).addEventListener("input", describeDepths);
  describeDepths();
  bindTools(actions);
  bindKeys(actions);
}

function bindTools(actions) {
  const buttons = [...byId("tools").children];
  for (const button of buttons) button.addEventListener("click", () => actions.tool(button.dataset.tool));
  // Arrow keys move within a radio group, as screen reader users expect.
  byId("tools").addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    const visible = buttons.filter((button) => !button.hidden);
    const next = visible[(visible.indexOf(document.activeElement) + step + visible.length) % visible.length];
    next.focus();
    actions.tool(next.dataset.tool);
  });
}

function bindKeys(actions) {
  const keys = {
    " ": actions.play,
    ".": actions.step,
    r: actions.reset,
    a: () => actions.tool("arrow"),
    o: () => actions.tool("oval"),
    f: () => actions.tool("free"),
    s: () => actions.tool("shape"),
    p: () => actions.tool("push"),
    v: () => actions.tool("orbit"),
    g: actions.forces,
    "?": () => byId("help").showModal(),
  };
  document.addEventListener("keydown", (event) => {
    if (byId("help").open) return;
    // A focused field keeps all its keys, a focused button its space bar.
    const inField = event.target.matches("input:not([type=range], [type=checkbox]), select, textarea");
    const takesBack = (event.ctrlKey || event.metaKey) && event.key === "z" && !inField;
    if (event.key === "Escape" || takesBack) {
      actions.escape();
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const pressesButton = event.key === " " && event.target.matches("button, [type=checkbox]");
    const action = keys[event.key];
    if (inField || pressesButton || action === undefined) return;
    event.preventDefault();
    action();
  });
}
