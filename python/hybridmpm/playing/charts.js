// Readings of probes over time, as charts beside the picture.

const LINES = ["#3d9be9", "#e0913a", "#3fae6a", "#c56bd6", "#d05a5a", "#8a97a8"];
const MOST_READINGS = 3000; // that a chart keeps
const TALL = 110; // height of a chart [px]
const SIDE = 46; // room for the numbers beside it [px]

/** A number with three digits that count. */
function short(value) {
  if (!Number.isFinite(value)) return "\u2013";
  const size = Math.abs(value);
  if (size >= 1e5 || (size > 0 && size < 1e-3)) return value.toExponential(1);
  return size >= 1000 ? String(Math.round(value)) : String(Number(value.toPrecision(3)));
}

class Chart {
  readings = []; // [time [s], numbers]
  #unit;
  #value = document.createElement("output");
  #canvas = document.createElement("canvas");

  constructor({ name, unit }, into) {
    this.#unit = unit === "1" ? "" : unit;
    const [box, head] = [document.createElement("figure"), document.createElement("figcaption")];
    const title = document.createElement("b");
    title.textContent = name;
    head.append(title, this.#value);
    this.#canvas.setAttribute("role", "img");
    this.#canvas.setAttribute("aria-label", `${name} over time`);
    box.append(head, this.#canvas);
    into.append(box);
  }

  clear() {
    this.readings = [];
  }

  add(time, numbers) {
    this.readings.push([time, numbers]);
    if (this.readings.length > MOST_READINGS) this.readings.shift();
  }

  draw() {
    const last = this.readings[this.readings.length - 1];
    this.#value.value = last === undefined ? "" : `${last[1].map(short).join(", ")} ${this.#unit}`;
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const width = this.#canvas.clientWidth;
    if (width === 0 || last === undefined) return;
    [this.#canvas.width, this.#canvas.height] = [Math.round(width * ratio), TALL * ratio];
    const pen = this.#canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const finite = this.readings.flatMap(([, numbers]) => numbers.filter(Number.isFinite));
    let [low, high] = [Math.min(0, ...finite), Math.max(...finite, 0)];
    if (high === low) high = low + 1;
    const start = this.readings[0][0];
    const seconds = Math.max(last[0] - start, 0.1);
    const across = (time) => SIDE + ((time - start) / seconds) * (width - SIDE - 6);
    const down = (value) => TALL - 20 - ((value - low) / (high - low)) * (TALL - 28);
    const style = getComputedStyle(this.#canvas);
    pen.font = "11px system-ui, sans-serif";
    pen.fillStyle = style.color;
    pen.strokeStyle = style.borderColor;
    pen.textAlign = "right";
    for (const value of new Set([low, high, 0])) {
      pen.beginPath();
      pen.moveTo(SIDE, down(value));
      pen.lineTo(width - 6, down(value));
      pen.stroke();
      pen.fillText(short(value), SIDE - 5, down(value) + 4);
    }
    pen.fillText(`${short(start + seconds)} s`, width - 6, TALL - 5);
    pen.textAlign = "left";
    pen.fillText(`${short(start)} s`, SIDE, TALL - 5);
    pen.lineWidth = 1.6;
    for (let i = 0; i < last[1].length; i += 1) {
      pen.strokeStyle = LINES[i % LINES.length];
      pen.beginPath();
      let isDown = false; // no line leads across readings that do not exist
      for (const [time, numbers] of this.readings) {
        const exists = Number.isFinite(numbers[i]);
        if (exists && isDown) pen.lineTo(across(time), down(numbers[i]));
        else if (exists) pen.moveTo(across(time), down(numbers[i]));
        isDown = exists;
      }
      pen.stroke();
    }
  }
}
