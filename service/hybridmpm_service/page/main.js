// Puts the parts together: session -> stage, pointer -> steering -> session, all of them -> panels.

import { request } from "./net/api.js";
import { Polled } from "./net/polled.js";
import { decodeFrame, decodeTypes, ProtocolError, SAND, WATER } from "./net/protocol.js";
import { SessionClient } from "./net/session.js";
import { bindAppearance, bindColours, offerPressure, showHighest } from "./panels/appearance.js";
import * as controls from "./panels/controls.js";
import * as livePanel from "./panels/live-panel.js";
import * as messages from "./panels/messages.js";
import { bindScene, chooseScene, showFindings, showOwnScene, showScenarios } from "./panels/scene-panel.js";
import { asCoarse, chosenCoarse, chosenSolver, clearTracks, setModels, showChoice, showWho, solverFor, trackForces, trackFrame } from "./panels/simulator-panel.js";
import { showSteering } from "./panels/steering-panel.js";
import { bindToolPanel, handCap, showFrameLength, sketchSettings, toggleForces } from "./panels/tool-panel.js";
import { PIPELINE, PIPELINE_3D, PIPELINES, Presenter, WELCOME } from "./presets.js";
import { Hand } from "./sketch/hand.js";
import { Steering } from "./sketch/steering.js";
import { lengthOf, scaled } from "./stage/units.js";
import { Stage } from "./stage/stage.js";
import { Tools } from "./tools.js";

const query = new URLSearchParams(window.location.search);
const reducedMotion = window.matchMedia("(prefers-reduced-motion: reduce)");
const capitalised = (text) => text.charAt(0).toUpperCase() + text.slice(1);
const hasLog = (hash) => hash.startsWith("#replay=");
const VOLUME_EVERY = 10; // shown frames from one measurement of the volume to the next
const isSeed = (text) => /^\d{1,9}$/.test(text);
const asSolver = (text) => (["hybrid", "neural"].includes(text) ? text : "mpm");
/** The session that the page shows. */
const shown = {
  chosen: {
    scenario: query.get("scenario") ?? "water_2d",
    seed: isSeed(query.get("seed") ?? "") ? Number(query.get("seed")) : 0,
    solver: asSolver(query.get("solver")),
    coarse: asCoarse(query.get("coarse")),
  },
  id: null,
  scene: null, // from the hello message, in lengths of its world
  length: 1, // longest side of the world [m]
  playing: null, // null as long as it is unknown
  speed: 0.25, // simulated seconds per second that the player aims at
  centroid: null, // centre of mass in the newest status; null where there is no particle
  startsPlaying: false, // whether to play once the session is live: this page has created it
  watches: false, // whether the page only shows a session of another visitor
  replays: false, // whether the session that is being created is a run computed again
  message: null, // the newest binary frame, until it is shown
  frames: 0, // number of frames that were shown
  who: null, // the body that the next sketches lead, {particle, name}; null where they lead everything
  drawnAt: [], // times of the pictures of the last second [ms]
  speedTimer: 0,
};

