// Puts the parts together: session -> stage, pointer -> steering -> session, all of them -> panels.

import { request } from "./net/api.js";
import { decodeFrame, decodeTypes, ProtocolError } from "./net/protocol.js";
import { SessionClient } from "./net/session.js";
import * as controls from "./panels/controls.js";
import * as livePanel from "./panels/live-panel.js";
import * as messages from "./panels/messages.js";
import { bindScene, chooseScene, PIPELINE, showScenarios } from "./panels/scene-panel.js";
import { asRung, chosenRung, chosenSolver, setModels, showChoice, showWho, solverFor } from "./panels/simulator-panel.js";
import { showSteering } from "./panels/steering-panel.js";
import { Hand } from "./sketch/hand.js";
import { StagePointer } from "./sketch/pointer.js";
import { depthOfWidth } from "./sketch/sketch.js";
import { Steering } from "./sketch/steering.js";
import { Stage } from "./stage/stage.js";

const query = new URLSearchParams(window.location.search);
const reducedMotion = window.matchMedia("(prefers-reduced-motion: reduce)");
const overlay = document.getElementById("overlay");
const capitalised = (text) => text.charAt(0).toUpperCase() + text.slice(1);
const asSeed = (text) => (/^\d{1,9}$/.test(text ?? "") ? Number(text) : 0);
const asSolver = (text) => (["hybrid", "neural"].includes(text) ? text : "mpm");
let chosen = {
  scenario: query.get("scenario") ?? "water_2d",
  seed: asSeed(query.get("seed")),
  solver: asSolver(query.get("solver")),
  rung: asRung(query.get("rung")),
};

let scene = null; // the scene of the hello message
let sessionId = null; // the session that the stage shows
let playing = null; // whether the session plays; null as long as that is unknown
let tool = "arrow";
let speed = 0.25; // simulated seconds per second that the player aims at
let centroid = null; // centre of mass, as the newest status says; null where there is no particle
let startsPlaying = false; // whether to play once the session is live: this page has created it
let preset = null; // like PIPELINE
let shown = 0; // frame on the stage
let speedTimer = 0;
let newestMessage = null; // the newest binary frame, as long as it has not been shown
let drawnTimes = []; // when pictures were drawn [ms]

const session = new SessionClient({ onState, onHello, onStatus, onProblem, onFrame });
const steering = new Steering({
  plan: (stroke) => session.steer(stroke),
  release: () => session.release().catch(messages.toast),
  dim: () => scene.dim,
  widths: controls.depthWidths,
  changed: refreshSteering,
  refused: messages.toast,
  planned: ({ needs }) => {
    if (needs.reachable) return;
    const detail = needs.obstructions.map(({ message }) => capitalised(message)).join(". ");
    messages.toast({ title: "Out of reach", detail: `${detail}.`, advice: "The fluid goes as near as it can.", hint: true });
  },
  tooSmall: () => messages.toast({ title: "That stroke is very short", advice: "Press, drag a few centimetres, release.", hint: true }),
});
const hand = new Hand({
  speed: () => speed,
  push: (push) => session.send({ type: "push", ...push }),
  end: () => session.send({ type: "push_end" }),
  changed: refreshSteering,
});
const stage = new Stage(document.getElementById("view"), steering, hand, query.get("renderer"));

function refreshSteering() {
  showSteering(steering, { live: session.state === "live", playing, dim: scene?.dim ?? 2, tool, centroid });
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
  const again = () => startScene(chosen);
  switch (state) {
    case "reconnecting":
      return {
        text: `The server does not answer. Trying again in ${seconds} s; the simulation resumes by itself.`,
        label: "Try now",
        action: () => session.retry(),
      };
    case "lost":
      return { text: "The server no longer has this simulation.", label: "Start a new one", action: again };
    case "failed":
      return { text: `The simulation could not be started. ${problem.title}.`, label: "Try again", action: again };
    default:
      return null;
  }
}

