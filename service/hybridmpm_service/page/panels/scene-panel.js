// The form that chooses a scene: scenario, seed, and the buttons that start it.

import { byId, setText } from "./dom.js";

const PARTS = { bodies: "Body", obstacles: "Obstacle", emitters: "Emitter", sinks: "Sink" };
const TITLES = { water: "Water", sand: "Sand", ramps: "with ramps", "2d": "2D", "3d": "3D" };

/** The scene of the gallery that is chosen first in space: enough particles are shown for it to look like a sea. */
export const SEA = "dam-in-space";

/** "water_sand_2d" -> "Water and sand, 2D". */
export function titleOf(name) {
  const words = name.split("_");
  const text = words.slice(0, -1).map((word) => TITLES[word] ?? word);
  const materials = text.filter((word) => !word.startsWith("with"));
  const rest = text.filter((word) => word.startsWith("with"));
  const joined = [materials.join(" and ").toLowerCase(), ...rest].join(" ");
  return `${joined.charAt(0).toUpperCase()}${joined.slice(1)}, ${TITLES[words.at(-1)] ?? words.at(-1)}`;
}

/** Offer the scenarios of the server, and choose one with its seed. */
export function showScenarios(scenarios, chosen) {
  const options = scenarios.map(({ name, text }) => {
    const option = document.createElement("option");
    option.value = name;
    option.textContent = titleOf(name);
    option.dataset.text = text;
    return option;
  });
  const sea = new Option("Sea, 3D", SEA);
  sea.dataset.text = "A dam breaks upon a pillar. 36 000 particles are shown, of which MPM simulates one in 16.";
  options.splice(options.findIndex(({ value }) => value.endsWith("_3d")), 0, sea);
  const own = byId("own-scene");
  byId("scenario").replaceChildren(...(own === null ? options : [own, ...options]));
  if (own === null) chooseScene(chosen);
}

/** Show the name of a scene that is not from a scenario. */
export function showOwnScene(name) {
  byId("own-scene")?.remove();
  const option = document.createElement("option");
  option.id = "own-scene";
  option.value = "";
  option.textContent = `${name.charAt(0).toUpperCase()}${name.slice(1)}`;
  option.dataset.text = "A scene from the gallery, a file or a link. Choosing a scenario starts another simulation.";
  byId("scenario").prepend(option);
  byId("scenario").value = "";
  byId("seed").disabled = true;
  describeScenario();
}

/** Say of the shown scene what there is to see, and to try. */
export function describeOwnScene(text) {
  const own = byId("own-scene");
  if (own === null) return;
  own.dataset.text = text;
  describeScenario();
}

export function chooseScene({ scenario, seed }) {
  byId("own-scene")?.remove();
  byId("seed").disabled = false;
  byId("scenario").value = scenario;
  byId("seed").value = seed;
  describeScenario();
}

function describeScenario() {
  setText("scenario-text", byId("scenario").selectedOptions[0]?.dataset.text ?? "");
}

/** "obstacles[0].start" -> "Obstacle 1"; other fields as they are. */
function nounOf(field) {
  const part = field.match(/^(\w+)\D(\d+)/);
  return part && PARTS[part[1]] ? `${PARTS[part[1]]} ${Number(part[2]) + 1}` : field;
}

/** A text with the names of things in the place of "bodies[0]". */
const inWords = (text) => text.replace(/\b(?:bodies|obstacles|emitters|sinks)\[\d+\]/g, (field) => nounOf(field).toLowerCase());

/** Show the findings of the scene's check, each with its remedy. */
export function showFindings(findings) {
  const items = findings.map(({ field, problem, advice }) => {
    const item = document.createElement("li");
    item.textContent = `${nounOf(field)} ${inWords(advice ? `${problem}; ${advice}` : problem)}.`;
    return item;
  });
  byId("findings").replaceChildren(...items);
  byId("findings").hidden = items.length === 0;
}

/** Call `newScene` with {scenario, seed} when the user chooses another scene or simulator. */
export function bindScene(newScene) {
  const start = () => newScene({ scenario: byId("scenario").value, seed: Number(byId("seed").value) });
  byId("scenario").addEventListener("change", () => {
    describeScenario();
    start();
  });
  byId("solvers").addEventListener("change", start);
  byId("coarse").addEventListener("change", start);
  byId("dice").addEventListener("click", () => {
    byId("seed").value = String(Math.floor(Math.random() * 1_000_000));
    start();
  });
  byId("scene-form").addEventListener("submit", (event) => {
    event.preventDefault();
    start();
  });
}
