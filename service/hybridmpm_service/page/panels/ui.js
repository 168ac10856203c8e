// The page's elements: reading them, writing into them. No simulation logic, no network.

import { byId, setText } from "./dom.js";

const TOAST_MS = 9000;

const CONNECTION = {
  connecting: "Connecting",
  live: "Live",
  reconnecting: "Reconnecting",
  lost: "Simulation gone",
  failed: "Not running",
};

export function showState(state) {
  document.body.dataset.state = state;
  setText("connection", CONNECTION[state]);
  for (const id of ["play", "step", "reset", "speed"]) byId(id).disabled = state !== "live";
}

export function showSkeleton(text) {
  setText("skeleton-text", text);
  byId("skeleton").classList.remove("gone");
}

export function hideSkeleton() {
  byId("skeleton").classList.add("gone");
}

let bannerAction = null;

/** A line across the page with one thing to do; null takes it away. */
export function showBanner(banner) {
  byId("banner").hidden = banner === null;
  if (banner === null) return;
  setText("banner-text", banner.text);
  setText("banner-action", banner.label);
  bannerAction = banner.action;
}

/** A message in the corner. `hint` marks advice, everything else is a problem. */
export function toast({ title, detail = "", advice = "", hint = false }) {
  const box = document.createElement("div");
  box.className = hint ? "toast hint" : "toast";
  const heading = document.createElement("strong");
  heading.textContent = title;
  const close = document.createElement("button");
  close.type = "button";
  close.className = "quiet";
  close.textContent = "Dismiss";
  close.addEventListener("click", () => box.remove());
  box.append(heading, close);
  for (const text of [detail, advice].filter((line) => line !== "")) {
    const line = document.createElement("p");
    line.textContent = text;
    box.append(line);
  }
  const toasts = byId("toasts");
  toasts.append(box);
  while (toasts.children.length > 3) toasts.firstElementChild.remove();
  setTimeout(() => box.remove(), TOAST_MS);
}

// ---- scene ----------------------------------------------------------------------------------------------

const TITLES = { water: "Water", sand: "Sand", ramps: "with ramps", "2d": "2D", "3d": "3D" };

/** "water_sand_2d" -> "Water and sand, 2D". */
function titleOf(name) {
  const words = name.split("_");
  const text = words.slice(0, -1).map((word) => TITLES[word] ?? word);
  const materials = text.filter((word) => !word.startsWith("with"));
  const rest = text.filter((word) => word.startsWith("with"));
  const joined = [materials.join(" and ").toLowerCase(), ...rest].join(" ");
  return `${joined.charAt(0).toUpperCase()}${joined.slice(1)}, ${TITLES[words.at(-1)] ?? words.at(-1)}`;
}

export function showScenarios(scenarios, chosen) {
  const options = scenarios.map(({ name, text }) => {
    const option = document.createElement("option");
    option.value = name;
    option.textContent = titleOf(name);
    option.dataset.text = text;
    return option;
  });
  byId("scenario").replaceChildren(...options);
  chooseScene(chosen);
}

export function chooseScene({ scenario, seed }) {
  byId("scenario").value = scenario;
  byId("seed").value = seed;
  describeScene();
}

function describeScene() {
  setText("scenario-text", byId("scenario").selectedOptions[0]?.dataset.text ?? "");
}

export const chosenScene = () => ({ scenario: byId("scenario").value, seed: Number(byId("seed").value) });

// ---- numbers --------------------------------------------------------------------------------------------

const speedText = (value) => `${value >= 0.1 ? value.toFixed(2) : value.toFixed(3)}×`;

/** Another session: nothing of the one before is valid any more. */
export function showSession(id) {
  document.body.dataset.session = id;
  delete document.body.dataset.frame;
}

export function showFrame({ frame, time }) {
  document.body.dataset.frame = String(frame);
  setText("frame", frame.toLocaleString("en"));
  setText("time", `${time.toFixed(3)} s`);
}

export function showDrawing(framesPerSecond) {
  setText("fps", framesPerSecond === null ? "idle" : `${Math.round(framesPerSecond)} fps`);
}

const threeDigits = (value) => value.toFixed(value < 10 ? 2 : value < 100 ? 1 : 0);

