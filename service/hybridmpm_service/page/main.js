// Puts the parts together: session -> stage, pointer -> steering -> session, all of them -> panels.

import { goTo, keep, kept, placeOf } from "./address.js";
import { Problem } from "./client.js";
import { decodeFrame, decodeTypes, lengthOf, LIQUID, ProtocolError, SAND, WATER } from "./frames.js";
import { client } from "./net/api.js";
import { Keeper } from "./net/keeper.js";
import { onKeyNeeded, useLink } from "./net/key.js";
import { Polled } from "./net/polled.js";
import { Line } from "./net/line.js";
import { SessionClient } from "./net/session.js";
import { Silence } from "./net/silence.js";
import { bindAppearance, bindColours, offerPressure, showHighest } from "./panels/appearance.js";
import * as controls from "./panels/controls.js";
import * as livePanel from "./panels/live-panel.js";
import * as messages from "./panels/messages.js";
import { bindScene, chooseScene, describeOwnScene, SEA, showFindings, showOwnScene, showScenarios, titleOf } from "./panels/scene-panel.js";
import { chosenCoarse, chosenSolver, clearTracks, setModels, showChoice, showWho, solverFor, trackForces, trackFrame } from "./panels/simulator-panel.js";
import { showSteering } from "./panels/steering-panel.js";
import { bindToolPanel, handCap, pullStrength, showFrameLength, sketchSettings, toggleForces } from "./panels/tool-panel.js";
import { PIPELINE, PIPELINE_3D, PIPELINES, Presenter, WELCOME } from "./presets.js";
import { drawDepths } from "./sketch/depth.js";
import { Hand } from "./sketch/hand.js";
import { Seen } from "./sketch/seen.js";
import { widthOfDepth } from "./sketch/sketch.js";
import { Steering } from "./sketch/steering.js";
import { scaled, sidesOf } from "./stage/units.js";
import { Recent } from "./stage/recent.js";
import { Stage } from "./stage/stage.js";
import { Tools } from "./tools.js";

const query = new URLSearchParams(window.location.search);
const reducedMotion = window.matchMedia("(prefers-reduced-motion: reduce)");
const capitalised = (text) => text.charAt(0).toUpperCase() + text.slice(1);
const LONGEST_ADDRESS = 60_000; // that browsers and messengers pass on whole
const VOLUME_EVERY = 10; // shown frames from one measurement of the volume to the next
const linkIn = (hash) => new URLSearchParams(hash.slice(1)).get("link");
/** The scenario of a place, with what it leaves open. */
const choiceOf = ({ scenario = "water_2d", seed = 0, solver = "mpm", coarse = null }) => ({ scenario, seed, solver, coarse });
/** The session that the page shows. */
const shown = {
  place: {}, // where it is, as in address.js
  arrivals: 0, // number of the present place; what was asked for at another comes too late
  arriving: false, // whether the place is one that an address asked for, and has not been refused
  chosen: choiceOf({}),
  id: null,
  scene: null, // from the hello message, in lengths of its world
  length: 1, // longest side of the world [m]
  playing: null, // null as long as it is unknown
  speed: 0.25, // simulated seconds per second that the player aims at
  centroid: null, // centre of mass in the newest status; null where there is no particle
  startsPlaying: null, // whether to play once the session is live; null leaves it as it is
  watches: false, // whether the page only shows a session of another visitor
  replays: false, // whether the session that is being created is a run computed again
  message: null, // the newest binary frame, until it is shown
  frames: 0, // number of frames that were shown
  who: null, // the body that the next sketches lead, {particle, name}; null where they lead everything
  pace: 0, // frames a second that are computed
  drawnAt: [], // times of the pictures of the last second [ms]
  speedTimer: 0,
  lesson: null, // that of the gallery which is shown
  about: Promise.resolve(), // until what the gallery says of the scene is shown: a lesson reads all frames
};

