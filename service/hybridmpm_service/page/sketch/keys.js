// The keyboard on the stage: arrow keys move a cursor, Enter puts the tool down there and lifts it again.

const STEP = 0.02; // of the stage's longer side; with Shift five times as far
const TURN = 14; // px by which an arrow key turns the scene
const ZOOM = 1.1;
const DEEPER = { PageUp: -1, PageDown: 1 };
const WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** Follows the keys while an element has the focus. The handlers are those of `StagePointer`, and two more. */
export class StageKeys {
  #element;
  #handlers;
  #at = null; // the cursor [px]; null before the first focus
  #down = false;

  /** @param handlers {mode(), begin(p), extend(ps), finish(), cancel(), orbit(dx, dy), zoom(f), cursor(at or null)} */
  constructor(element, handlers) {
    this.#element = element;
    this.#handlers = handlers;
    element.addEventListener("keydown", (event) => this.#press(event));
    element.addEventListener("focus", () => this.#show(element.matches(":focus-visible")));
    element.addEventListener("blur", () => {
      this.abort();
      this.#show(false);
    });
  }

  /** Drop the stroke in progress. */
  abort() {
    if (!this.#down) return;
    this.#down = false;
    this.#handlers.cancel();
  }

  get #sides() {
    return [this.#element.clientWidth, this.#element.clientHeight];
  }

  #show(whether) {
    this.#at ??= this.#sides.map((side) => side / 2);
    this.#handlers.cursor(whether && this.#handlers.mode() === "stroke" ? this.#at : null);
  }

  #press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const way = WAYS[event.key];
    if (this.#handlers.mode() === "orbit") this.#look(event, way);
    else if (way !== undefined) this.#move(event, way);
    else if (event.key === "Enter") this.#toggle(event);
    else if (event.key in DEEPER && this.#handlers.deepen(DEEPER[event.key])) event.preventDefault();
  }

  #look(event, way) {
    if (way !== undefined) this.#handlers.orbit(TURN * way[0], TURN * way[1]);
    else if (event.key === "+" || event.key === "-") this.#handlers.zoom(event.key === "+" ? ZOOM : 1 / ZOOM);
    else return;
    event.preventDefault();
  }

  #move(event, way) {
    event.preventDefault();
    const sides = this.#sides;
    const step = (event.shiftKey ? 5 : 1) * STEP * Math.max(...sides);
    this.#at ??= sides.map((side) => side / 2);
    this.#at = this.#at.map((value, axis) => Math.min(sides[axis], Math.max(0, value + step * way[axis])));
    if (this.#down) this.#handlers.extend([this.#sample(event)]);
    this.#show(true);
  }

  #toggle(event) {
    event.preventDefault();
    if (event.repeat) return;
    this.#show(true);
    this.#down = !this.#down;
    if (this.#down) this.#handlers.begin(this.#sample(event));
    else this.#handlers.finish();
  }

  #sample(event) {
    return { at: this.#at, time: event.timeStamp / 1000 };
  }
}
