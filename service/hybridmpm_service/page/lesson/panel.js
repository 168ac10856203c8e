// The card of a lesson: what is seen, a question, what the simulation measures beside what is exact, and a chart of both.

import { byId, setText } from "../panels/dom.js";
import { drawChart } from "./chart.js";
import { figuresOf, MEASURES } from "./measures.js";

const EVERY_SECONDS = 0.01; // from one reading to the next
const MOST = 1200; // readings; then every other one is left out

const number = (value) => (Number.isFinite(value) ? value.toPrecision(3) : "–");

/** A lesson of the gallery, which reads the frames that are shown. */
export class Lesson {
  #about;
  #spacing;
  #before = null;
  #series = []; // {time [s], values, exact}

  /**
   * @param about an entry of gallery/entries.json
   * @param spacing of the particles [m]
   */
  constructor(about, spacing) {
    this.#about = about;
    this.#spacing = spacing;
    setText("lesson-title", about.title);
    setText("lesson-about", about.about);
    setText("lesson-question", about.question);
    setText("lesson-answer", about.answer);
    setText("lesson-try", about.try);
    setText("lesson-law", about.law);
    byId("lesson-more").open = false;
    byId("lesson").hidden = false;
    this.#show();
  }

  /** Read a frame that is shown. */
  note(frame) {
    const { measure } = this.#about;
    const last = this.#series.at(-1);
    if (last !== undefined && frame.time < last.time) [this.#series, this.#before] = [[], null];
    if (last !== undefined && frame.time >= last.time && frame.time < last.time + EVERY_SECONDS) return;
    const found = MEASURES[measure.kind].read(measure, { frame, before: this.#before, spacing: this.#spacing }, this.#series);
    this.#before = frame;
    if (found === null) return;
    this.#series.push({ time: frame.time, ...found });
    if (this.#series.length > MOST) this.#series = this.#series.filter((_, i) => i % 2 === 0);
    this.#show();
  }

  #show() {
    const { measure } = this.#about;
    const { factor = 1, unit } = measure;
    const { measured, exact } = figuresOf(measure, this.#series);
    const text = measured.map((value) => number(factor * value)).join(" and ");
    setText("lesson-measured", measured.length === 0 ? "not yet" : `${text} ${unit}`);
    setText("lesson-exact", exact === null || exact === undefined ? "–" : `${number(factor * exact)} ${unit}`);
    const { chart = measure } = measure;
    drawChart(byId("lesson-chart"), this.#series, { factor: chart.factor ?? 1, unit: chart.unit, names: measure.names, exact: measure.exactly });
  }
}
