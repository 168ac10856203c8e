// The simulator: its choice, the badge on the picture that says who simulates, the card of the safeguard.

import { byId, setText } from "./dom.js";
import { drawSafeguard, signed } from "./safeguard-chart.js";

const MODES = { mpm: "MPM simulates", neural: "Network simulates" };
const NAMES = { mpm: "MPM", neural: "Network" };
const REASONS = {
  audit: "the network erred",
  calm: "the network's turn",
  cosine: "the motion is complex",
  density: "particles crowded",
  divergence: "the flow diverged",
  drift: "the network erred",
  energy: "energy grew",
  force: "a sketch or a push steers",
  free_fall: "all falls freely",
  impact: "an impact",
  "non-finite": "the network failed",
  outside: "particles left the box",
  rest: "all is at rest",
  unsound: "the network failed",
  "warm-up": "enough frames to look back on",
};
const EMPTY = { frames: [], values: [], phases: [[0, "mpm"]], decisions: [] };

let models = [];
let charted = null; // content of the chart: {history, threshold, frame}

// ---- the choice ----

const modelFor = (scenario) => models.find((model) => model.scenarios.includes(scenario));

export function setModels(list) {
  models = list;
}

/** The solver that is wanted, or MPM where no network serves the scenario. */
export const solverFor = (scenario, solver) => (modelFor(scenario) === undefined ? "mpm" : solver);

export const chosenSolver = () => document.querySelector('input[name="solver"]:checked').value;

/** The rung of this name; null, for all particles, where there is none. */
export const asRung = (name) => [...byId("rung").options].find(({ value }) => value !== "" && value === name)?.value ?? null;

export const chosenRung = () => asRung(byId("rung").value);

export function showChoice({ scenario, solver, rung }) {
  const model = modelFor(scenario);
  for (const input of document.querySelectorAll('input[name="solver"]')) {
    input.checked = input.value === solver;
    input.disabled = input.value !== "mpm" && model === undefined;
  }
  byId("rung").value = rung ?? "";
  byId("rung-field").hidden = solver !== "mpm";
  setText("solver-text", choiceText(solver, model, rung));
}

function choiceText(solver, model, rung) {
  const share = model && `${Number((100 * model.r_p).toFixed(1))} % of the particles`;
  switch (solver) {
    case "hybrid":
      return `A network simulates ${share}. Where a guard alarms, MPM takes over.`;
    case "neural":
      return `A network alone simulates ${share}. No guard watches it.`;
    default: {
      const who = rung === null ? "simulates all particles" : `simulates ${rung} of the particles, which carry all others along`;
      const text = `The material point method (MPM) ${who}.`;
      return model === undefined ? `${text} There is no network for this scenario.` : text;
    }
  }
}

// ---- who simulates now ----

/**
 * Show who simulates now.
 *
 * @param session the session of a hello or status message
 * @param history the history of a status message; null where there is none
 */
export function showWho({ solver, mode, safeguard, frame }, history) {
  document.body.dataset.solver = solver;
  document.body.dataset.mode = mode;
  byId("mode").hidden = solver === "mpm";
  // Screen readers speak this text whenever it changes.
  setText("mode-text", solver === "mpm" ? "" : MODES[mode]);
  byId("safeguard-card").hidden = safeguard === null;
  if (safeguard === null) {
    charted = null;
    return;
  }
  charted = { history: history ?? EMPTY, threshold: safeguard.r_c, frame };
  setText("safeguard-value", safeguard.value === null ? "not yet" : signed(safeguard.value));
  const watched = safeguard.r_c !== null;
  byId("threshold-legend").hidden = !watched;
  byId("threshold-row").hidden = !watched;
  if (watched) setText("safeguard-threshold", signed(safeguard.r_c));
  setText("mpm-share", `${Math.round(100 * safeguard.mpm_share)} %`);
  showDecision(charted.history.decisions.at(-1));
  draw();
}

function showDecision(decision) {
  setText("decision-frame", `${NAMES[decision?.mode ?? "mpm"]}, since frame ${(decision?.frame ?? 0).toLocaleString("en")}`);
  setText("decision-reason", decision === undefined ? "the start" : (REASONS[decision.reason] ?? decision.reason));
}

function draw() {
  if (charted !== null) drawSafeguard(byId("safeguard-chart"), charted.history, charted);
}

new ResizeObserver(draw).observe(byId("safeguard-chart"));
