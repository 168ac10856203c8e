// Sharing and export: links, code, films, particles, scenes and whole runs; and opening of files.

import { packed } from "./log-link.js";
import { asCurl, asPython } from "./snippets.js";
import { client } from "../net/api.js";
import { present } from "../net/key.js";
import { byId, setText } from "../panels/dom.js";

/** Longest address that browsers and messengers pass on whole. */
const LONGEST_LINK = 60_000;

let parts = null; // {session, toast, open, stage, recent}

const report = (text) => setText("share-text", text);

async function copy(text, what) {
  byId("share-copy").hidden = true;
  try {
    await navigator.clipboard.writeText(text);
    report(`${what} is in the clipboard.`);
  } catch {
    // Without permission, or over plain HTTP, the user copies the text.
    byId("share-copy").value = text;
    byId("share-copy").hidden = false;
    byId("share-copy").select();
    report(`${what}: copy it from here.`);
  }
}

function download(content, name, type) {
  const link = document.createElement("a");
  link.href = content instanceof Blob ? URL.createObjectURL(content) : URL.createObjectURL(new Blob([content], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

async function saveParticles(kind, text) {
  download(await parts.session.particles(kind), `particles.${kind}`);
  report(text);
}

const titleOf = ({ scenario, seed, scene }) => (scenario ? `${scenario}-${seed ?? 0}` : scene.name || "scene");

const ACTIONS = {
  link: async () => {
    const link = `${client.at("/").href}#${await packed("replay", await parts.session.log())}`;
    if (link.length > LONGEST_LINK) report("This run has too many inputs for a link: save it as a file.");
    else await copy(link, "A link that computes this run again");
  },
  watch: async () => {
    const page = present() === null ? `/?watch=${parts.session.id}` : (await parts.session.link()).page;
    await copy(client.at(page).href, "A link to watch this simulation while it is open");
  },
  python: async () => copy(await asPython(await parts.session.log()), "Python for this run"),
  curl: async () => copy(asCurl(await parts.session.log(), client.at("/").href, present() !== null), "A shell command for this run"),
  film: async () => {
    const { film } = await import("./film.js");
    const seconds = (value) => value.toFixed(1);
    const tell = (done, all) => report(`What was seen is filmed: ${seconds(done)} of ${seconds(all)} s.`);
    const made = await film(parts.recent.moments, parts.stage, tell);
    download(made.blob, `hybridmpm.${made.suffix}`);
    report(`The film of the last ${seconds(made.seconds)} s is saved. For all of it, save the run; hybridmpm simulate --run films that.`);
  },
  picture: async () => {
    const whole = document.createElement("canvas");
    parts.stage.paintOn(whole);
    download(await new Promise((resolve) => whole.toBlob(resolve, "image/png")), "hybridmpm.png");
    report("The picture is saved.");
  },
  npz: () => saveParticles("npz", "Positions, velocities, types and ids are saved."),
  ply: () => saveParticles("ply", "The particles are saved as a point cloud for mesh tools."),
  vtp: () => saveParticles("vtp", "The particles are saved as VTK PolyData, for ParaView."),
  fork: async () => {
    const fork = await parts.session.fork();
    const link = Object.assign(document.createElement("a"), { href: `?session=${fork.id}`, target: "_blank", textContent: "Open the fork" });
    byId("share-text").replaceChildren("A second simulation continues from this state. ", link);
  },
  scene: async () => {
    const log = await parts.session.log();
    download(JSON.stringify(log.scene, null, 1), `${titleOf(log)}.json`, "application/json");
    report("The scene is saved; Open brings it back, and so does Scene.load in Python.");
  },
  run: async () => {
    const log = await parts.session.log();
    download(JSON.stringify(log), `${titleOf(log)}-run.json`, "application/json");
    report("Scene and inputs are saved; Open computes the run again.");
  },
};

async function open(file) {
  let content;
  try {
    content = JSON.parse(await file.text());
  } catch {
    parts.toast({ title: "This file cannot be read", detail: `${file.name} is not JSON.`, advice: "Open a scene or a run that was saved here." });
    return;
  }
  const isRun = typeof content === "object" && content !== null && "inputs" in content;
  parts.open(isRun ? { log: content } : { scene: content });
}

/**
 * Perform the action of a button of the card.
 *
 * @param button the button
 * @param given  {session, toast(problem), open(body of POST /v1/sessions), stage, recent}
 */
export async function share(button, given) {
  parts = given;
  if (button.id === "share-open") {
    byId("share-file").click();
    return;
  }
  try {
    await ACTIONS[button.dataset.share]();
  } catch (problem) {
    report("");
    parts.toast(problem);
  }
}

/** Open the file that was chosen; `given` as for `share`. */
export function openChosen(input, given) {
  parts = given;
  if (input.files.length > 0) open(input.files[0]);
  input.value = "";
}