let strip = null; // of sketches that are followed in turn
let tray = null; // promise of words and pictures to fill, which the tool Shape shows
const session = new SessionClient(
  { onState, onHello, onStatus, onProblem, onFrame, onHome: livePanel.showHome, lengthOf },
  query.get("simulate") !== "server",
);
const steering = new Steering({
  plan: async (stroke, settings, signal) => {
    const plan = await session.steer(scaled(stroke, shown.length), settings, signal);
    return { ...plan, goal: scaled(plan.goal, 1 / shown.length) };
  },
  goal: async () => scaled((await session.sketch())?.goal ?? null, 1 / shown.length),
  collected: (sketch, stroke) => strip?.takes(sketch, stroke, drawnSettings()) ?? false,
  settings: drawnSettings,
  release: () => session.release().catch(messages.toast),
  dim: () => shown.scene.dim,
  widths: controls.depthWidths,
  // What waits for its turn begins where the goal before it is.
  isBeside: (point) => !strip?.shows && shown.who === null && stage.particleAt(point) === null,
  middle: middleOf,
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
  isHere: () => session.isHere,
  push: (push) => session.send({ type: "push", ...scaled(push, shown.length) }),
  pull: (pull) => session.send({ type: "pull", ...scaled(pull, shown.length), strength: pullStrength(shown.scene, shown.length) }),
  end: () => session.send({ type: "push_end" }),
  changed: refreshSteering,
});
const presenter = new Presenter(steering);
const seen = new Seen({
  sketch: async () => scaled(await session.sketch(), 1 / shown.length),
  changed: () => {
    document.body.dataset.seen = seen.sketch?.kind ?? "";
    document.body.dataset.hand = String(seen.hand !== null);
    stage.invalidate();
  },
});
const forces = new Polled({
  ask: async () => {
    const field = session.state === "live" ? await session.force() : null;
    return field?.points.length > 0 ? scaled(field, 1 / shown.length) : null;
  },
  changed: () => stage.invalidate(),
});
const view = document.getElementById("view");
const layer = (id) => document.getElementById(id);
const stage = new Stage(
  { backdrop: layer("backdrop"), particles: layer("particles"), overlay: layer("overlay") },
  { steering, hand, presenter, seen, forces },
  query.get("renderer"),
  (aspect) => {
    document.documentElement.style.setProperty("--aspect", aspect);
    return view.clientWidth;
  },
);
new ResizeObserver(() => stage.resize()).observe(view);
const recent = new Recent();
const tools = new Tools(document.getElementById("overlay"), {
  stage,
  steering,
  hand,
  isLive: () => session.state === "live" && !shown.watches,
  play: () => shown.playing || session.send({ type: "play" }),
  glides: () => !reducedMotion.matches,
  changed: refreshSteering,
});

/** Settings of the next sketch. */
function drawnSettings() {
  return shown.who === null ? sketchSettings() : { ...sketchSettings(), who: { particle: shown.who.particle } };
}

/** The middle of the fluid, {point, width of a stroke at its depth}; null where there is none. */
function middleOf() {
  const { centroid, scene } = shown;
  if (centroid === null) return null;
  const { lower, upper } = scene.walls;
  const width = scene.dim === 3 ? widthOfDepth((centroid[2] - lower[2]) / (upper[2] - lower[2])) : controls.depthWidths()[0];
  return { point: centroid.slice(0, 2), width };
}

/** Choose the body under a point, or everything where there is none; return whether that is a choice. */
function tapped(point) {
  const hit = stage.particleAt(point);
  if (hit === null && shown.who === null) return false;
  const name = { [WATER]: "water", [SAND]: "sand", [LIQUID]: "liquid" }[hit?.type] ?? "jelly";
  shown.who = hit === null ? null : { particle: hit.particle, name };
  refreshSteering();
  return true;
}

function refreshSteering() {
  showTray(tools.name === "shape" && !shown.watches);
  strip?.note(steering.keyframe);
  const ghost = presenter.ghost !== null;
  const centroid = shown.who === null ? shown.centroid : null; // that of all is not that of the body
  controls.showTool(ghost ? "oval" : tools.name);
  showSteering(steering, { live: session.state === "live", playing: shown.playing, tool: tools.name, centroid, ghost, who: shown.who?.name ?? null, alone: document.body.dataset.solver === "neural", bodies: shown.scene?.solids.length > 0 });
  document.body.dataset.held = String(hand.held?.body ?? "");
  stage.showCentroid(centroid);
  stage.invalidate();
}

