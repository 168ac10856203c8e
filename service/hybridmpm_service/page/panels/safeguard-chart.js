// The chart of the safeguard: its value over the latest frames, its threshold, the phases that MPM simulated.

const FRAMES = 1000; // as many as the server keeps
const MIN_FRAMES = 200; // a run that has just begun does not fill the width
const MARGIN = { left: 34, right: 8, top: 8, bottom: 20 };
const COLORS = { value: "#58b9ff", threshold: "#ff8a80", mpm: "rgb(255 209 102 / 0.2)", line: "#2c3d52", text: "#93a3b8" };
const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', sans-serif";

/** A number with two decimals and a true minus. */
export const signed = (value) => value.toFixed(2).replace("-", "−");

/**
 * The layout of the chart in CSS pixels. A pure function.
 *
 * @param history {frames, values, phases: [[frame, "mpm" | "neural"], ...]}
 * @returns {area, ticks: [{y, text, threshold}], first, last, bands: [{x, width}], points: [[x, y]]}
 */
export function layout(history, { threshold, frame, width, height }) {
  const area = {
    left: MARGIN.left,
    right: width - MARGIN.right,
    top: MARGIN.top,
    bottom: height - MARGIN.bottom,
  };
  const first = Math.max(0, frame - FRAMES);
  const last = Math.max(frame, MIN_FRAMES);
  const lowest = Math.min(threshold ?? 0, ...history.values) < 0 ? -1 : 0;
  const x = (at) => area.left + ((Math.max(at, first) - first) / (last - first)) * (area.right - area.left);
  const y = (value) => area.bottom - ((value - lowest) / (1 - lowest)) * (area.bottom - area.top);
  const bands = history.phases
    .map(([start, mode], i) => ({ mode, from: x(start), to: x(history.phases[i + 1]?.[0] ?? frame) }))
    .filter(({ mode, from, to }) => mode === "mpm" && to > from)
    .map(({ from, to }) => ({ x: from, width: to - from }));
  const points = history.values
    .map((value, i) => [history.frames[i], value])
    .filter(([at]) => at >= first)
    .map(([at, value]) => [x(at), y(value)]);
  // A mark that would touch that of the threshold is left out.
  const apart = (value) => threshold === null || Math.abs(y(value) - y(threshold)) >= 14;
  const ticks = [1, 0, -1]
    .filter((value) => value >= lowest && apart(value))
    .map((value) => ({ y: y(value), text: String(value).replace("-", "−"), threshold: false }));
  if (threshold !== null) ticks.push({ y: y(threshold), text: signed(threshold), threshold: true });
  return { area, ticks, first, last, bands, points };
}

/** Draw the chart at the size that the canvas has on the screen. */
export function drawSafeguard(canvas, history, { threshold, frame }) {
  const { clientWidth: width, clientHeight: height } = canvas;
  if (width === 0 || height === 0) return;
  const scale = window.devicePixelRatio;
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  const context = canvas.getContext("2d");
  context.scale(scale, scale);
  context.font = FONT;
  const plan = layout(history, { threshold, frame, width, height });
  drawBands(context, plan);
  drawAxes(context, plan);
  drawValues(context, plan);
}

function drawBands(context, { area, bands }) {
  context.fillStyle = COLORS.mpm;
  for (const { x, width } of bands) context.fillRect(x, area.top, width, area.bottom - area.top);
}

function drawAxes(context, { area, ticks, first, last }) {
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const { y, text, threshold } of ticks) {
    context.strokeStyle = threshold ? COLORS.threshold : COLORS.line;
    context.fillStyle = threshold ? COLORS.threshold : COLORS.text;
    context.setLineDash(threshold ? [5, 4] : []);
    context.beginPath();
    context.moveTo(area.left, y);
    context.lineTo(area.right, y);
    context.stroke();
    context.fillText(text, area.left - 6, y);
  }
  context.setLineDash([]);
  context.fillStyle = COLORS.text;
  context.textBaseline = "alphabetic";
  context.textAlign = "left";
  context.fillText(`frame ${first.toLocaleString("en")}`, area.left, area.bottom + 16);
  context.textAlign = "right";
  context.fillText(last.toLocaleString("en"), area.right, area.bottom + 16);
}

function drawValues(context, { points }) {
  context.strokeStyle = COLORS.value;
  context.lineWidth = 1.75;
  context.lineJoin = "round";
  context.beginPath();
  points.forEach(([x, y], i) => (i === 0 ? context.moveTo(x, y) : context.lineTo(x, y)));
  context.stroke();
}
