// The dialog for building a scene: things are placed by mouse, finger or keyboard, checked by the server, and simulated.

import { client } from "../net/api.js";
import { byId, setText } from "../panels/dom.js";
import { Draft } from "./draft.js";
import { showForm } from "./form.js";
import { bindHands } from "./hands.js";
import { drawDraft, focusThing, shadeDraft, VIEWS, viewOf } from "./picture.js";
import { unpacked } from "./rows.js";
import { freeRoom, indexIn, inWords, kindsOf, made, nameOf } from "./things.js";
import { yamlOf } from "./yaml.js";

const CHECK_MS = 700; // rest after a change before a check
const FIRST_SIZE = 0.16; // m, of a thing that a button adds

const ZOOM = 0.58; // of what is seen aslant
const TURN = 0.008; // rad for a pixel of a drag
const NUDGE = 0.1; // rad for an arrow key

const SURFACES = ["stl", "obj", "ply", "glb"]; // endings of files for 3D
const DRAWINGS = ["svg", "png"]; // and of flat ones

const QUICK = 20_000; // triangles that are shaded with each move of a hand
const REST_MS = 150; // rest after a move until more of them are shaded

const STORED = "hybridmpm.draft"; // name of the draft in the browser's storage

const state = {
  parts: null, // from openBuilder
  kind: null, // drawn by a drag on free ground
  timer: 0,
  checked: null, // the things of the newest check
  number: 0, // number of the newest check; answers to older ones are dropped
  reading: Promise.resolve(), // until files before have been read
  ofFile: false, // whether the status is about a file
  used: "front", // the picture that a hand was at last
  shaded: 0, // request of a picture
  resting: 0, // timer of one of many triangles
  yaw: 0.6, // from where the things in space are seen aslant [rad]
  pitch: 0.4,
};

const draft = new Draft(changed);
const pictures = { front: byId("build-picture"), top: byId("build-top") };
const picture = () => pictures[inSpace() ? state.used : "front"];
const inSpace = () => draft.base.dim === 3;
const view = (name) => viewOf(draft.base, draft.room, VIEWS[name]);

function changed() {
  if (draft.things !== state.checked) {
    state.checked = draft.things;
    checkSoon();
  }
  showKinds();
  drawDraft(pictures.front, view("front"), draft);
  if (inSpace()) {
    drawDraft(pictures.top, view("top"), draft);
    shadeSoon();
  }
  showForm(draft);
  byId("build-undo").disabled = !draft.canGoBack;
  for (const id of ["build-start", "build-save"]) byId(id).disabled = draft.things.length === 0;
}

/** Shade what is in space before the browser shows the next picture, surfaces of many triangles where no hand moves. */
function shadeSoon() {
  cancelAnimationFrame(state.shaded);
  clearTimeout(state.resting);
  const triangles = draft.things.reduce((sum, { record }) => sum + (record.triangles?.length ?? 0), 0);
  if (triangles > QUICK) state.resting = setTimeout(shadeNext, REST_MS);
  else shadeNext();
}

function shadeNext() {
  state.shaded = requestAnimationFrame(() => {
    if (!inSpace()) return;
    shadeDraft(byId("build-front-shades"), view("front"), draft);
    shadeDraft(byId("build-top-shades"), view("top"), draft);
    shadeDraft(byId("build-preview"), viewOf(draft.base, draft.room, aslant(), ZOOM), draft, true);
  });
}

/** Unit vectors to the right, upwards and towards the eye of the picture that a hand turns. */
function aslant() {
  const [cy, sy, cp, sp] = [Math.cos(state.yaw), Math.sin(state.yaw), Math.cos(state.pitch), Math.sin(state.pitch)];
  return [[cy, 0, -sy], [-sy * sp, cp, -cy * sp], [sy * cp, sp, cy * cp]];
}

function turnPreview(yaw, pitch) {
  state.yaw += yaw;
  state.pitch = Math.min(1.5, Math.max(-1.5, state.pitch + pitch));
  shadeSoon();
}

/** Check the draft some time after the latest change. */
function checkSoon() {
  clearTimeout(state.timer);
  state.number += 1;
  state.timer = setTimeout(check, CHECK_MS);
}

/** Keep the draft in the browser until it is simulated, or no longer: a reload, or a closed tab, loses nothing. */
function store(scene) {
  try {
    if (scene === null) localStorage.removeItem(STORED);
    else localStorage.setItem(STORED, JSON.stringify(scene));
  } catch {
    // Without storage it is kept as long as the page.
  }
}

/** The stored draft; null without one. */
function stored() {
  try {
    return JSON.parse(localStorage.getItem(STORED));
  } catch {
    return null;
  }
}