function onHello(hello) {
  // The server pauses a session that nobody watches, also while a connection is interrupted.
  const resumes = hello.session.id === sessionId && playing === true;
  if (hello.session.id !== sessionId) showSession(hello);
  speed = hello.session.speed;
  centroid = hello.session.centroid;
  controls.showSpeed(speed);
  livePanel.showStatus({ session: hello.session });
  showWho(hello.session, null);
  setPlaying(hello.session.playing);
  if (startsPlaying || resumes) session.send({ type: "play" });
  startsPlaying = false;
}

/** Show another session than before. One that was only interrupted keeps its camera, tool and sketch. */
function showSession(hello) {
  sessionId = hello.session.id;
  livePanel.showSession(sessionId);
  scene = hello.scene;
  stage.setScene(scene, decodeTypes(hello.types), hello.spacing);
  steering.clear();
  controls.showTools(scene.dim);
  chooseTool(scene.dim === 3 ? "orbit" : tool === "orbit" ? "arrow" : tool);
  if (!hello.session.scenario) return;
  const { scenario, seed, solver, rung } = hello.session;
  chosen = { scenario, seed, solver, rung };
  chooseScene(chosen);
  showChoice(chosen);
}

function onStatus(status) {
  livePanel.showStatus(status);
  showWho(status.session, status.history);
  speed = status.session.speed;
  centroid = status.session.centroid;
  steering.note(status.session.control);
  setPlaying(status.session.playing);
}

function setPlaying(value) {
  if (value === playing) return; // most status messages change nothing: no reason to draw again
  drawnTimes = [];
  playing = value;
  controls.showPlaying(value);
  refreshSteering();
}

function onProblem(problem) {
  messages.toast(problem);
}

function onFrame(buffer) {
  newestMessage = buffer; // an older one that has not been shown yet is skipped
}

function showNewest() {
  if (newestMessage === null || scene === null) return;
  try {
    const frame = decodeFrame(newestMessage);
    stage.show(frame);
    livePanel.showFrame(frame);
    messages.hideSkeleton();
    steering.follow(frame.frame);
    const isCue = preset !== null && shown < preset.frame && frame.frame >= preset.frame;
    shown = frame.frame;
    // Whoever draws is not interrupted.
    if (isCue && steering.phase === "idle") steering.present(preset.sketch);
    if (steering.plan !== null && steering.phase !== "done") refreshSteering();
  } catch (error) {
    if (!(error instanceof ProtocolError)) throw error;
    messages.toast({ title: "This page and the server do not match", detail: error.message, advice: "Reload the page." });
  } finally {
    newestMessage = null;
  }
}

function animate(now) {
  requestAnimationFrame(animate);
  showNewest();
  if (stage.draw(now)) drawnTimes.push(now);
}

/** Count the pictures of the last second; called twice a second. */
function measureDrawing() {
  const now = performance.now();
  drawnTimes = drawnTimes.filter((time) => now - time < 1000);
  livePanel.showDrawing(drawnTimes.length > 1 ? drawnTimes.length : null);
}

// ---- from the user ----

function startScene(wanted, itsPreset = null) {
  if (!Number.isInteger(wanted.seed) || wanted.seed < 0 || wanted.seed > 1_000_000_000) {
    messages.toast({ title: "The seed does not fit", advice: "Use a whole number from 0 to 1 000 000 000.", hint: true });
    return;
  }
  const solver = solverFor(wanted.scenario, wanted.solver ?? chosenSolver());
  const rung = wanted.rung === undefined ? chosenRung() : wanted.rung;
  chosen = { ...wanted, solver, rung: solver === "mpm" ? rung : null };
  showChoice(chosen);
  const address = new URL(window.location.href);
  for (const name of ["rung", "session", "preset"]) address.searchParams.delete(name);
  for (const [name, value] of Object.entries(chosen)) {
    if (value !== null) address.searchParams.set(name, String(value));
  }
  if (itsPreset !== null) address.searchParams.set("preset", "pipeline");
  window.history.replaceState(null, "", address);
  preset = itsPreset;
  shown = 0;
  steering.clear();
  newestMessage = null;
  startsPlaying = true;
  session.start(chosen);
}

