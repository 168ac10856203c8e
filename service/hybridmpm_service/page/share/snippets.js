// The run on the page as lines of Python, and as a call of the service; both reproduce its state.

import { packed } from "./log-link.js";

const quoted = (text) => JSON.stringify(text);

function simulatorOf({ solver, coarse, model }) {
  switch (solver) {
    case "hybrid":
      return { name: "HybridSimulator", call: `HybridSimulator(scene, ${quoted(model)})` };
    case "neural":
      return { name: "NeuralPhysics", call: `NeuralPhysics(scene, ${quoted(model)})` };
    default:
      return { name: "MpmSolver", call: coarse ? `MpmSolver(scene, coarse=${quoted(coarse)})` : "MpmSolver(scene)" };
  }
}

/** What acted on a run, in words. */
function actsOf({ inputs, frame }) {
  const sketches = inputs.filter(({ kind }) => kind === "sketch").length;
  const pushes = inputs.filter(({ kind, push }) => kind === "push" && push === null).length;
  const parts = [[sketches, "sketch", "sketches"], [pushes, "push", "pushes"]]
    .filter(([count]) => count > 0)
    .map(([count, one, many]) => `${count} ${count === 1 ? one : many}`);
  return `${parts.join(" and ") || "All inputs"}, up to frame ${frame}`;
}

/** Python that computes the run of a log again, to the bit. */
export async function asPython(log) {
  const end = ["print(solver.frame, solver.positions)", ""];
  if (log.inputs.length > 0 || log.frame === 0 || !log.scenario) {
    const text = `#${await packed("replay", log)}`;
    return ["from hybridmpm import replay", "", `# ${actsOf(log)}.`, `solver = replay(${quoted(text)})`, ...end].join("\n");
  }
  const { name, call } = simulatorOf(log);
  const scene = `scene = scenarios.get(${quoted(log.scenario)}, ${log.seed ?? 0})`;
  return [`from hybridmpm import ${name}, scenarios`, "", scene, `solver = ${call}`, `solver.advance(${log.frame})`, ...end].join("\n");
}

/**
 * A shell command that makes a session in the state of a log, on the service at an address; `needsKey` leaves a place for a key.
 * Its last line tells where it is seen.
 */
export function asCurl(log, address, needsKey) {
  const body = JSON.stringify({ log }).replaceAll("'", "'\\''");
  const key = needsKey ? ' -H "Authorization: Bearer $KEY"' : "";
  const call = `curl -s -X POST ${address}v1/sessions${key} -H 'Content-Type: application/json' \\\n  -d '${body}'`;
  return `${call}\n# The page shows it at ${address}?session=ID, with the id that is printed.\n`;
}
