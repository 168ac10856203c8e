// Text about a sketch: the line under the picture, and the numbers beside it.

import { byId, setText } from "./dom.js";

const signed = (value) => `${value < 0 ? "−" : ""}${Math.abs(value).toFixed(1)}`;
const centimetres = (vector) => `(${vector.map((value) => signed(100 * value)).join(", ")}) cm`;
const lengthText = (metres) => (metres < 0.01 ? `${(1000 * metres).toFixed(1)} mm` : `${(100 * metres).toFixed(1)} cm`);

const percent = (share) => `${(100 * share).toFixed(share > 0.995 ? 1 : 0)} %`;

/**
 * What was reached when the sketch's frames were over; empty as long as the server has not said it. An arrow is about
 * the centre of mass, also where the fluid has become a disc at its tip.
 */
function reachedText({ sketch, reached }, alone) {
  if (reached === null) return "";
  const oval = sketch?.kind !== "arrow" && reached.inside !== null;
  const text = oval ? `${percent(reached.inside)} inside` : `${lengthText(reached.miss)} from the target`;
  // The centre of mass may be at the tip while a network has torn the body apart.
  return alone ? `${text}; a network moves it as well as it can` : text;
}

const NAMES = { arrow: "arrow", ellipse: "oval", shape: "shape", solid: "solid" };

const HINTS = {
  orbit: "Drag to look around. Choose Push, Arrow or Oval to steer.",
  push: "Drag through the fluid to push it",
  arrow: "Draw an arrow: the fluid follows it",
  oval: "Drag across an oval, or trace one, for the fluid to fill",
  shape: "Trace any outline for the fluid to fill",
  free: "Draw an arrow, an oval or a shape: the fluid follows",
};

/** The hint for a tool; `who` is the material of the body that was tapped, null where everything moves; `bodies` whether there are rigid ones. */
function hint(tool, who, bodies) {
  if (tool === "push" && bodies) return "Drag through the fluid to push it, or a body to pull it";
  const text = HINTS[tool];
  return who === null || tool === "push" || tool === "orbit" ? text : text.replace("the fluid", `only the tapped ${who}`);
}

/** The line under the picture, for each phase of steering. */
function steerText(steering, { live, playing, tool, ghost, who, alone, bodies }) {
  const kind = NAMES[steering.sketch?.kind] ?? "arrow";
  switch (steering.phase) {
    case "drawing":
      return kind === "arrow" ? "Arrow: release to move the fluid along it" : `${kind === "oval" ? "Oval" : "Shape"}: release to gather the fluid there`;
    case "staged":
      return `Read as ${kind === "shape" ? "a" : "an"} ${kind}`;
    case "proposed":
      return "The fluid will fill this";
    case "planning":
      return "Planning…";
    case "following":
      if (!playing) return `Paused: play to follow the ${kind}`;
      return steering.plan.needs.reachable ? `Following the ${kind}` : "Out of reach: moving as near as possible";
    case "holding":
      return `Holding: ${reachedText(steering, alone) || kind}`;
    case "done":
      return `Done${steering.reached === null ? "" : `: ${reachedText(steering, alone)}`}`;
    default:
      if (!live) return "Waiting for the simulation";
      if (ghost) return "Draw an oval like this, and the fluid follows";
      return `${playing ? "" : "Paused. "}${hint(tool, who, bodies)}`;
  }
}

export function showSteering(steering, context) {
  const { phase, plan, framesDone } = steering;
  const steers = phase === "following" || phase === "holding";
  document.body.dataset.control = phase;
  setText("steer-text", steerText(steering, context));
  setText("steer-count", steers ? `${framesDone} / ${plan.frames + plan.hold}` : "");
  byId("switch-kind").hidden = phase !== "staged";
  setText("switch-kind", { arrow: "Make it an arrow", ellipse: "Make it an oval", shape: "Make it a shape" }[steering.otherKind]);
  byId("everyone").hidden = context.who === null || phase === "staged";
  byId("undo").hidden = ["idle", "drawing"].includes(phase);
  setText("undo", ["staged", "proposed"].includes(phase) ? "Undo" : phase === "done" ? "Clear" : "Let go");
  const progress = byId("steer-progress");
  progress.hidden = !steers;
  byId("plan-card").hidden = plan === null;
  if (plan === null) return;
  progress.max = plan.frames + plan.hold;
  progress.value = framesDone;
  const { path } = plan.goal;
  const from = (point) => point.map((value, axis) => value - path[0][axis]);
  setText("wanted", centimetres(from(path.at(-1))));
  setText("moved", context.centroid === null ? "–" : centimetres(from(context.centroid)));
  setText("need", `${plan.needs.acceleration.toFixed(1)} g of ${plan.needs.cap} g`);
  setText("reached-name", `After ${plan.frames} frames`);
  setText("reached", reachedText(steering, context.alone) || "–");
  const remarks = plan.needs.notes.map((note) => `${note.charAt(0).toUpperCase()}${note.slice(1)}.`);
  const obstructions = plan.needs.obstructions.map(({ message }) => `Out of reach: ${message}.`);
  setText("needs-text", [...obstructions, ...remarks].join(" "));
}
