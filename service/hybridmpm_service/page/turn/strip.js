// Sketches that wait for their turn: a strip of keyframes, which are sorted by dragging, timed, and followed together.

const MOST = 32; // keyframes that the service takes
const NAMES = { arrow: "Arrow", ellipse: "Oval", shape: "Shape" };

/** A small picture of a sketch, in a world with sides in the longest one. */
function picture({ kind, points, outlines }, [width, height]) {
  const space = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(space, "svg");
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.setAttribute("aria-hidden", "true");
  for (const one of outlines ?? [points]) {
    const line = document.createElementNS(space, kind === "arrow" ? "polyline" : "polygon");
    line.setAttribute("points", one.map(([x, y]) => `${x.toFixed(3)},${(height - y).toFixed(3)}`).join(" "));
    line.setAttribute("class", kind);
    svg.append(line);
  }
  if (kind === "arrow") {
    const [x, y] = points.at(-1);
    const tip = document.createElementNS(space, "circle");
    for (const [name, value] of [["cx", x], ["cy", height - y], ["r", 0.04]]) tip.setAttribute(name, String(value));
    svg.append(tip);
  }
  return svg;
}

function button(text, label, action) {
  const made = document.createElement("button");
  made.type = "button";
  made.className = "quiet";
  made.textContent = text;
  made.setAttribute("aria-label", label);
  made.addEventListener("click", action);
  return made;
}

export class Strip {
  #root;
  #list = document.createElement("ol");
  #follow;
  #hint = document.createElement("p");
  #items = []; // {sketch, goal, frames, hold, who}
  #sent = []; // those that are followed
  #present = null; // number of the one that is followed among them
  #dragged = null;
  #parts;

  /** @param parts {sides() -> of the world, follow(keyframes), left() -> frames that the present one has left, full()} */
  constructor(root, parts) {
    this.#root = root;
    this.#parts = parts;
    this.#follow = button("Follow", "Follow the sketches in turn", () => this.#send());
    this.#follow.className = "solid";
    const clear = button("Clear", "Remove all sketches that wait", () => this.#change(() => (this.#items = [])));
    this.#hint.className = "note";
    root.append(this.#list, this.#hint, this.#follow, clear);
    this.#render();
  }

  get shows() {
    return !this.#root.hidden;
  }

  show(whether) {
    this.#root.hidden = !whether;
  }

  /** Take a sketch that was drawn, with what the service takes for it; returns whether it waits here. */
  takes(sketch, goal, { frames = null, hold = 0, who = null }) {
    if (this.#root.hidden) return false;
    if (this.#items.length === MOST) this.#parts.full(MOST);
    else this.#change(() => this.#items.push({ sketch, goal, frames, hold, who }));
    return true;
  }

  /** Note which of the keyframes that were sent is followed; null for none. */
  note(number) {
    if (number === this.#present) return;
    this.#present = number;
    this.#render();
  }

  #change(action) {
    action();
    this.#render();
  }

  #move(from, to) {
    if (to < 0 || to >= this.#items.length) return;
    this.#change(() => this.#items.splice(to, 0, ...this.#items.splice(from, 1)));
  }

  /** Send all, or, while they are followed, the present one with the frames that it has left, and those after it. */
  #send() {
    const present = this.#present === null ? -1 : this.#items.indexOf(this.#sent[this.#present]);
    const rest = present < 0 ? this.#items : this.#items.slice(present);
    if (rest.length === 0) return;
    this.#sent = rest;
    const left = present < 0 ? null : this.#parts.left();
    this.#parts.follow(rest.map((one, i) => (i === 0 && left !== null ? { ...one, frames: left } : one)));
  }

  #render() {
    const present = this.#present === null ? null : this.#sent[this.#present];
    this.#list.replaceChildren(...this.#items.map((one, place) => this.#item(one, place, one === present)));
    this.#hint.textContent = this.#items.length === 0 ? "Draw arrows, ovals and shapes: they wait here for their turn." : "";
    this.#follow.disabled = this.#items.length === 0;
    this.#follow.textContent = present === null || present === undefined ? "Follow" : "Follow as changed";
  }

  #item(one, place, isPresent) {
    const item = document.createElement("li");
    const name = `${NAMES[one.sketch.kind]} ${place + 1}`;
    item.draggable = true;
    if (isPresent) item.setAttribute("aria-current", "step");
    const frames = document.createElement("input");
    Object.assign(frames, { type: "number", min: 1, max: 999, placeholder: "auto", value: one.frames ?? "", title: "Frames to this goal" });
    frames.setAttribute("aria-label", `Frames of ${name}`);
    frames.addEventListener("change", () => (one.frames = frames.checkValidity() && frames.value !== "" ? frames.valueAsNumber : null));
    item.append(
      picture(one.sketch, this.#parts.sides()),
      frames,
      button("‹", `Move ${name} forward`, () => this.#move(place, place - 1)),
      button("›", `Move ${name} back`, () => this.#move(place, place + 1)),
      button("×", `Remove ${name}`, () => this.#change(() => this.#items.splice(place, 1))),
    );
    item.addEventListener("dragstart", (event) => {
      this.#dragged = place;
      event.dataTransfer.effectAllowed = "move";
      event.dataTransfer.setData("text/plain", name);
    });
    item.addEventListener("dragover", (event) => {
      if (this.#dragged !== null) event.preventDefault();
    });
    item.addEventListener("drop", (event) => {
      event.preventDefault();
      if (this.#dragged !== null) this.#move(this.#dragged, place);
    });
    item.addEventListener("dragend", () => (this.#dragged = null));
    return item;
  }
}
