// The simulator: its choice, the badge on the picture, the card of the latest frames.

import { byId, setText } from "./dom.js";
import { drawStrips, forceStrip, latencyStrip, safeguardStrip, signed, Track, volumeStrip } from "./strips.js";

const MODES = { mpm: "MPM simulates", neural: "Network simulates" };
const NAMES = { mpm: "MPM", neural: "Network" };
const REASONS = {
  audit: "the network was inaccurate",
  calm: "the network's turn",
  cosine: "the motion is complex",
  density: "particles are crowded",
  drift: "the network was inaccurate",
  energy: "energy grew",
  force: "a sketch or a push steers",
  free_fall: "free fall",
  "non-finite": "the network failed",
  outside: "particles left the box",
  rest: "everything is at rest",
  unsound: "the network failed",
  "warm-up": "the network has enough frames",
};
const EMPTY = { frames: [], values: [], phases: [[0, "mpm"]], decisions: [] };

let models = [];
let charted = { history: EMPTY, safeguard: null, frame: 0 }; // from the newest status
let latencies = new Track();
let volumes = new Track();
let forces = new Track(); // sizes of the force on the chosen wall or obstacle

// ---- the choice ----

const modelFor = (scenario) => models.find((model) => model.scenarios.includes(scenario));

export function setModels(list) {
  models = list;
}

/** The chosen solver, or MPM where no network serves the scenario. */
export const solverFor = (scenario, solver) => (modelFor(scenario) === undefined ? "mpm" : solver);

export const chosenSolver = () => document.querySelector('input[name="solver"]:checked').value;

/** The chosen coarse level; null for all particles. */
export const chosenCoarse = () => byId("coarse").value || null;

export function showChoice({ scenario, solver, coarse }) {
  const model = modelFor(scenario);
  for (const input of document.querySelectorAll('input[name="solver"]')) {
    input.checked = input.value === solver;
    input.disabled = input.value !== "mpm" && model === undefined;
  }
  byId("coarse").value = coarse ?? "";
  byId("coarse-field").hidden = solver !== "mpm";
  setText("solver-text", choiceText(solver, model, coarse));
}

function choiceText(solver, model, coarse) {
  const share = model && `${Number((100 * model.r_p).toFixed(1))} % of the particles`;
  switch (solver) {
    case "hybrid":
      return `A network simulates ${share}. Where a guard alarms, MPM takes over.`;
    case "neural":
      return `A network alone simulates ${share}, without guards.`;
    default: {
      const part = coarse === null ? "simulates all particles" : `simulates ${coarse} of the particles; all are shown`;
      const text = `The material point method (MPM) ${part}.`;
      return model === undefined ? `${text} There is no network for this scenario.` : text;
    }
  }
}

// ---- the present simulator ----

/**
 * Show the present simulator.
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
  charted = { history: history ?? EMPTY, safeguard, frame };
  byId("safeguard-numbers").hidden = byId("safeguard-legend").hidden = safeguard === null;
  if (safeguard !== null) showSafeguard(safeguard);
  draw();
}

function showSafeguard({ value, r_c: threshold, mpm_share: share }) {
  setText("safeguard-value", value === null ? "not yet" : signed(value));
  const watched = threshold !== null;
  byId("threshold-legend").hidden = !watched;
  byId("threshold-row").hidden = !watched;
  if (watched) setText("safeguard-threshold", signed(threshold));
  setText("mpm-share", `${Math.round(100 * share)} %`);
  showDecision(charted.history.decisions.at(-1));
}

/** Begin the chart of another session. */
export function clearTracks() {
  latencies = new Track();
  volumes = new Track();
  forces = new Track();
}

/**
 * Note a frame that is shown.
 *
 * @param solverMs time of the frame [ms]
 * @param volume volume of the matter [m^dim]; null where it was not measured
 */
export function trackFrame({ frame, solverMs }, volume) {
  latencies.add(frame, solverMs);
  if (volume !== null) volumes.add(frame, volume);
}

/**
 * Note the forces of a status message, of which the chart shows the one that is chosen.
 *
 * @param means {solids, force} as the service answers them; null where there are none
 */
export function trackForces(frame, means) {
  byId("solid-choice").hidden = means === null;
  if (means === null) return;
  const select = byId("solid");
  if (select.options.length !== means.solids.length) {
    select.replaceChildren(...means.solids.map((name) => new Option(name.replace("_", ", "), name)));
    select.value = "y_lower";
    forces = new Track();
  }
  forces.add(frame, Math.hypot(...means.force[select.selectedIndex]));
}

byId("solid").addEventListener("change", () => {
  forces = new Track();
});

function showDecision(decision) {
  setText("decision-frame", `${NAMES[decision?.mode ?? "mpm"]}, since frame ${(decision?.frame ?? 0).toLocaleString("en")}`);
  setText("decision-reason", decision === undefined ? "the start" : (REASONS[decision.reason] ?? decision.reason));
}

function draw() {
  const { history, safeguard, frame } = charted;
  const strips = [latencyStrip(latencies), volumeStrip(volumes)];
  if (forces.points.length > 0) strips.push(forceStrip(forces, byId("solid").selectedOptions[0]?.textContent ?? ""));
  if (safeguard !== null) strips.unshift(safeguardStrip(history, safeguard.r_c));
  const canvas = byId("strips");
  canvas.style.height = `${strips.length * 76 + 20}px`;
  drawStrips(canvas, strips, { phases: safeguard === null ? [] : history.phases, frame });
}

new ResizeObserver(draw).observe(byId("strips"));
