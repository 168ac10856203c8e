// A draft of a scene: its things, the chosen one, and undo.

import { sceneOf, thingsOf } from "./things.js";

const EMPTY = { name: "my scene", dim: 2, resolution: 128, walls: { lower: [0.1, 0.1], upper: [0.9, 0.9] } };
const LONGEST_WAY_BACK = 100;

/** A draft. `changed()` is called after each change of the things or of the choice. */
export class Draft {
  base = EMPTY;
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

  /** Begin with a scene; null for an empty box. */
  begin(scene) {
    this.remember();
    const base = scene === null ? EMPTY : { ...scene, name: scene.name || "my scene" };
    this.#become({ base, things: scene === null ? [] : thingsOf(scene), selected: -1 });
    this.edited = false;
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
    if (before !== undefined) this.#become({ ...before, selected: -1 });
  }

  mark(wrong) {
    this.wrong = wrong;
    this.#changed();
  }
}