async function check() {
  const number = ++state.number;
  if (draft.edited) store(draft.scene);
  if (draft.things.length === 0) {
    showFindings([]);
    // What was wrong with a file stays: the check of an empty box may come after it.
    if (!state.ofFile) setText("build-status", "");
    return null;
  }
  state.ofFile = false;
  setText("build-status", "The scene is being checked.");
  try {
    const answer = await client.check({ scene: draft.scene });
    if (number === state.number) showAnswer(answer);
    return answer;
  } catch (problem) {
    if (number === state.number) setText("build-status", `${problem.title}. ${problem.detail} ${problem.advice}`);
    return null;
  }
}

function showAnswer(answer) {
  const faults = answer.findings.filter(({ severity }) => severity === "error");
  draft.mark(new Set(faults.map(indexOf)));
  showFindings(answer.findings.filter(({ severity }) => severity !== "note"));
  const cost = answer.milliseconds === null ? "" : `, ${Number(answer.milliseconds.toPrecision(2))} ms a frame`;
  setText("build-status", answer.ok && answer.particles !== null ? `Runs: ${answer.particles} particles${cost}.` : "This scene cannot run as it is.");
}

/** The index of the thing that a finding is about; -1 for the whole scene. */
function indexOf({ field, problem }) {
  const index = indexIn(field, draft.things);
  return index < 0 ? indexIn(problem, draft.things) : index;
}

function textOf({ field, problem, advice }) {
  const index = indexIn(field, draft.things);
  const noun = index >= 0 ? `“${nameOf(draft.things[index], draft.things)}” ` : field === "scene" ? "" : `${field}: `;
  return `${noun}${inWords(advice ? `${problem}; ${advice}` : problem, draft.things)}.`;
}

function showFindings(findings) {
  const items = findings.map((finding) => {
    const item = document.createElement("li");
    const index = indexOf(finding);
    item.textContent = textOf(finding);
    if (index < 0) return item;
    const button = document.createElement("button");
    Object.assign(button, { type: "button", className: "link", textContent: "Show" });
    button.addEventListener("click", () => {
      draft.select(index);
      focusThing(picture(), index);
    });
    item.append(" ", button);
    return item;
  });
  byId("build-findings").replaceChildren(...items);
  byId("build-findings").hidden = items.length === 0;
}

function add(name) {
  state.kind = name;
  for (const button of byId("build-kinds").children) button.setAttribute("aria-pressed", String(button.dataset.kind === name));
  draft.add(made(name, ...freeRoom(draft.base.walls, draft.things, FIRST_SIZE), draft.room));
  focusThing(picture(), draft.selected);
}

/** Say what became of a file, in sight on a phone, too. */
function tellOfFile(text) {
  state.ofFile = true;
  setText("build-status", text);
  byId("build-status").scrollIntoView({ block: "nearest" });
}

/** Add the shape in a drawing or a picture to a flat scene, that of a surface to one in space: one file after the other. */
function addFile(file) {
  // One that failed keeps no later one waiting.
  state.reading = state.reading.catch(() => {}).then(() => read(file));
  return state.reading;
}

async function read(file) {
  const kind = file.name.split(".").at(-1).toLowerCase();
  const dim = SURFACES.includes(kind) ? 3 : 2;
  if (![...SURFACES, ...DRAWINGS].includes(kind)) {
    tellOfFile(`${file.name} is not read: choose an SVG or PNG file, or, for 3D, an STL, OBJ, PLY or GLB file.`);
    return;
  }
  if (dim !== draft.base.dim) {
    if (draft.things.length > 0 && draft.edited) {
      tellOfFile(`${file.name} is ${dim === 3 ? "a surface, and this scene is flat" : "flat, and this scene is 3D"}: begin with “Empty ${dim === 3 ? "3D " : ""}box”.`);
      return;
    }
    draft.empty(dim);
  }
  tellOfFile(`${file.name} is being read.`);
  const [lower, upper] = freeRoom(draft.base.walls, draft.things, FIRST_SIZE);
  const [x, y, z] = lower.map((low, k) => (low + upper[k]) / 2);
  try {
    const { shape, vertices, triangles } = unpacked(await client.shape(file, kind, { height: FIRST_SIZE, x, y, ...(dim === 3 ? { z } : {}) }));
    if (dim !== draft.base.dim) {
      tellOfFile(`${file.name} is left out: the scene became ${dim === 3 ? "flat" : "3D"} while it was read.`);
      return;
    }
    draft.add({ part: "obstacles", record: dim === 3 ? { shape, vertices, triangles } : { shape, vertices } });
    focusThing(picture(), draft.selected);
  } catch (problem) {
    const large = `it has ${(file.size / 1e6).toFixed(1)} MB, more than the service takes; make it smaller`;
    tellOfFile(`${file.name} is not read: ${problem.status === 413 ? large : (problem.detail || problem.message).replace(/^body: /, "")}.`);
  }
}

/** Save the scene as a file. */
function save() {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([yamlOf(draft.scene)], { type: "application/yaml" }));
  link.download = `${draft.base.name.replaceAll(/[^\w-]+/g, "-") || "scene"}.yaml`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

