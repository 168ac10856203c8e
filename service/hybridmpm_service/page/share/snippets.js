// The scene on the page as lines of Python, and as a call of the service.

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

/** Python that simulates what a log begins with, as far as the log goes. */
export function asPython(log) {
  const { name, call } = simulatorOf(log);
  const own = !log.scenario;
  const lines = own
    ? ["import json", "", `from hybridmpm import ${[name, "Scene"].sort().join(", ")}`, ""]
    : [`from hybridmpm import ${name}, scenarios`, ""];
  const scene = own
    ? `scene = Scene.parse(json.loads(r"""${JSON.stringify(log.scene)}"""))`
    : `scene = scenarios.get(${quoted(log.scenario)}, ${log.seed ?? 0})`;
  const frames = Math.max(1, log.frame);
  return [...lines, scene, `solver = ${call}`, `solver.advance(${frames})`, "print(solver.positions)", ""].join("\n");
}

/** What the service needs to start the session of a log, without its inputs. */
export function bodyOf({ scenario, seed, scene, solver, coarse, model }) {
  const what = scenario ? { scenario, seed } : { scene };
  const simulator = solver === "mpm" ? { solver, ...(coarse ? { coarse } : {}) } : { solver, model };
  return { ...what, ...simulator };
}

/** A shell command that starts the same session on the service at an address; `needsKey` leaves a place for a key. */
export function asCurl(log, address, needsKey) {
  const body = JSON.stringify(bodyOf(log)).replaceAll("'", "'\\''");
  const key = needsKey ? ' -H "Authorization: Bearer $KEY"' : "";
  return `curl -s -X POST ${address}v1/sessions${key} -H 'Content-Type: application/json' \\\n  -d '${body}'\n`;
}