/** Show words and pictures to fill, or hide them. */
function showTray(wanted) {
  if (wanted === !document.getElementById("outlines").hidden || (!wanted && tray === null)) return;
  document.getElementById("outlines").hidden = !wanted;
  tray ??= import("./turn/outlines.js").then(({ Outlines }) => {
    const metres = () => shown.length;
    return new Outlines(document.getElementById("outlines"), {
      walls: () => shown.scene.walls,
      trace: async ({ center, height, ...source }, signal) => {
        const request = { ...source, center: center.map((x) => x * metres()), height: height * metres() };
        const { sketch, area } = await client.outlines(request, { signal });
        return { outlines: scaled(sketch, 1 / metres()).outlines, area: area / metres() ** 2 };
      },
      area: () => (shown.scene.dim === 2 ? stage.volume : null),
      propose: (shape) => steering.propose(shape),
      withdraw: () => steering.phase === "proposed" && steering.clear(),
      accept: () => steering.accept(),
      refused: messages.toast,
    });
  });
  if (!wanted) tray.then((one) => one.forget());
}

// ---- to the page around this one, where it is shown by an element ----

let host = null;
const isFramed = query.get("element") === "1" && window.parent !== window;
const hostKnown = isFramed
  ? import("./net/host.js").then(({ Host }) => {
      host = new Host({ command: (message) => session.send(message), present: () => session });
      return host;
    })
  : null;
const tellHost = (type, detail) => host?.tell(type, detail);
const problemOf = ({ title, detail, status, type }) => ({ title, detail, status, type });

// ---- from the server ----

const keeper = new Keeper(() => session.log());
const line = new Line();
const silence = new Silence(() => {
  if (session.state === "live") onState("live", {});
});

function onState(state, { seconds, problem, deleted }) {
  if (state !== "live") silence.hear();
  const log = state === "lost" && !deleted && ![401, 403].includes(problem?.status) && ownsSession() ? keeper.logOf(shown.id) : null;
  if (log !== null) {
    computeAgain(log);
    return;
  }
  messages.showState(state, silence.is);
  tellHost("state", state);
  if (problem) tellHost("problem", problemOf(problem));
  messages.showBanner(bannerOf(state, seconds, problem));
  refreshSteering();
  if (state === "connecting") messages.showSkeleton("Connecting to the simulation");
  if (state === "failed" && shown.arriving && problem.status === 422) {
    // An address that was mistyped, or is of another server.
    startInstead({ title: "The address cannot be shown", detail: problem.detail });
  } else if (state === "failed") {
    messages.showSkeleton("No simulation");
    messages.toast(problem);
  }
}

function bannerOf(state, seconds, problem) {
  // The session of a link does not come back; what the address names does.
  const again = () => (shown.place.watch ?? shown.place.session) === undefined ? arrive() : startScene(shown.chosen);
  switch (state) {
    case "reconnecting":
      return {
        text: `The server does not answer. The page tries again every ${seconds} s, and goes on where it was.`,
        label: "Try now",
        action: () => session.retry(),
      };
    case "live":
      if (!silence.is) return null;
      return {
        text: "No answer for more than 2 s. The picture stands still, and goes on with the next answer.",
        label: "Reload",
        action: () => window.location.reload(),
      };
    case "lost":
      return {
        text: problem?.status === 401 ? `${capitalised(problem.detail)}.` : shown.watches ? "This simulation has ended." : "This simulation no longer exists on the server.",
        label: shown.watches ? "Start your own" : "Start a new one",
        action: again,
      };
    case "failed":
      return { text: `The simulation could not be started. ${problem.title}.`, label: "Try again", action: again };
    default:
      return null;
  }
}

/** Whether the session is of this page, which then keeps it. */
const ownsSession = () => !shown.watches && shown.place.session === undefined;