const session = new SessionClient({ onState, onHello, onStatus, onProblem, onFrame });
const steering = new Steering({
  plan: async (stroke, settings, signal) => {
    const plan = await session.steer(scaled(stroke, shown.length), settings, signal);
    return { ...plan, goal: scaled(plan.goal, 1 / shown.length) };
  },
  settings: () => (shown.who === null ? sketchSettings() : { ...sketchSettings(), who: { particle: shown.who.particle } }),
  release: () => session.release().catch(messages.toast),
  dim: () => shown.scene.dim,
  widths: controls.depthWidths,
  changed: refreshSteering,
  refused: messages.toast,
  planned: ({ needs }) => {
    if (needs.reachable) return;
    const detail = needs.obstructions.map(({ message }) => capitalised(message)).join(". ");
    messages.toast({ title: "Out of reach", detail: `${detail}.`, advice: "The fluid moves as near as possible.", hint: true });
  },
  tapped,
  tooSmall: () => messages.toast({ title: "The stroke is too short", advice: "Press, drag a few centimetres, release.", hint: true }),
});
const hand = new Hand({
  speed: () => shown.speed,
  cap: handCap,
  push: (push) => session.send({ type: "push", ...scaled(push, shown.length) }),
  end: () => session.send({ type: "push_end" }),
  changed: refreshSteering,
});
const presenter = new Presenter(steering);
const forces = new Polled({
  ask: async () => {
    const field = session.state === "live" ? await session.force() : null;
    return field?.points.length > 0 ? scaled(field, 1 / shown.length) : null;
  },
  changed: () => stage.invalidate(),
});
const stage = new Stage(document.getElementById("view"), { steering, hand, presenter, forces }, query.get("renderer"));
const tools = new Tools(document.getElementById("overlay"), {
  stage,
  steering,
  hand,
  isLive: () => session.state === "live" && !shown.watches,
  play: () => shown.playing || session.send({ type: "play" }),
  glides: () => !reducedMotion.matches,
  changed: refreshSteering,
});

/** Choose the body under a point, or everything where there is none; return whether that is a choice. */
function tapped(point) {
  const hit = stage.particleAt(point);
  if (hit === null && shown.who === null) return false;
  const name = { [WATER]: "water", [SAND]: "sand" }[hit?.type] ?? "jelly";
  shown.who = hit === null ? null : { particle: hit.particle, name };
  refreshSteering();
  return true;
}

function refreshSteering() {
  const ghost = presenter.ghost !== null;
  const centroid = shown.who === null ? shown.centroid : null; // that of all is not that of the body
  controls.showTool(ghost ? "oval" : tools.name);
  showSteering(steering, { live: session.state === "live", playing: shown.playing, tool: tools.name, centroid, ghost, who: shown.who?.name ?? null });
  stage.showCentroid(centroid);
  stage.invalidate();
}

// ---- from the server ----

function onState(state, { seconds, problem }) {
  messages.showState(state);
  messages.showBanner(bannerOf(state, seconds, problem));
  refreshSteering();
  if (state === "connecting") messages.showSkeleton("Connecting to the simulation");
  if (state === "failed") {
    messages.showSkeleton("No simulation");
    messages.toast(problem);
  }
}

function bannerOf(state, seconds, problem) {
  const again = () => startScene(shown.chosen);
  switch (state) {
    case "reconnecting":
      return {
        text: `The server does not answer. The next attempt is in ${seconds} s; the simulation then resumes.`,
        label: "Try now",
        action: () => session.retry(),
      };
    case "lost":
      return {
        text: shown.watches ? "This simulation has ended." : "This simulation no longer exists on the server.",
        label: shown.watches ? "Start your own" : "Start a new one",
        action: again,
      };
    case "failed":
      return { text: `The simulation could not be started. ${problem.title}.`, label: "Try again", action: again };
    default:
      return null;
  }
}

function onHello(hello) {
  // The server pauses a session without viewers, also while a connection is interrupted.
  const resumes = hello.session.id === shown.id && shown.playing === true;
  if (hello.session.id !== shown.id) showSession(hello);
  shown.speed = hello.session.speed;
  shown.centroid = scaled(hello.session, 1 / shown.length).centroid;
  controls.showSpeed(shown.speed);
  livePanel.showStatus({ session: hello.session });
  showWho(hello.session, null);
  offerPressure(hello.session.solver === "mpm");
  setPlaying(hello.session.playing);
  if (shown.replays) showReplay(hello.session);
  shown.replays = false;
  if (shown.startsPlaying || resumes) session.send({ type: "play" });
  shown.startsPlaying = false;
}

function showReplay({ frame, notice }) {
  const title = notice === null ? "Computed again with the same bits" : "Computed again with a different result";
  messages.toast({ title, detail: notice ?? `This is frame ${frame} of the run.`, advice: "Press play to continue.", hint: notice === null });
}

