// What the page says about a sketch: the line under the picture, and the numbers beside it.

import { byId, setText } from "./dom.js";

const signed = (value) => `${value < 0 ? "−" : ""}${Math.abs(value).toFixed(1)}`;
const centimetres = (vector) => `(${vector.map((value) => signed(100 * value)).join(", ")}) cm`;
const lengthText = (metres) => (metres < 0.01 ? `${(1000 * metres).toFixed(1)} mm` : `${(100 * metres).toFixed(1)} cm`);

/** A warning where walls or the limit of the acceleration keep the fluid away from the target. */
function missText(steering) {
  const { miss } = steering.deviation();
  return miss > 0.25 * Math.hypot(...steering.plan.target_displacement) ? `, will end ${lengthText(miss)} away` : "";
}

/** The line under the picture, for each phase of steering. */
function steerText(steering, { live, playing, dim, tool }) {
  const kind = steering.sketch?.kind === "ellipse" ? "oval" : "arrow";
  switch (steering.phase) {
    case "drawing":
      return kind === "oval" ? "Oval: release to gather the fluid there" : "Arrow: release to move the fluid by it";
    case "staged":
      return `Taken for an ${kind}`;
    case "planning":
      return "Steering…";
    case "following":
      if (!playing) return `Paused: play to follow the ${kind}`;
      return `Following the ${kind}${missText(steering)}`;
    case "done": {
      const { miss, degrees } = steering.deviation();
      return `Done: ${lengthText(miss)} from the target, ${degrees.toFixed(1)}° off`;
    }
    default:
      if (!live) return "Waiting for the simulation";
      if (dim === 3 && tool === "orbit") return "Drag to look around. Pick arrow or oval to steer.";
      return tool === "oval" ? "Drag across an oval, or trace one, where the fluid should gather" : "Draw on the picture: the fluid follows";
  }
}

export function showSteering(steering, context) {
  const { phase, plan } = steering;
  document.body.dataset.control = phase;
  setText("steer-text", steerText(steering, context));
  setText("steer-count", phase === "following" ? `${steering.framesDone} / ${plan.frames}` : "");
  byId("switch-kind").hidden = phase !== "staged";
  setText("switch-kind", steering.sketch?.kind === "arrow" ? "Make it an oval" : "Make it an arrow");
  byId("undo").hidden = !["staged", "following", "done"].includes(phase);
  setText("undo", phase === "staged" ? "Undo" : "Clear");
  const progress = byId("steer-progress");
  progress.hidden = phase !== "following";
  byId("plan-card").hidden = plan === null;
  if (plan === null) return;
  progress.max = plan.frames;
  progress.value = steering.framesDone;
  const [start, now] = [plan.centroids[0], plan.centroids[steering.framesDone]];
  setText("wanted", centimetres(plan.target_displacement));
  setText("moved", centimetres(now.map((value, axis) => value - start[axis])));
  const force = plan.mean_force[Math.min(steering.framesDone, plan.frames - 1)];
  setText("force", `${Math.hypot(...force).toFixed(1)} m/s²`);
  setText("deviation", lengthText(steering.deviation().miss));
}