/** Let the server compute the session again that it has lost, as far as its log was kept. */
function computeAgain(log) {
  const played = shown.playing === true || (shown.playing === null && kept().plays === true);
  take(shown.place);
  shown.startsPlaying = played;
  messages.showSkeleton("Computing the simulation again");
  messages.toast({
    title: "The server had lost this simulation",
    detail: `It is computed again to frame ${log.frame}, with the same bits.`,
    hint: true,
  });
  session.start({ log });
}

function onHello(hello) {
  silence.hear();
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
  const plays = shown.startsPlaying ?? (resumes ? true : null);
  // A command also keeps a session that the page had left for a moment.
  if (plays !== null) shown.about.then(() => hello.session.id === shown.id && session.send({ type: plays ? "play" : "pause" }));
  shown.startsPlaying = null;
  shown.arriving = false;
  if (ownsSession()) keep({ session: shown.id });
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
  recent.clear();
  shown.length = lengthOf(hello.scene);
  shown.scene = { ...scaled(hello.scene, 1 / shown.length), solids: scaled(hello.rigid, 1 / shown.length) };
  stage.setScene(shown.scene, decodeTypes(hello.types), hello.spacing / shown.length, shown.length);
  showFrameLength(shown.scene.frame_dt);
  shown.who = null;
  steering.clear();
  tools.setScene(shown.scene);
  // What a show piece costs is no fault of the visitor.
  const isShown = ({ severity }) => severity !== "note" || shown.place.gallery === undefined;
  showFindings(hello.session.findings.filter(isShown));
  const { scenario: from, seed: drawn } = hello.session;
  document.title = `${from ? `${titleOf(from)}, seed ${drawn}` : capitalised(shown.scene.name || "your scene")} - hybridmpm`;
  shown.lesson = null;
  shown.about = Promise.resolve();
  document.getElementById("lesson").hidden = true;
  if (!hello.session.scenario) {
    showOwnScene(shown.scene.name || "Your scene");
    if (shown.place.gallery !== undefined) shown.about = showAbout(shown.place.gallery, hello);
    showChoice({ scenario: "", solver: hello.session.solver, coarse: hello.session.coarse });
    return;
  }
  const { scenario, seed, solver, coarse } = hello.session;
  shown.chosen = { scenario, seed, solver, coarse };
  chooseScene(shown.chosen);
  showChoice(shown.chosen);
}

/** Show what the gallery says of a scene; a lesson has a card of its own, and its speed at the start. */
async function showAbout(name, { session: { id, frame }, spacing }) {
  const { aboutOf } = await import("./gallery/panel.js");
  const about = await aboutOf(name).catch(() => null);
  if (about === null || id !== shown.id) return;
  describeOwnScene(`${about.about} Try: ${about.try}`);
  if (about.measure === undefined) return;
  const { Lesson } = await import("./lesson/panel.js");
  if (id !== shown.id) return;
  shown.lesson = new Lesson(about, spacing);
  if (frame === 0) session.send({ type: "speed", value: about.speed });
}

function onStatus(status) {
  silence.hear();
  tellHost("status", status.session);
  if (ownsSession()) keeper.note(status.session);
  livePanel.showStatus(status);
  shown.pace = status.session.playing ? status.time_scale / status.session.frame_dt : 0;
  trackForces(status.session.frame, status.forces);
  showWho(status.session, status.history);
  shown.speed = status.session.speed;
  shown.centroid = scaled(status.session, 1 / shown.length).centroid;
  steering.note(status.session.control);
  seen.note(status.session.control, steering.sketch !== null);
  seen.noteHand(scaled(status.hand, 1 / shown.length), hand.rested, performance.now());
  setPlaying(status.session.playing);
}

function setPlaying(value) {
  if (value === shown.playing) return; // most status messages change nothing: no reason to draw again
  shown.drawnAt = [];
  shown.playing = value;
  controls.showPlaying(value);
  keep({ plays: value });
  refreshSteering();
}