function chooseTool(name) {
  if (name === "orbit" && scene?.dim !== 3) return;
  const switched = name !== tool;
  tool = name;
  controls.showTool(name);
  if (scene?.dim === 3 && switched) {
    stage.view.glideTo(name !== "orbit", performance.now(), !reducedMotion.matches);
  }
  refreshSteering();
}

/** A pointer's position as a point inside the world box. */
function sampleOf({ at, time }) {
  const clamp = (value) => Math.min(1, Math.max(0, value));
  return { point: stage.view.unproject(...at).map(clamp), time };
}

/** In 3D a hand pushes at the depth that a stroke would begin at. */
function inDepth({ point, time }) {
  if (scene.dim === 2) return { point, time };
  const { lower, upper } = scene.walls;
  return { point: [...point, lower[2] + depthOfWidth(controls.depthWidths()[0]) * (upper[2] - lower[2])], time };
}

const pointer = new StagePointer(overlay, {
  mode: () => (scene?.dim === 3 && tool === "orbit" ? "orbit" : "stroke"),
  begin: (sample) => {
    if (session.state !== "live") return;
    // Strokes are taken in the front view: whoever draws does not want to wait for the camera.
    if (stage.view.settle(Infinity)) stage.invalidateView();
    if (tool === "push") hand.begin(inDepth(sampleOf(sample)));
    else steering.begin(tool, sampleOf(sample));
  },
  extend: (samples) => {
    if (hand.point !== null) hand.extend(samples.map((sample) => inDepth(sampleOf(sample))));
    else steering.extend(samples.map(sampleOf));
  },
  finish: () => (hand.point === null ? steering.finish() : hand.finish()),
  cancel: () => (hand.point === null ? steering.clear() : hand.finish()),
  orbit: (dx, dy) => {
    stage.view.orbit(dx, dy);
    stage.invalidateView();
  },
  zoom: (factor) => {
    stage.view.zoomBy(factor);
    stage.invalidateView();
  },
});

controls.bindControls({
  play: () => session.send({ type: playing ? "pause" : "play" }),
  step: () => {
    if (playing) session.send({ type: "pause" });
    session.send({ type: "step", frames: 1 });
  },
  reset: () => {
    if (session.send({ type: "reset" })) steering.clear();
  },
  speed: (value) => {
    const wanted = Math.min(1, Math.max(0.01, value));
    controls.showSpeed(wanted);
    // A dragged slider reports every pixel; the server only needs the value where it rests.
    clearTimeout(speedTimer);
    speedTimer = setTimeout(() => session.send({ type: "speed", value: wanted }), 120);
  },
  tool: chooseTool,
  undo: () => steering.takeBack(),
  switchKind: () => steering.switchKind(),
  escape: () => {
    if (steering.phase === "drawing" || hand.point !== null) pointer.abort();
    else steering.takeBack();
  },
});

bindScene(startScene);
const startPreset = () => startScene(PIPELINE.scene, PIPELINE);
document.getElementById("pipeline").addEventListener("click", startPreset);

// ---- start ----

livePanel.showRenderer(stage.rendererKind);
controls.showTool(tool);
refreshSteering();
const modelsKnown = request("GET", "/v1/models").then(
  (answer) => setModels(answer.models),
  () => {
    // Without networks there is MPM.
  },
);
modelsKnown.then(() => {
  showChoice(chosen);
  document.getElementById("preset").hidden = solverFor(PIPELINE.scene.scenario) === "mpm";
});
if (query.get("preset") === "pipeline") modelsKnown.then(startPreset);
else if (query.has("session")) session.attach(query.get("session"));
else if (chosen.solver === "mpm") startScene(chosen);
else modelsKnown.then(() => startScene(chosen));
request("GET", "/v1/scenarios").then(
  (answer) => showScenarios(answer.scenarios, chosen),
  () => {
    // The session's own attempt to connect already tells the user that the server is away.
  },
);
requestAnimationFrame(animate);
setInterval(measureDrawing, 500);
window.addEventListener("pagehide", (event) => {
  if (!event.persisted) session.dispose();
});
