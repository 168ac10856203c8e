// The chart of a plan: error against time of all methods, the limit, and the chosen method.

const SPACE = "http://www.w3.org/2000/svg";
const WIDTH = 360;
const HEIGHT = 190;
const LEFT = 34;
const BOTTOM = 34;
const KINDS = ["mpm", "coarse", "hybrid", "neural"];

function drawn(name, attributes, text) {
  const element = document.createElementNS(SPACE, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

/** Round numbers 1, 2 and 5 of each decade between two times [ms]. */
function ticks(low, high) {
  const found = [];
  for (let decade = Math.floor(Math.log10(low)); decade <= Math.log10(high); decade += 1) {
    for (const step of [1, 2, 5]) found.push(step * 10 ** decade);
  }
  return found.filter((value) => value >= low && value <= high);
}

/**
 * Draw a plan into an SVG element.
 *
 * @param svg     the element
 * @param plan    the answer of the server
 * @param demand  {budget_ms} or {max_error}
 * @param titleOf turns the name of a method into a title
 */
export function drawPlans(svg, plan, demand, titleOf) {
  const points = plan.candidates;
  const times = points.map((point) => point.ms_per_frame);
  const low = 0.8 * Math.min(...times);
  const high = 1.25 * Math.max(...times);
  const top = 1.08 * Math.max(...points.map((point) => point.error));
  const across = (ms) => LEFT + ((WIDTH - LEFT - 8) * Math.log(ms / low)) / Math.log(high / low);
  const up = (error) => 8 + (HEIGHT - BOTTOM - 8) * (1 - error / top);
  const parts = [];
  for (const ms of ticks(low, high)) {
    const x = across(ms);
    parts.push(drawn("line", { x1: x, x2: x, y1: 8, y2: HEIGHT - BOTTOM, class: "grid" }));
    parts.push(drawn("text", { x, y: HEIGHT - BOTTOM + 13, "text-anchor": "middle" }, String(Number(ms.toPrecision(1)))));
  }
  const step = top > 1.5 ? 0.5 : top > 0.6 ? 0.25 : 0.1;
  for (let error = 0; error < top; error += step) {
    parts.push(drawn("line", { x1: LEFT, x2: WIDTH - 8, y1: up(error), y2: up(error), class: "grid" }));
    parts.push(drawn("text", { x: LEFT - 5, y: up(error) + 4, "text-anchor": "end" }, error.toFixed(2)));
  }
  parts.push(drawn("text", { x: WIDTH - 8, y: HEIGHT - 4, "text-anchor": "end" }, "ms a frame"));
  parts.push(drawn("text", { x: 2, y: HEIGHT - 4 }, "error"));
  if (demand.budget_ms >= low && demand.budget_ms <= high) {
    const x = across(demand.budget_ms);
    parts.push(drawn("line", { x1: x, x2: x, y1: 8, y2: HEIGHT - BOTTOM, class: "demand" }));
  } else if (demand.max_error <= top) {
    const y = up(demand.max_error);
    parts.push(drawn("line", { x1: LEFT, x2: WIDTH - 8, y1: y, y2: y, class: "demand" }));
  }
  for (const point of points) {
    const kind = point.name.split(" ")[0];
    const chosen = point.name === plan.name;
    const mark = drawn("circle", {
      cx: across(point.ms_per_frame),
      cy: up(point.error),
      r: chosen ? 6.5 : 3.5,
      class: `${KINDS.includes(kind) ? kind : "mpm"}${chosen ? " chosen" : ""}`,
    });
    mark.append(drawn("title", {}, `${titleOf(point.name)}: error ${point.error.toFixed(2)}, ${Number(point.ms_per_frame.toPrecision(2))} ms`));
    parts.push(mark);
  }
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  svg.replaceChildren(...parts);
}
