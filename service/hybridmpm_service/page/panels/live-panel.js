// The live numbers of the simulation and of the drawing.

import { speedText } from "./controls.js";
import { byId, setText } from "./dom.js";

/** Note that another session is shown; no number of the one before is valid any more. */
export function showSession(id) {
  document.body.dataset.session = id;
  delete document.body.dataset.frame;
}

export function showFrame({ frame, time }) {
  document.body.dataset.frame = String(frame);
  setText("frame", frame.toLocaleString("en"));
  setText("time", `${time.toFixed(3)} s`);
}

/**
 * Show the number of pictures a second; null while none are drawn.
 *
 * @param slow {come, due}: frames a second that the line brings, and that would be due; null where it is fast enough
 */
export function showDrawing(framesPerSecond, slow) {
  const drawn = framesPerSecond === null ? "idle" : `${Math.round(framesPerSecond)} fps`;
  setText("fps", slow === null ? drawn : `${drawn}: the line brings ${Math.round(slow.come)} of ${Math.round(slow.due)}`);
  const where = document.body.dataset.simulated === "here" ? "here" : "on the server";
  setText("home", `simulated ${where}${slow === null ? "" : ", slow line"}`);
}

const threeDigits = (value) => value.toFixed(value < 10 ? 2 : value < 100 ? 1 : 0);
const SLOW = 0.9; // part of the chosen speed below which the page says so

/** A session that has just begun to play has no pace yet. */
function measuredText(playing, measured) {
  if (!playing) return "paused";
  return measured > 0 ? `${speedText(measured)} real time` : "waiting";
}

/** Say why a scene plays slower than was asked for; nothing where it does not. */
function showSlowness({ playing, speed }, measured, median) {
  const isSlow = playing && measured > 0 && measured < SLOW * speed;
  byId("slow-note").hidden = !isSlow;
  if (isSlow) setText("slow-note", `Slower than asked: ${speedText(measured)} of ${speedText(speed)}. A frame takes ${threeDigits(median)} ms of the solver.`);
}

/** @param status a status message, or {session} of a hello message, which has no measurements */
export function showStatus({ session, ms_per_frame: median, ms_p95: high, time_scale: measured }) {
  if (median !== undefined && session.last_frame !== null) {
    setText("solver", high > 0 ? `${threeDigits(median)} ms (p95 ${threeDigits(high)})` : `${threeDigits(median)} ms`);
  }
  setText("measured", measuredText(session.playing, measured));
  showSlowness(session, measured, median);
  setText("count", session.particles.toLocaleString("en"));
  const last = session.last_frame;
  setText("substeps", last === null || last.substeps === null ? "–" : `${last.substeps} (${last.bound})`);
}

export function showRenderer(kind) {
  document.body.dataset.renderer = kind;
  setText("renderer", kind === "webgl2" ? "WebGL2" : "Canvas2D");
}

/** Show where the frames are computed: in this tab, or on the server. */
export function showHome(isHere) {
  document.body.dataset.simulated = isHere ? "here" : "server";
  const where = isHere ? "here" : "on the server";
  setText("simulated", where);
  setText("home", `simulated ${where}`);
}