/** Show another session than before. One that was only interrupted keeps its camera, tool and sketch. */
function showSession(hello) {
  shown.id = hello.session.id;
  livePanel.showSession(shown.id);
  clearTracks();
  shown.length = lengthOf(hello.scene);
  shown.scene = scaled(hello.scene, 1 / shown.length);
  stage.setScene(shown.scene, decodeTypes(hello.types), hello.spacing / shown.length, shown.length);
  showFrameLength(shown.scene.frame_dt);
  shown.who = null;
  steering.clear();
  tools.setScene(shown.scene);
  showFindings(hello.session.findings);
  if (!hello.session.scenario) {
    showOwnScene(shown.scene.name || "Your scene");
    showChoice({ scenario: "", solver: hello.session.solver, coarse: hello.session.coarse });
    return;
  }
  const { scenario, seed, solver, coarse } = hello.session;
  shown.chosen = { scenario, seed, solver, coarse };
  chooseScene(shown.chosen);
  showChoice(shown.chosen);
}

function onStatus(status) {
  livePanel.showStatus(status);
  trackForces(status.session.frame, status.forces);
  showWho(status.session, status.history);
  shown.speed = status.session.speed;
  shown.centroid = scaled(status.session, 1 / shown.length).centroid;
  steering.note(status.session.control);
  setPlaying(status.session.playing);
}

function setPlaying(value) {
  if (value === shown.playing) return; // most status messages change nothing: no reason to draw again
  shown.drawnAt = [];
  shown.playing = value;
  controls.showPlaying(value);
  refreshSteering();
}

function onProblem(problem) {
  messages.toast(problem);
}

function onFrame(buffer) {
  shown.message = buffer; // an older one that has not been shown yet is skipped
}

function showNewest() {
  if (shown.message === null || shown.scene === null) return;
  try {
    const frame = decodeFrame(shown.message);
    stage.show(frame);
    livePanel.showFrame(frame);
    // The volume takes a pass over all particles, so one frame in so many has to do.
    trackFrame(frame, shown.frames++ % VOLUME_EVERY === 0 ? stage.volume : null);
    messages.hideSkeleton();
    steering.follow(frame.frame);
    presenter.follow(frame.frame, performance.now());
    if (steering.plan !== null && steering.phase !== "done") refreshSteering();
  } catch (error) {
    if (!(error instanceof ProtocolError)) throw error;
    messages.toast({ title: "The page and the server have different versions", detail: error.message, advice: "Reload the page." });
  } finally {
    shown.message = null;
  }
}

function animate(now) {
  requestAnimationFrame(animate);
  showNewest();
  if (presenter.animate(now)) refreshSteering();
  if (stage.draw(now)) shown.drawnAt.push(now);
}

/** Count the pictures of the last second; called twice a second. */
function measureDrawing() {
  const now = performance.now();
  shown.drawnAt = shown.drawnAt.filter((time) => now - time < 1000);
  livePanel.showDrawing(shown.drawnAt.length > 1 ? shown.drawnAt.length : null);
}

// ---- from the user ----

/**
 * Leave the session for another one, and play it.
 *
 * @param itsPreset sketch that draws itself, as in presets.js; null without one
 * @param plays whether it plays by itself
 */