async function start() {
  clearTimeout(state.timer);
  const answer = await check();
  if (answer === null || !answer.ok) {
    byId("build-status").focus();
    return;
  }
  byId("builder").close();
  store(null);
  state.parts.open({ scene: draft.scene });
}

/** Begin with the current scene. */
async function beginWithShown() {
  let scene;
  try {
    ({ scene } = await state.parts.log());
  } catch (problem) {
    setText("build-status", `The current scene cannot be read: ${problem.title}. This is an empty box.`);
    draft.empty(2);
    return;
  }
  draft.begin(scene);
}

/** Show what can be added in as many dimensions as the draft has. */
function showKinds() {
  const dim = String(draft.base.dim);
  if (byId("builder").dataset.dim === dim) return;
  byId("builder").dataset.dim = dim;
  state.kind = null;
  const buttons = Object.entries(kindsOf(draft.base.dim)).map(([name, { title }]) => {
    const button = document.createElement("button");
    Object.assign(button, { type: "button", className: `quiet ${name}`, textContent: title });
    button.dataset.kind = name;
    button.setAttribute("aria-pressed", "false");
    button.addEventListener("click", () => add(name));
    return button;
  });
  const hadFocus = byId("build-kinds").contains(document.activeElement);
  byId("build-kinds").replaceChildren(...buttons);
  if (hadFocus) buttons[0].focus();
  for (const one of document.querySelectorAll("#builder .in-space")) one.hidden = draft.base.dim === 2;
}

/** Let hands turn the picture that is seen aslant. */
function bindPreview() {
  const preview = byId("build-preview");
  preview.addEventListener("pointerdown", (event) => preview.setPointerCapture(event.pointerId));
  preview.addEventListener("pointermove", (event) => {
    if (preview.hasPointerCapture(event.pointerId)) turnPreview(-TURN * event.movementX, TURN * event.movementY);
  });
  preview.addEventListener("keydown", (event) => {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (way === undefined) return;
    turnPreview(NUDGE * way[0], NUDGE * way[1]);
    event.preventDefault();
  });
}

function bind() {
  showKinds();
  for (const [name, svg] of Object.entries(pictures)) {
    bindHands(svg, { draft, view: () => view(name), kind: () => state.kind });
    for (const one of ["pointerdown", "focusin"]) svg.addEventListener(one, () => (state.used = name), { capture: true });
    svg.addEventListener("dragover", (event) => event.preventDefault());
    svg.addEventListener("drop", async (event) => {
      event.preventDefault();
      const [file] = event.dataTransfer.files;
      if (file !== undefined) await addFile(file);
    });
  }
  bindPreview();
  new ResizeObserver(shadeSoon).observe(byId("builder"));
  byId("build-file").addEventListener("click", () => byId("build-chosen").click());
  byId("build-chosen").addEventListener("change", async ({ target }) => {
    const [file] = target.files;
    target.value = ""; // The same file may be chosen again.
    if (file !== undefined) await addFile(file);
  });
  byId("build-undo").addEventListener("click", () => draft.goBack());
  byId("build-delete").addEventListener("click", () => draft.remove());
  byId("build-empty").addEventListener("click", () => draft.empty(2));
  byId("build-empty-space").addEventListener("click", () => draft.empty(3));
  byId("build-save").addEventListener("click", save);
  byId("build-shown").addEventListener("click", beginWithShown);
  byId("build-start").addEventListener("click", start);
  byId("build-close").addEventListener("click", () => byId("builder").close());
  byId("builder").addEventListener("keydown", (event) => {
    if ((event.ctrlKey || event.metaKey) && event.key === "z" && event.target.tagName !== "INPUT") {
      draft.goBack();
      event.preventDefault();
    }
    event.stopPropagation(); // The page behind has its own keys.
  });
}

/** Load the look of the dialog, which pages without it do not need. */
function loadStyle() {
  const link = Object.assign(document.createElement("link"), { rel: "stylesheet", href: new URL("./style.css", import.meta.url).href });
  document.head.append(link);
  return new Promise((done) => (link.onload = link.onerror = done));
}

/**
 * Open the dialog with its earlier draft, be it of an earlier visit, or else with the current scene.
 *
 * @param given {log() -> promise of the session's log, open(body of POST /v1/sessions)}
 */
export async function openBuilder(given) {
  const first = state.parts === null;
  state.parts = given;
  if (first) {
    await loadStyle();
    bind();
  }
  byId("builder").showModal();
  if (!first) {
    changed();
    return;
  }
  const earlier = stored();
  if (earlier === null) {
    await beginWithShown();
    return;
  }
  draft.begin(earlier);
  draft.edited = true;
  const hint = byId("build-hint").textContent;
  setText("build-hint", `This is your earlier draft; “This scene” begins with the present simulation instead. ${hint}`);
}
