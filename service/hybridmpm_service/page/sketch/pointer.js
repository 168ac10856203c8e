// Mouse, pen and touch on the stage, turned into strokes (world units) or into camera moves.

/** Follows the pointers on an element. The handlers decide what a gesture means. */
export class StagePointer {
  #element;
  #handlers;
  #pointers = new Map(); // id -> last [px, py]
  #stroke = null; // id of the pointer that draws

  /** @param handlers {mode(): "stroke"|"orbit", begin(p), extend(ps), finish(), cancel(), orbit(dx, dy), zoom(f),
   *   deepen(steps) -> whether there is a depth} */
  constructor(element, handlers) {
    this.#element = element;
    this.#handlers = handlers;
    element.addEventListener("pointerdown", (event) => this.#down(event));
    element.addEventListener("pointermove", (event) => this.#move(event));
    element.addEventListener("pointerup", (event) => this.#up(event));
    element.addEventListener("pointercancel", (event) => this.#drop(event));
    element.addEventListener("contextmenu", (event) => event.preventDefault());
    element.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
  }

  /** Drop the stroke in progress. */
  abort() {
    if (this.#stroke === null) return;
    this.#stroke = null;
    this.#handlers.cancel();
  }

  #at(event) {
    const box = this.#element.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  #down(event) {
    if (event.pointerType === "mouse" && event.button !== 0) return;
    event.preventDefault();
    document.activeElement?.blur(); // keys go to the player again, not to the field edited last
    this.#element.setPointerCapture(event.pointerId);
    this.#pointers.set(event.pointerId, this.#at(event));
    if (this.#handlers.mode() !== "stroke") return;
    if (this.#pointers.size > 1) {
      this.abort(); // a second finger means a gesture, not a drawing
      return;
    }
    this.#stroke = event.pointerId;
    this.#handlers.begin({ at: this.#at(event), time: event.timeStamp / 1000 });
  }

  #move(event) {
    const last = this.#pointers.get(event.pointerId);
    if (last === undefined) return;
    const at = this.#at(event);
    if (this.#stroke === event.pointerId) {
      const events = event.getCoalescedEvents?.() ?? [];
      const samples = events.length > 0 ? events : [event];
      this.#handlers.extend(samples.map((sample) => ({ at: this.#at(sample), time: sample.timeStamp / 1000 })));
    } else if (this.#handlers.mode() === "orbit") {
      this.#navigate(event.pointerId, last, at);
    }
    this.#pointers.set(event.pointerId, at);
  }

  /** One pointer turns the scene, two move it nearer or further. */
  #navigate(id, last, at) {
    if (this.#pointers.size === 1) {
      this.#handlers.orbit(at[0] - last[0], at[1] - last[1]);
      return;
    }
    const [other] = [...this.#pointers].filter(([key]) => key !== id).map(([, place]) => place);
    const spread = (place) => Math.hypot(place[0] - other[0], place[1] - other[1]);
    if (spread(last) > 0) this.#handlers.zoom(spread(at) / spread(last));
  }

  #up(event) {
    this.#pointers.delete(event.pointerId);
    if (this.#stroke !== event.pointerId) return;
    this.#stroke = null;
    this.#handlers.finish();
  }

  #drop(event) {
    this.#pointers.delete(event.pointerId);
    if (this.#stroke === event.pointerId) this.abort();
  }

  #wheel(event) {
    if (this.#handlers.mode() === "orbit") this.#handlers.zoom(Math.exp(-0.0012 * event.deltaY));
    else if (!this.#handlers.deepen(Math.sign(event.deltaY))) return;
    event.preventDefault();
  }
}
