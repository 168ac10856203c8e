// The dialog that finds the fastest or the most accurate method for the scene.

import { client } from "../net/api.js";
import { byId, setText } from "../panels/dom.js";
import { drawPlans } from "./chart.js";

const METHODS = { mpm: "MPM", coarse: "Coarse mode", neural: "Network", hybrid: "Hybrid" };

let parts = null; // from openPlanner
let plan = null; // the newest answer; null before the first, and after one that failed

/** "coarse 1/16" -> "Coarse mode, 1/16"; "mpm 1" -> "MPM, all particles". */
function titleOf(name) {
  const [method, ...label] = name.split(" ");
  return `${METHODS[method] ?? method}, ${label.join(" ") === "1" ? "all particles" : label.join(" ")}`;
}

const figures = ({ error, ms_per_frame: ms }) => `error ${Number(error.toPrecision(2))}, ${Number(ms.toPrecision(2))} ms a frame`;

function demand() {
  const budget = byId("plan-by-time").checked;
  return budget ? { budget_ms: Number(byId("plan-time").value) } : { max_error: Number(byId("plan-error").value) };
}

function show(answer) {
  plan = answer;
  byId("plan-answer").hidden = answer === null;
  if (answer === null) return;
  setText("plan-name", titleOf(answer.name));
  setText("plan-figures", figures(answer));
  setText("plan-runner-up", answer.runner_up === null ? "none" : `${titleOf(answer.runner_up.name)}: ${figures(answer.runner_up)}`);
  setText("plan-reason", `${answer.reason.charAt(0).toUpperCase()}${answer.reason.slice(1)}.`);
  const notes = answer.notes.map((text) => {
    const item = document.createElement("li");
    item.textContent = text;
    return item;
  });
  byId("plan-notes").replaceChildren(...notes);
  byId("plan-start").disabled = answer.session === null;
  byId("plan-start").textContent = answer.session === null ? "Only in Python: sessions lack these settings" : "Use this method";
  drawPlans(byId("plan-chart"), answer, demand(), titleOf);
}

async function ask(scene) {
  setText("plan-problem", "");
  try {
    show(await client.plan({ ...scene, ...demand() }));
  } catch (problem) {
    show(null);
    setText("plan-problem", problem.detail || problem.title);
  }
}

/** Bind the controls of the dialog, once. */
function bind() {
  byId("plan-form").addEventListener("submit", (event) => {
    event.preventDefault();
    ask(parts.scene());
  });
  byId("plan-demand").addEventListener("change", () => {
    const budget = byId("plan-by-time").checked;
    byId("plan-time").disabled = !budget;
    byId("plan-error").disabled = budget;
  });
  byId("plan-start").addEventListener("click", () => {
    byId("planner").close();
    parts.start({ solver: plan.session.solver, coarse: plan.session.coarse ?? null });
  });
  byId("planner-close").addEventListener("click", () => byId("planner").close());
}

/**
 * Open the dialog, and find a method at once.
 *
 * @param given {scene() -> {scenario, seed} of the scene, start({solver, coarse}) with the chosen method}
 */
export function openPlanner(given) {
  if (parts === null) {
    parts = given;
    bind();
  }
  byId("planner").showModal();
  ask(parts.scene());
}