function onProblem(problem) {
  messages.toast(problem);
  tellHost("problem", problemOf(problem));
}

function onFrame(buffer) {
  silence.hear();
  line.take(performance.now());
  shown.message = buffer; // an older one that has not been shown yet is skipped
}

function showNewest() {
  if (shown.message === null || shown.scene === null) return;
  try {
    const frame = decodeFrame(shown.message);
    stage.show(frame);
    livePanel.showFrame(frame);
    tellHost("frame", { number: frame.frame, time: frame.time });
    shown.lesson?.note(frame);
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
  if (seen.animate(now)) stage.invalidate();
  if (!stage.draw(now)) return;
  shown.drawnAt.push(now);
  recent.note(now, () => stage.moment);
  if (shown.scene?.dim === 3 && tools.name !== "orbit") {
    const { sketch, plan } = steering;
    drawDepths(document.getElementById("depth-map"), shown.scene, { frame: stage.frame, sketch, plan }, controls.depthWidths());
  }
}

/** Count the pictures of the last second, and notice silence; called twice a second. */
function measureDrawing() {
  if (session.state === "live") silence.listen();
  const now = performance.now();
  shown.drawnAt = shown.drawnAt.filter((time) => now - time < 1000);
  const isSent = session.state === "live" && !session.isHere && !document.hidden;
  livePanel.showDrawing(shown.drawnAt.length > 1 ? shown.drawnAt.length : null, line.slow(now, isSent ? shown.pace : 0));
}

// ---- from the user ----

/**
 * Leave the session for another one.
 *
 * @param place where the other one is, as in address.js
 * @param body of POST /v1/sessions
 * @param itsPreset sketch that draws itself, as in presets.js; null without one
 * @param plays whether it plays by itself
 * @param replaces whether the present entry of the browser's history is replaced
 */
function start(place, body, { itsPreset = null, plays = true, replaces = false } = {}) {
  const arrival = take(place, itsPreset);
  useLink(null); // it shows the session of another alone
  const isOwn = place.gallery === undefined && body.scenario === undefined;
  goTo(place, isOwn ? { own: body } : {}, { replaces });
  shown.arriving = replaces;
  shown.startsPlaying = plays;
  shown.replays = "log" in body;
  // A dialog that was closed by a choice gives the keys to the picture, not back to its button.
  if (document.activeElement.ariaHasPopup === "dialog") document.getElementById("overlay").focus({ preventScroll: true });
  session.start(body);
  return arrival;
}

/** Take the picture for another session; returns the number of the place. */
function take(place, itsPreset = null) {
  shown.place = place;
  shown.message = null;
  presenter.set(itsPreset);
  setWatching(place.watch !== undefined);
  steering.clear();
  shown.arrivals += 1;
  return shown.arrivals;
}

/** Leave the session for a scenario, with the options of `start` and, for presets, their names in the address. */
function startScene(wanted, options = {}, names = {}) {
  if (!Number.isInteger(wanted.seed) || wanted.seed < 0 || wanted.seed > 1_000_000_000) {
    messages.toast({ title: "Invalid seed", advice: "Use a whole number from 0 to 1 000 000 000.", hint: true });
    return;
  }
  const { scenario, seed } = wanted;
  const solver = solverFor(scenario, wanted.solver ?? chosenSolver());
  const coarse = wanted.coarse === undefined ? chosenCoarse() : wanted.coarse;
  shown.chosen = { scenario, seed, solver, coarse: solver === "mpm" ? coarse : null };
  showChoice(shown.chosen);
  start({ ...shown.chosen, ...names }, shown.chosen, options);
}

/** Start a preset, whose name the address has. */
function startPreset(preset, options = {}) {
  const [name] = [...PIPELINES].find(([, one]) => one === preset) ?? [];
  startScene(preset.scene, { itsPreset: preset, ...options }, { preset: name });
}

/** Show another visitor's session, without tools that change it, or end that. */
function setWatching(value) {
  shown.watches = value;
  document.body.dataset.watches = String(value);
  document.getElementById("watching").hidden = !value;
}

/**
 * Leave the session for a scene or a run from the gallery, a file or the builder.
 *
 * @param body of POST /v1/sessions
 * @param place where it is; a scene without one gets an address that contains it
 */
async function openOwn(body, place = {}, { plays = true, replaces = false } = {}) {
  const isScene = "scene" in body;
  const arrival = start(place, body, { plays: isScene && plays, replaces });
  if ([place.gallery, place.packed, place.replay].some((one) => one !== undefined)) return;
  const { packed } = await import("./share/log-link.js");
  const hash = `#${isScene ? await packed("scene", body) : await packed("replay", body.log)}`;
  // What is too large for an address stays beside it, in this tab.
  if (arrival !== shown.arrivals || hash.length > LONGEST_ADDRESS) return;
  shown.place = { ...place, [isScene ? "packed" : "replay"]: hash };
  goTo(shown.place, kept(), { replaces: true });
}

/** Show the start scene, and say why it is shown. */
function startInstead({ title, detail }) {
  messages.toast({ title, detail, advice: "The start scene is shown.", hint: true });
  startScene(WELCOME.scene, { plays: !reducedMotion.matches, replaces: true });
  shown.arriving = false;
}

// ---- from the address ----

const DAMAGED = {
  replay: ["This link is damaged", "A part of the run in it is missing or changed. Ask for a new link."],
  packed: ["This link is damaged", "A part of the scene in it is missing or changed. Ask for a new link."],
  gallery: ["Not in the gallery", "The gallery has no scene of the name in the address."],
  demo: ["Not in the gallery", "The gallery has no demonstration of the name in the address."],
};

/** What is at a place: {body} or {preset}; null for a scenario. */
async function contentOf(place) {
  if (place.replay !== undefined || place.packed !== undefined) {
    const { unpacked } = await import("./share/log-link.js");
    const value = await unpacked(place.replay ?? place.packed);
    return { body: place.replay === undefined ? value : { log: value } };
  }
  const { demonstration, exhibit } = await import("./gallery/panel.js");
  if (place.demo !== undefined) return { preset: await demonstration(place.demo) };
  const { scene, coarse } = await exhibit(place.gallery);
  const level = place.coarse ?? coarse;
  return { body: level === undefined ? { scene } : { scene, coarse: level } };
}

/** Show what the address asks for. Where motion is to be reduced, nothing plays by itself. */
async function arrive() {
  useLink(linkIn(window.location.hash));
  const { place, faults } = placeOf(new URL(window.location.href));
  for (const fault of faults) messages.toast({ ...fault, hint: true });
  const { session: running, plays: played, own } = kept();
  const plays = !reducedMotion.matches;
  const options = { plays, replaces: true };
  const arrival = take(place);
  shown.arriving = true;
  shown.chosen = choiceOf(place);
  if (running !== undefined && (await goesOn(running))) {
    if (arrival !== shown.arrivals) return;
    shown.startsPlaying = played === true;
    session.attach(running, { owned: true });
    return;
  }
  if (arrival !== shown.arrivals) return;
  const log = running === undefined ? null : keeper.logOf(running);
  if (log !== null) {
    computeAgain(log);
    return;
  }
  const special = Object.keys(DAMAGED).find((name) => place[name] !== undefined);
  if (own !== undefined) {
    openOwn(own, place, options);
  } else if (special !== undefined) {
    messages.showSkeleton("Opening the scene");
    try {
      const { body, preset } = await contentOf(place);
      if (arrival !== shown.arrivals) return;
      if (preset === undefined) openOwn(body, place, options);
      else startScene(preset.scene, { itsPreset: preset, ...options }, { demo: place.demo });
    } catch (problem) {
      if (arrival !== shown.arrivals) return;
      const [title, detail] = DAMAGED[special];
      startInstead(problem instanceof Problem && problem.status !== 404 ? problem : { title, detail });
    }
  } else if (place.preset !== undefined) {
    const preset = PIPELINES.get(place.preset);
    if (preset === undefined) startInstead({ title: "Unknown preset in the address", detail: `There is ${[...PIPELINES.keys()].join(" and ")}.` });
    else modelsKnown.then(() => startPreset(preset, options));
  } else if (place.watch !== undefined || place.session !== undefined) {
    session.attach(place.watch ?? place.session, { watches: place.watch !== undefined });
  } else if (Object.keys(place).length === 0) {
    startScene(WELCOME.scene, { ...options, itsPreset: plays && faults.length === 0 ? WELCOME : null });
  } else {
    if (shown.chosen.solver !== "mpm") await modelsKnown;
    if (arrival === shown.arrivals) startScene(shown.chosen, options);
  }
}

/** Whether the server still has a session. */
async function goesOn(id) {
  try {
    await client.session(id);
    return true;
  } catch (problem) {
    return problem.status !== 404;
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
  depth: () => {
    steering.deepen();
    refreshSteering();
  },
});

bindAppearance();
if (query.get("controls") === "0") document.body.dataset.controls = "off";
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
  if (wanted.scenario === SEA) {
    const { openExhibit } = await import("./gallery/panel.js");
    openExhibit(SEA, shared);
    return;
  }
  if (wanted.scenario !== "") {
    startScene(wanted);
    return;
  }
  // A scene of your own stays; only its simulator changes.
  const log = await session.log();
  const coarse = chosenCoarse();
  const { gallery } = shown.place;
  openOwn({ scene: log.scene, ...(coarse === null ? {} : { coarse }) }, gallery === undefined ? {} : { gallery, coarse });
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
  const show = (preset, demo) => startScene(preset.scene, { itsPreset: preset }, { demo });
  openGallery({ open: openOwn, show, toast: messages.toast });
});
document.getElementById("build-open").addEventListener("click", async () => {
  const { openBuilder } = await import("./build/panel.js");
  openBuilder({ log: () => session.log(), open: openOwn });
});
const shared = { session, toast: messages.toast, open: openOwn, stage, recent };
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
document.getElementById("collect").addEventListener("change", async ({ target }) => {
  const { Strip } = await import("./turn/strip.js");
  strip ??= new Strip(document.getElementById("turn"), {
    sides: () => sidesOf(shown.scene),
    follow: (keyframes) => {
      if (!shown.playing) session.send({ type: "play" });
      steering.inTurn(keyframes, { strength: sketchSettings().strength });
    },
    left: () => steering.left,
    full: (most) => messages.toast({ title: "The strip is full", detail: `${most} sketches may wait.`, hint: true }),
  });
  strip.show(target.checked);
});
for (const [id, preset] of PIPELINES) {
  document.getElementById(id).addEventListener("click", () => startPreset(preset));
}
for (const kind of ["pointerdown", "keydown", "wheel"]) {
  document.addEventListener(kind, () => presenter.interrupt(), { capture: true, passive: true });
}

// ---- start ----

onKeyNeeded(async (refused) => {
  const given = await (await hostKnown)?.key();
  if (given) return given;
  const { askForKey } = await import("./panels/key-panel.js");
  return askForKey(refused);
});
livePanel.showRenderer(stage.rendererKind);
refreshSteering();
useLink(linkIn(window.location.hash));
const modelsKnown = client.models().then(
  setModels,
  () => {
    // Without networks there is MPM.
  },
);
modelsKnown.then(() => {
  showChoice(shown.chosen);
  document.getElementById("preset").hidden = solverFor(PIPELINE.scene.scenario) === "mpm";
  document.getElementById("pipeline-3d").hidden = solverFor(PIPELINE_3D.scene.scenario) === "mpm";
});
arrive();
client.scenarios().then(
  (scenarios) => showScenarios(scenarios, shown.chosen),
  () => {
    // The session's own attempt to connect already shows that the server is away.
  },
);
requestAnimationFrame(animate);
setInterval(measureDrawing, 500);
// The browser's Back and Forward, and a link that changes the part behind the # alone.
window.addEventListener("popstate", arrive);
window.addEventListener("pagehide", (event) => {
  if (!event.persisted) session.dispose();
});