function startScene(wanted, { itsPreset = null, plays = true } = {}) {
  if (!Number.isInteger(wanted.seed) || wanted.seed < 0 || wanted.seed > 1_000_000_000) {
    messages.toast({ title: "Invalid seed", advice: "Use a whole number from 0 to 1 000 000 000.", hint: true });
    return;
  }
  const solver = solverFor(wanted.scenario, wanted.solver ?? chosenSolver());
  const coarse = wanted.coarse === undefined ? chosenCoarse() : wanted.coarse;
  shown.chosen = { ...wanted, solver, coarse: solver === "mpm" ? coarse : null };
  showChoice(shown.chosen);
  const address = new URL(window.location.href);
  address.hash = "";
  for (const name of ["coarse", "session", "watch", "preset"]) address.searchParams.delete(name);
  for (const [name, value] of Object.entries(shown.chosen)) {
    if (value !== null) address.searchParams.set(name, String(value));
  }
  for (const [name, preset] of PIPELINES) {
    if (itsPreset === preset) address.searchParams.set("preset", name);
  }
  window.history.replaceState(null, "", address);
  presenter.set(itsPreset);
  setWatching(false);
  steering.clear();
  shown.message = null;
  shown.startsPlaying = plays;
  session.start(shown.chosen);
}

/** Show another visitor's session, without tools that change it, or end that. */
function setWatching(value) {
  shown.watches = value;
  document.body.dataset.watches = String(value);
  document.getElementById("watching").hidden = !value;
}

/** Leave the session for a scene or a run from a file, a link or the builder. */
function openOwn(body, hash = "") {
  const address = new URL(window.location.href);
  for (const name of ["scenario", "seed", "solver", "coarse", "session", "watch", "preset"]) address.searchParams.delete(name);
  address.hash = hash;
  window.history.replaceState(null, "", address);
  presenter.set(null);
  setWatching(false);
  steering.clear();
  shown.message = null;
  shown.startsPlaying = "scene" in body;
  shown.replays = "log" in body;
  session.start(body);
}

async function openLink(hash) {
  try {
    const { unpackedLog } = await import("./share/log-link.js");
    openOwn({ log: await unpackedLog(hash) }, hash);
  } catch {
    messages.toast({
      title: "This link is damaged",
      detail: "A part of the run in it is missing or changed.",
      advice: "Ask for a new link. The start scene is shown.",
    });
    startScene(WELCOME.scene, { plays: !reducedMotion.matches });
  }
}

controls.bindControls({
  play: () => session.send({ type: shown.playing ? "pause" : "play" }),
  step: () => {
    if (shown.playing) session.send({ type: "pause" });
    session.send({ type: "step", frames: 1 });
  },
  reset: () => {
    if (session.send({ type: "reset" })) steering.clear();
  },
  speed: (value) => {
    const wanted = Math.min(1, Math.max(0.01, value));
    controls.showSpeed(wanted);
    // A dragged slider reports every pixel; the server only needs the value where it rests.
    clearTimeout(shown.speedTimer);
    shown.speedTimer = setTimeout(() => session.send({ type: "speed", value: wanted }), 120);
  },
  tool: (name) => tools.choose(name),
  undo: () => steering.takeBack(),
  everyone: () => {
    shown.who = null;
    refreshSteering();
  },
  switchKind: () => steering.switchKind(),
  escape: () => tools.escape(),
  forces: toggleForces,
});