/** A playing session stands still while its thread plans a sketch. */
function measuredText(playing, measured) {
  if (!playing) return "paused";
  return measured > 0 ? `${speedText(measured)} real time` : "waiting";
}

export function showStatus({ session, ms_per_frame: median, ms_p95: high, time_scale: measured }) {
  if (median !== null && median !== undefined && session.last_frame !== null) {
    setText("solver", high > 0 ? `${threeDigits(median)} ms (p95 ${threeDigits(high)})` : `${threeDigits(median)} ms`);
  }
  setText("measured", measuredText(session.playing, measured));
  setText("count", session.particles.toLocaleString("en"));
  const last = session.last_frame;
  setText("substeps", last === null || last.substeps === null ? "–" : `${last.substeps} (${last.bound})`);
}

export function showPlaying(playing) {
  document.body.dataset.playing = String(playing);
  byId("play-icon").setAttribute("href", playing ? "#icon-pause" : "#icon-play");
  byId("play").setAttribute("aria-label", playing ? "Pause" : "Play");
}

export function showSpeed(value) {
  byId("speed").value = String(Math.log10(value));
  setText("speed-out", `${speedText(value)} real time`);
}

export function showRenderer(kind) {
  document.body.dataset.renderer = kind;
  setText("renderer", kind === "webgl2" ? "WebGL2" : "Canvas2D");
}

// ---- tools -----------------------------------------------------------------------------------------------

export function showTools(dim) {
  const orbit = document.querySelector('[data-tool="orbit"].tool');
  orbit.hidden = dim !== 3;
  byId("depth-card").hidden = dim !== 3;
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

function describeDepths() {
  for (const id of ["depth-start", "depth-end"]) {
    const width = Number(byId(id).value);
    const place = width < 7 ? "back" : width > 15 ? "front" : "middle";
    setText(`${id}-out`, `${place}, ${width} px`);
  }
}

// ---- what the user does ---------------------------------------------------------------------------------

/** @param actions {play, step, reset, speed(value), newScene(scene), tool(name), undo, switchKind, escape} */
export function bind(actions) {
  byId("play").addEventListener("click", actions.play);
  byId("step").addEventListener("click", actions.step);
  byId("reset").addEventListener("click", actions.reset);
  byId("undo").addEventListener("click", actions.undo);
  byId("switch-kind").addEventListener("click", actions.switchKind);
  byId("banner-action").addEventListener("click", () => bannerAction?.());
  byId("help-open").addEventListener("click", () => byId("help").showModal());
  byId("speed").addEventListener("input", () => actions.speed(10 ** Number(byId("speed").value)));
  byId("scenario").addEventListener("change", () => {
    describeScene();
    actions.newScene(chosenScene());
  });
  byId("solvers").addEventListener("change", () => actions.newScene(chosenScene()));
  byId("dice").addEventListener("click", () => {
    byId("seed").value = String(Math.floor(Math.random() * 1_000_000));
    actions.newScene(chosenScene());
  });
  byId("scene-form").addEventListener("submit", (event) => {
    event.preventDefault();
    actions.newScene(chosenScene());
  });
  for (const id of ["depth-start", "depth-end"]) byId(id).addEventListener("input", describeDepths);
  describeDepths();
  bindTools(actions);
  bindKeys(actions);
}

function bindTools(actions) {
  const buttons = [...byId("tools").children];
  for (const button of buttons) button.addEventListener("click", () => actions.tool(button.dataset.tool));
  // Arrow keys move within a radio group, as screen reader users expect.
  byId("tools").addEventListener("keydown", (event) => {
    const turn = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (turn === undefined) return;
    event.preventDefault();
    const shown = buttons.filter((button) => !button.hidden);
    const next = shown[(shown.indexOf(document.activeElement) + turn + shown.length) % shown.length];
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
    v: () => actions.tool("orbit"),
    "?": () => byId("help").showModal(),
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || byId("help").open) return;
    if (event.key === "Escape") {
      actions.escape();
      return;
    }
    // Fields keep their keys, and a focused button keeps the space bar.
    const inField = event.target.matches("input:not([type=range]), select, textarea");
    const pressesButton = event.key === " " && event.target.matches("button");
    const action = keys[event.key];
    if (inField || pressesButton || action === undefined) return;
    event.preventDefault();
    action();
  });
}
