// A draft of a scene: its things, the chosen one, and undo.

import { sceneOf, thingsOf } from "./things.js";

const RESOLUTIONS = { 2: 128, 3: 32 }; // cells/m
const emptyBox = (dim) => ({
  name: "my scene",
  dim,
  resolution: RESOLUTIONS[dim],
  walls: { lower: new Array(dim).fill(0.1), upper: new Array(dim).fill(0.9) },
});
const LONGEST_WAY_BACK = 100;

/** A draft. `changed()` is called after each change of the things or of the choice. */
export class Draft {
  base = emptyBox(2);
  things = [];
  selected = -1;
  edited = false; // whether hands have changed it since it began with a scene
  wrong = new Set(); // indices of the things that the newest check found a fault in
  #before = []; // states to go back to
  #changed;

  constructor(changed) {
    this.#changed = changed;
  }

  get scene() {
    return sceneOf(this.base, this.things);
  }

  /** Sides of the world [m]. */
  get room() {
    return this.base.world?.size ?? new Array(this.base.dim).fill(1);
  }

  get canGoBack() {
    return this.#before.length > 0;
  }

  /** Keep the present state to go back to. */
  remember() {
    this.#before.push({ base: this.base, things: this.things });
    this.#before = this.#before.slice(-LONGEST_WAY_BACK);
  }

  #become({ base = this.base, things, selected = this.selected }) {
    Object.assign(this, { base, things, selected: Math.min(selected, things.length - 1), edited: true, wrong: new Set() });
    this.#changed();
  }

  /** Begin with a scene. */
  begin(scene) {
    this.remember();
    this.#become({ base: { ...scene, name: scene.name || "my scene" }, things: thingsOf(scene), selected: -1 });
    this.edited = false;
  }

  /** Begin with an empty box of so many dimensions. */
  empty(dim) {
    this.begin(emptyBox(dim));
  }

  /** Take another resolution [cells/m]. */
  refine(resolution) {
    this.remember();
    this.#become({ base: { ...this.base, resolution }, things: [...this.things] });
  }

  add(thing) {
    this.remember();
    this.#become({ things: [...this.things, thing], selected: this.things.length });
  }

  /** Replace the chosen thing; the start of a change keeps the state before it. */
  replace(thing) {
    this.#become({ things: this.things.map((one, index) => (index === this.selected ? thing : one)) });
  }

  remove() {
    this.remember();
    this.#become({ things: this.things.filter((_, index) => index !== this.selected), selected: -1 });
  }

  select(index) {
    if (index === this.selected) return;
    this.selected = index;
    this.#changed();
  }

  goBack() {
    const before = this.#before.pop();
    if (before === undefined) return;
    // What was changed stays chosen.
    this.#become({ ...before, selected: before.things.length === this.things.length ? this.selected : -1 });
  }

  mark(wrong) {
    this.wrong = wrong;
    this.#changed();
  }
}
