// Shapes that no hand draws: words, and the dark parts of a picture. The service traces them; here they get their size.

const WAIT_MS = 250; // after the last key, before words are traced
const MOST_LETTERS = 100;
const MOST_BYTES = 1 << 20; // of a picture
const HEIGHT = 0.3; // of what the service traces, over the longest side of the world; fitted here
const WIDEST = 0.9; // part of the room that a shape may take
const TYPES = ["image/png", "image/jpeg", "image/webp"];

/** Bytes of a file as base 64. */
async function base64(file) {
  const bytes = new Uint8Array(await file.arrayBuffer());
  let text = "";
  for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
  return btoa(text);
}

function element(name, properties, label) {
  const made = Object.assign(document.createElement(name), properties);
  made.setAttribute("aria-label", label);
  return made;
}

export class Outlines {
  #root;
  #parts;
  #words;
  #size;
  #follow;
  #traced = null; // {outlines, area} of the service, in longest sides of the world
  #timer = 0;
  #call = new AbortController();

  /** @param parts {walls() -> {lower, upper}, trace(request, signal) -> promise of {outlines, area}, area() -> that of the fluid or null, propose({points, outlines}), withdraw(), accept(), refused(problem)}; all lengths over the longest side of the world */
  constructor(root, parts) {
    [this.#root, this.#parts] = [root, parts];
    this.#words = element("input", { type: "text", maxLength: MOST_LETTERS, placeholder: "Words to fill" }, "Words that the fluid fills");
    const file = element("input", { type: "file", accept: TYPES.join(","), hidden: true }, "Picture whose dark parts the fluid fills");
    const open = element("button", { type: "button", className: "quiet", textContent: "Picture…" }, "Open a picture, whose dark parts the fluid fills");
    this.#size = element("input", { type: "range", min: 0.5, max: 2, step: 0.05, value: 1 }, "Size of the shape");
    this.#follow = element("button", { type: "button", className: "solid", textContent: "Fill", disabled: true }, "Fill the shape");
    root.append(this.#words, open, file, this.#size, this.#follow);
    this.#words.addEventListener("input", () => {
      clearTimeout(this.#timer);
      this.#timer = setTimeout(() => this.#ask({ text: this.#words.value }, this.#words.value.trim() === ""), WAIT_MS);
    });
    this.#words.addEventListener("keydown", ({ key }) => key === "Enter" && this.#send());
    open.addEventListener("click", () => file.click());
    file.addEventListener("change", () => {
      if (file.files.length > 0) this.read(file.files[0]);
      file.value = "";
    });
    root.addEventListener("dragover", (event) => event.preventDefault());
    root.addEventListener("drop", (event) => {
      event.preventDefault();
      if (event.dataTransfer.files.length > 0) this.read(event.dataTransfer.files[0]);
    });
    this.#size.addEventListener("input", () => this.#propose());
    this.#follow.addEventListener("click", () => this.#send());
  }

  /** Take a picture of which the dark parts are to be filled. */
  async read(file) {
    if (file.size > MOST_BYTES) {
      this.#refuse("The picture is too large", "It may have 1 MiB.", "Save it smaller.");
    } else if (!TYPES.includes(file.type)) {
      this.#refuse("The file is no picture", "It must be a PNG, JPEG or WebP.", "Open one with dark parts on a light ground.");
    } else {
      this.#words.value = "";
      this.#ask({ picture: await base64(file) });
    }
  }

  #refuse(title, detail, advice) {
    this.#parts.refused({ title, detail, advice, hint: true });
  }

  /** Drop what was traced, and what is proposed. */
  forget() {
    clearTimeout(this.#timer);
    this.#call.abort();
    this.#traced = null;
    this.#follow.disabled = true;
    this.#parts.withdraw();
  }

  async #ask(source, isEmpty = false) {
    this.forget();
    if (isEmpty) return;
    this.#call = new AbortController();
    const { signal } = this.#call;
    try {
      const traced = await this.#parts.trace({ ...source, center: [0.5, 0.5], height: HEIGHT }, signal);
      if (signal.aborted) return;
      this.#traced = traced;
      this.#follow.disabled = false;
      this.#propose();
    } catch (problem) {
      if (!signal.aborted) this.#parts.refused(problem);
    }
  }

  /** Show the shape with the area of the fluid times the chosen size, at most as large as the room, in its middle. */
  #propose() {
    if (this.#traced === null) return;
    const { outlines, area } = this.#traced;
    const { lower, upper } = this.#parts.walls();
    const points = outlines.flat();
    const ends = [0, 1].map((axis) => points.reduce(([low, high], point) => [Math.min(low, point[axis]), Math.max(high, point[axis])], [Infinity, -Infinity]));
    const fluid = this.#parts.area();
    const most = Math.min(...ends.map(([low, high], axis) => (WIDEST * (upper[axis] - lower[axis])) / (high - low)));
    const scale = Math.min(most, this.#size.valueAsNumber * (fluid === null ? 1 : Math.sqrt(fluid / area)));
    const place = (point) => point.map((x, axis) => (lower[axis] + upper[axis]) / 2 + scale * (x - (ends[axis][0] + ends[axis][1]) / 2));
    const placed = outlines.map((line) => line.map(place));
    this.#parts.propose({ points: placed[0], outlines: placed });
  }

  #send() {
    if (this.#traced === null) return;
    this.#propose(); // something else may have been drawn meanwhile
    this.#parts.accept();
  }
}