bindAppearance();
const pressures = new Polled({
  ask: async () =>
    session.state === "live" && shown.scene !== null ? scaled(await session.pressure(), 1 / shown.length) : null,
  changed: () => {
    stage.showPressure(pressures.latest);
    showHighest(stage.highest);
  },
});
bindColours((quantity) => {
  stage.colourBy(quantity);
  pressures.wanted = quantity === "pressure";
});
bindScene(async (wanted) => {
  if (wanted.scenario !== "") {
    startScene(wanted);
    return;
  }
  // A scene of your own stays; only its simulator changes.
  const log = await session.log();
  const coarse = chosenCoarse();
  openOwn({ scene: log.scene, ...(coarse === null ? {} : { coarse }) });
});
// Rarely used parts are loaded on demand.
const planned = {
  scene: () => ({ scenario: shown.chosen.scenario, seed: shown.chosen.seed }),
  start: (coarse) => startScene({ scenario: shown.chosen.scenario, seed: shown.chosen.seed, ...coarse }),
};
document.getElementById("planner-open").addEventListener("click", async () => {
  const { openPlanner } = await import("./plan/panel.js");
  openPlanner(planned);
});
document.getElementById("gallery-open").addEventListener("click", async () => {
  const { openGallery } = await import("./gallery/panel.js");
  const show = (preset) => startScene(preset.scene, { itsPreset: preset });
  openGallery({ open: openOwn, show, toast: messages.toast });
});
document.getElementById("build-open").addEventListener("click", async () => {
  const { openBuilder } = await import("./build/panel.js");
  openBuilder({ log: () => session.log(), open: openOwn });
});
const shared = { session, toast: messages.toast, open: openOwn, picture: () => stage.picture() };
document.getElementById("share").addEventListener("click", async ({ target }) => {
  const button = target.closest("button");
  if (button === null) return;
  const { share } = await import("./share/panel.js");
  share(button, shared);
});
document.getElementById("share-file").addEventListener("change", async ({ target }) => {
  const { openChosen } = await import("./share/panel.js");
  openChosen(target, shared);
});
bindToolPanel((wanted) => {
  forces.wanted = wanted;
});
for (const [id, preset] of PIPELINES) {
  document.getElementById(id).addEventListener("click", () => startScene(preset.scene, { itsPreset: preset }));
}
for (const kind of ["pointerdown", "keydown", "wheel"]) {
  document.addEventListener(kind, () => presenter.interrupt(), { capture: true, passive: true });
}

// ---- start ----

livePanel.showRenderer(stage.rendererKind);
refreshSteering();
const modelsKnown = request("GET", "/v1/models").then(
  (answer) => setModels(answer.models),
  () => {
    // Without networks there is MPM.
  },
);
modelsKnown.then(() => {
  showChoice(shown.chosen);
  document.getElementById("preset").hidden = solverFor(PIPELINE.scene.scenario) === "mpm";
  document.getElementById("pipeline-3d").hidden = solverFor(PIPELINE_3D.scene.scenario) === "mpm";
});
/** Begin with the scene in the address. Where motion is to be reduced, nothing plays by itself. */
function begin() {
  const plays = !reducedMotion.matches;
  if (query.has("seed") && !isSeed(query.get("seed"))) {
    messages.toast({
      title: "Invalid seed in the address",
      detail: `A seed is a whole number from 0 to 999 999 999, not "${query.get("seed").slice(0, 40)}".`,
      advice: "Seed 0 is shown. Choose another one in the scene panel.",
      hint: true,
    });
  }
  const hasAny = (...names) => names.some((name) => query.has(name));
  if (hasLog(window.location.hash)) {
    openLink(window.location.hash);
  } else if (PIPELINES.has(query.get("preset"))) {
    const preset = PIPELINES.get(query.get("preset"));
    modelsKnown.then(() => startScene(preset.scene, { itsPreset: preset, plays }));
  } else if (query.has("watch")) {
    setWatching(true);
    session.attach(query.get("watch"), { watches: true });
  } else if (query.has("session")) {
    session.attach(query.get("session"));
  } else if (!hasAny("scenario", "seed", "solver", "coarse")) {
    startScene(WELCOME.scene, { itsPreset: plays ? WELCOME : null, plays });
  } else if (shown.chosen.solver === "mpm") {
    startScene(shown.chosen, { plays });
  } else {
    modelsKnown.then(() => startScene(shown.chosen, { plays }));
  }
}
begin();
request("GET", "/v1/scenarios").then(
  (answer) => showScenarios(answer.scenarios, shown.chosen),
  () => {
    // The session's own attempt to connect already shows that the server is away.
  },
);
requestAnimationFrame(animate);
setInterval(measureDrawing, 500);
window.addEventListener("hashchange", () => {
  if (hasLog(window.location.hash)) openLink(window.location.hash);
});
window.addEventListener("pagehide", (event) => {
  if (!event.persisted) session.dispose();
});
