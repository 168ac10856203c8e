// A chart of readings over time, with what is exact as a dashed line, in the colours of the page.

const MARGIN = { left: 46, right: 10, top: 22, bottom: 20 };
const FEWEST_SECONDS = 1; // that the chart is wide
const LINES = ["--accent", "--green"];

/** A step of marks, about a third of a range. */
function stepOf(range) {
  const power = 10 ** Math.floor(Math.log10(range / 3));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= range / 3);
}

/**
 * Draw readings at the size that a canvas has on the screen.
 *
 * @param series {time [s], values, exact}, oldest first
 * @param style  {factor, unit, names of the values, exact: name of the dashed line}
 */
export function drawChart(canvas, series, { factor, unit, names, exact }) {
  const { clientWidth: width, clientHeight: height } = canvas;
  if (width === 0) return;
  const scale = window.devicePixelRatio;
  [canvas.width, canvas.height] = [width, height].map((side) => Math.round(side * scale));
  const colors = getComputedStyle(canvas);
  const color = (name) => colors.getPropertyValue(name);
  const context = canvas.getContext("2d");
  context.scale(scale, scale);
  context.font = `12px ${colors.fontFamily}`;

  const all = series.flatMap(({ values, exact: wanted }) => (wanted === null ? values : [...values, wanted])).map((value) => factor * value);
  const [least, most] = [Math.min(0, ...all), Math.max(0, ...all)];
  const step = stepOf(Math.max(most - least, 1e-3));
  const [low, high] = [step * Math.floor(least / step), step * Math.max(Math.ceil(most / step), 1)];
  const seconds = Math.max(FEWEST_SECONDS, series.at(-1)?.time ?? 0);
  const across = (time) => MARGIN.left + (time / seconds) * (width - MARGIN.left - MARGIN.right);
  const up = (value) => height - MARGIN.bottom - ((value - low) / (high - low)) * (height - MARGIN.top - MARGIN.bottom);

  context.textBaseline = "middle";
  context.textAlign = "right";
  for (let mark = low; mark <= high + step / 2; mark += step) {
    context.strokeStyle = color("--line");
    context.fillStyle = color("--muted");
    context.beginPath();
    context.moveTo(MARGIN.left, up(mark));
    context.lineTo(width - MARGIN.right, up(mark));
    context.stroke();
    context.fillText(String(Number(mark.toPrecision(3))).replace("-", "−"), MARGIN.left - 6, up(mark));
  }
  context.fillText(`${seconds.toFixed(1)} s`, width - MARGIN.right, height - 8);
  context.textAlign = "left";
  context.fillText("0", MARGIN.left, height - 8);

  let left = MARGIN.left;
  const line = (name, ink, valueOf, dashes) => {
    context.strokeStyle = context.fillStyle = ink;
    context.setLineDash(dashes);
    context.lineWidth = 1.75;
    context.beginPath();
    let drawn = false;
    for (const one of series) {
      const value = valueOf(one);
      if (value === null) drawn = false;
      else context[drawn ? "lineTo" : "moveTo"](across(one.time), up(factor * value));
      drawn = value !== null;
    }
    context.stroke();
    context.setLineDash([]);
    context.fillText(name, left, 10);
    left += context.measureText(name).width + 14;
  };
  names.forEach((name, i) => line(`${name}${i === 0 ? ` [${unit}]` : ""}`, color(LINES[i]), ({ values }) => values[i], []));
  line(exact, color("--amber"), ({ exact: wanted }) => wanted, [5, 4]);
}
