// The chart of the latest frames: simulator, safeguard, time of a frame, volume of the matter.

import { roundUp } from "../stage/quantities.js";

const FRAMES = 1000; // as many as the server keeps of the safeguard
const MIN_FRAMES = 200; // a run that has just begun does not fill the width
const MARGIN = { left: 42, right: 8, top: 18, bottom: 20 };
const GAP = 20; // px between two strips, for the name of the lower one
const COLORS = { value: "--accent", threshold: "--red", mpm: "--band", line: "--line", text: "--muted" };
const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', sans-serif";

/** A number with two decimals and a true minus. */
export const signed = (value) => value.toFixed(2).replace("-", "−");

/** Values of the frames that were shown, oldest first, as long as they are in the chart. */
export class Track {
  points = []; // [frame, value]

  /** Note a value. A frame that was shown before is the start of another run. */
  add(frame, value) {
    if (this.points.length > 0 && frame <= this.points.at(-1)[0]) {
      if (frame === this.points.at(-1)[0]) return;
      this.points = [];
    }
    this.points.push([frame, value]);
    const first = this.points.findIndex(([at]) => at >= frame - FRAMES);
    if (first > 0) this.points.splice(0, first);
  }

  get values() {
    return this.points.map(([, value]) => value);
  }
}

/** The strip of the safeguard, from the history and the threshold (null where there is none) of a status message. */
export function safeguardStrip({ frames, values }, threshold) {
  const low = Math.min(threshold ?? 0, ...values) < 0 ? -1 : 0;
  const marks = [1, 0, -1].filter((value) => value >= low).map((value) => [value, String(value).replace("-", "−")]);
  return { name: "Safeguard", low, high: 1, marks, threshold, points: frames.map((frame, i) => [frame, values[i]]) };
}

/** The strip of the time of a frame [ms]. */
export function latencyStrip({ points, values }) {
  const high = roundUp(Math.max(0.5, ...values));
  return { name: "Solver, ms a frame", low: 0, high, marks: [[high, String(high)], [0, "0"]], threshold: null, points };
}

/** The strip of the volume of the matter, relative to the first shown frame. */
export function volumeStrip({ points, values }) {
  const first = values[0] || 1;
  const parts = points.map(([frame, value]) => [frame, value / first]);
  const high = Math.max(1.5, roundUp(Math.max(...parts.map(([, part]) => part), 0)));
  return { name: "Volume, relative to the first", low: 0, high, marks: [[high, String(high)], [1, "1"], [0, "0"]], threshold: null, points: parts };
}

/** The strip of the force on a wall or an obstacle [N]; in 2D per metre of depth. */
export function forceStrip({ points, values }, solid) {
  const high = roundUp(Math.max(1, ...values));
  return { name: `Force on ${solid}, N`, low: 0, high, marks: [[high, high.toLocaleString("en")], [0, "0"]], threshold: null, points };
}

/**
 * The layout of the chart in CSS pixels. A pure function.
 *
 * @param strips {name, low, high, marks: [[value, text]], threshold or null, points: [[frame, value]]}, the uppermost first
 * @param phases [[frame, "mpm" | "neural"], ...]: first frame and simulator of each phase
 * @returns {areas, first, last, bands: [{x, width}], ticks: [{y, text, threshold}], lines: [[[x, y]]]}
 */
export function layout(strips, { phases, frame, width, height }) {
  const each = (height - MARGIN.top - MARGIN.bottom - GAP * (strips.length - 1)) / strips.length;
  const areas = strips.map((_, i) => {
    const top = MARGIN.top + i * (each + GAP);
    return { left: MARGIN.left, right: width - MARGIN.right, top, bottom: top + each };
  });
  const first = Math.max(0, frame - FRAMES);
  const last = Math.max(frame, MIN_FRAMES);
  const x = (at) => MARGIN.left + ((Math.max(at, first) - first) / (last - first)) * (width - MARGIN.right - MARGIN.left);
  const bands = phases
    .map(([start, mode], i) => ({ mode, from: x(start), to: x(phases[i + 1]?.[0] ?? frame) }))
    .filter(({ mode, from, to }) => mode === "mpm" && to > from)
    .map(({ from, to }) => ({ x: from, width: to - from }));
  const heights = strips.map(({ low, high }, i) => (value) => {
    const part = Math.min(1, Math.max(0, (value - low) / (high - low)));
    return areas[i].bottom - part * (areas[i].bottom - areas[i].top);
  });
  const ticks = strips.flatMap(({ marks, threshold }, i) => {
    const y = heights[i];
    // A mark that would touch that of the threshold is left out.
    const apart = ([value]) => threshold === null || Math.abs(y(value) - y(threshold)) >= 14;
    const plain = marks.filter(apart).map(([value, text]) => ({ y: y(value), text, threshold: false }));
    return threshold === null ? plain : [...plain, { y: y(threshold), text: signed(threshold), threshold: true }];
  });
  const lines = strips.map(({ points }, i) => points.filter(([at]) => at >= first).map(([at, value]) => [x(at), heights[i](value)]));
  return { areas, first, last, bands, ticks, lines };
}

/** Draw strips at the size that the canvas has on the screen; `view` is {phases, frame}. */
export function drawStrips(canvas, strips, view) {
  const { clientWidth: width, clientHeight: height } = canvas;
  if (width === 0 || height === 0) return;
  const scale = window.devicePixelRatio;
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  const context = canvas.getContext("2d");
  context.scale(scale, scale);
  context.font = FONT;
  // Those of the page, light or dark.
  const styles = getComputedStyle(canvas);
  const colors = Object.fromEntries(Object.entries(COLORS).map(([name, property]) => [name, styles.getPropertyValue(property)]));
  const plan = layout(strips, { ...view, width, height });
  drawBands(context, plan, colors);
  drawAxes(context, plan, strips, colors);
  for (const line of plan.lines) drawLine(context, line, colors);
}

function drawBands(context, { areas, bands }, colors) {
  context.fillStyle = colors.mpm;
  for (const { top, bottom } of areas) {
    for (const { x, width } of bands) context.fillRect(x, top, width, bottom - top);
  }
}

function drawAxes(context, { areas, ticks, first, last }, strips, colors) {
  const { left, right, bottom } = areas.at(-1);
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const { y, text, threshold } of ticks) {
    context.strokeStyle = threshold ? colors.threshold : colors.line;
    context.fillStyle = threshold ? colors.threshold : colors.text;
    context.setLineDash(threshold ? [5, 4] : []);
    context.beginPath();
    context.moveTo(left, y);
    context.lineTo(right, y);
    context.stroke();
    context.fillText(text, left - 6, y);
  }
  context.setLineDash([]);
  context.fillStyle = colors.text;
  context.textBaseline = "alphabetic";
  context.textAlign = "left";
  strips.forEach(({ name }, i) => context.fillText(name, left, areas[i].top - 6));
  context.fillText(`frame ${first.toLocaleString("en")}`, left, bottom + 16);
  context.textAlign = "right";
  context.fillText(last.toLocaleString("en"), right, bottom + 16);
}

function drawLine(context, points, colors) {
  context.strokeStyle = colors.value;
  context.lineWidth = 1.75;
  context.lineJoin = "round";
  context.beginPath();
  points.forEach(([x, y], i) => (i === 0 ? context.moveTo(x, y) : context.lineTo(x, y)));
  context.stroke();
}
