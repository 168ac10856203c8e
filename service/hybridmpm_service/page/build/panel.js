// The dialog for building a scene: things are placed by mouse, finger or keyboard, checked by the server, and simulated.

import { client } from "../net/api.js";
import { byId, setText } from "../panels/dom.js";
import { Draft } from "./draft.js";
import { showForm } from "./form.js";
import { bindHands } from "./hands.js";
import { drawDraft, focusThing, viewOf } from "./picture.js";
import { freeRoom, indexIn, inWords, KINDS, made, nameOf } from "./things.js";

const CHECK_MS = 700; // rest after a change before a check
const FIRST_SIZE = 0.16; // m, of a thing that a button adds

const SURFACES = ["stl", "obj", "ply", "glb"]; // endings of files for 3D

const STORED = "hybridmpm.draft"; // name of the draft in the browser's storage

const state = {
  parts: null, // from openBuilder
  kind: null, // drawn by a drag on free ground
  timer: 0,
  checked: null, // the things of the newest check
  number: 0, // number of the newest check; answers to older ones are dropped
  ofFile: false, // whether the status is about a file
};

const draft = new Draft(changed);
const picture = () => byId("build-picture");
const view = () => viewOf(draft.base.walls);

function changed() {
  if (draft.things !== state.checked) {
    state.checked = draft.things;
    checkSoon();
  }
  drawDraft(picture(), view(), draft);
  showForm(draft);
  byId("build-undo").disabled = !draft.canGoBack;
  byId("build-start").disabled = draft.things.length === 0;
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
  draft.add(made(name, ...freeRoom(draft.base.walls, draft.things, FIRST_SIZE)));
  focusThing(picture(), draft.selected);
}

/** Add the shape in a drawing or a picture; that of a surface is simulated at once, for the picture here is flat. */
async function addFile(file) {
  const kind = file.name.split(".").at(-1).toLowerCase();
  const [[left, bottom], [right, top]] = freeRoom(draft.base.walls, draft.things, FIRST_SIZE);
  state.ofFile = true;
  setText("build-status", `${file.name} is being read.`);
  try {
    if (SURFACES.includes(kind)) {
      const scene = spaceAround(await client.shape(file, kind, { height: 0.3, x: 0.5, y: 0.3, z: 0.5 }));
      byId("builder").close();
      state.parts.open({ scene });
      return;
    }
    const { shape, vertices } = await client.shape(file, kind, { height: FIRST_SIZE, x: (left + right) / 2, y: (bottom + top) / 2 });
    draft.add({ part: "obstacles", record: { shape, vertices } });
    focusThing(picture(), draft.selected);
  } catch (problem) {
    setText("build-status", `${file.name} is not read: ${problem.detail}.`);
  }
}

/** A scene in space in which water falls on a surface. */
function spaceAround({ shape, vertices, triangles }) {
  const water = { shape: "box", material: "water", lower: [0.25, 0.62, 0.25], upper: [0.75, 0.85, 0.75] };
  return { name: "water on a surface", dim: 3, resolution: 40, bodies: [water], obstacles: [{ shape, vertices, triangles }] };
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

/** Begin with the current scene, if it is flat. */
async function beginWithShown() {
  try {
    const { scene } = await state.parts.log();
    if (scene.dim === 2) {
      draft.begin(scene);
      return;
    }
    setText("build-status", "The current scene is 3D, and this builder is flat: it begins with an empty box.");
  } catch (problem) {
    setText("build-status", `The current scene cannot be read: ${problem.title}. This is an empty box.`);
  }
  draft.begin(null);
}

function bind() {
  const buttons = Object.entries(KINDS).map(([name, { title }]) => {
    const button = document.createElement("button");
    Object.assign(button, { type: "button", className: `quiet ${name}`, textContent: title });
    button.dataset.kind = name;
    button.setAttribute("aria-pressed", "false");
    button.addEventListener("click", () => add(name));
    return button;
  });
  byId("build-kinds").replaceChildren(...buttons);
  bindHands(picture(), { draft, view, kind: () => state.kind });
  byId("build-file").addEventListener("click", () => byId("build-chosen").click());
  byId("build-chosen").addEventListener("change", async ({ target }) => {
    const [file] = target.files;
    target.value = ""; // The same file may be chosen again.
    if (file !== undefined) await addFile(file);
  });
  picture().addEventListener("dragover", (event) => event.preventDefault());
  picture().addEventListener("drop", async (event) => {
    event.preventDefault();
    const [file] = event.dataTransfer.files;
    if (file !== undefined) await addFile(file);
  });
  byId("build-undo").addEventListener("click", () => draft.goBack());
  byId("build-delete").addEventListener("click", () => draft.remove());
  byId("build-empty").addEventListener("click", () => draft.begin(null));
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

/**
 * Open the dialog with its earlier draft, be it of an earlier visit, or else with the current scene.
 *
 * @param given {log() -> promise of the session's log, open(body of POST /v1/sessions)}
 */
export async function openBuilder(given) {
  const first = state.parts === null;
  state.parts = given;
  if (first) bind();
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
