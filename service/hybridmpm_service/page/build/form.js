// Number fields of the chosen thing.

import { byId, setText } from "../panels/dom.js";
import { sized } from "./rigid.js";
import { become, boundsOf, DIRECTIONS, directionOf, MATERIALS, materialOf, moved, nameOf, otherShape, resized, scaled, turned } from "./things.js";

const LIMIT = { min: 0, max: 1, step: 0.01 };

function number(label, unit, value, change, { min, max, step } = LIMIT) {
  const field = document.createElement("label");
  field.className = "field";
  const input = Object.assign(document.createElement("input"), { type: "number", min, max, step: "any", value: Number(value.toFixed(4)) });
  input.dataset.step = step;
  input.addEventListener("change", () => {
    if (input.value !== "" && input.validity.valid) change(Number(input.value));
  });
  field.append(`${label} [${unit}]`, input);
  return field;
}

function choice(label, options, value, change) {
  const field = document.createElement("label");
  field.className = "field";
  const select = document.createElement("select");
  select.append(...Object.entries(options).map(([key, text]) => new Option(text, key, false, key === value)));
  select.addEventListener("change", () => change(select.value));
  field.append(label, select);
  return field;
}

/** The fields of a thing, each of which calls `change` with the thing as it is then. */
function fieldsOf(thing, change) {
  const { part, record } = thing;
  const bounds = boundsOf(thing);
  if (bounds === null) return [];
  const [lower, upper] = bounds;
  const at = [(lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2];
  const fields = ["x", "y"].map((name, k) =>
    number(`Middle ${name}`, "m", at[k], (value) => change(moved(thing, k === 0 ? [value - at[0], 0] : [0, value - at[1]]))),
  );
  const grown = (k, size) => part === "rigid" ? { ...thing, record: sized(record, k, size) } : resized(thing, "upper", record.upper.map((x, axis) => (axis === k ? record.lower[k] + size : x)));
  if (record.lower !== undefined) {
    ["Width", "Height"].forEach((name, k) => {
      const side = record.upper[k] - record.lower[k];
      if (side > 0) fields.push(number(name, "m", side, (size) => change(grown(k, size))));
    });
  } else if (record.radius !== undefined) {
    fields.push(number("Radius", "m", record.radius, (radius) => change(resized(thing, "rim", [record.center[0] + radius, record.center[1]]))));
  } else if (record.thickness !== undefined) {
    fields.push(number("Thickness", "m", record.thickness, (thickness) => change({ ...thing, record: { ...record, thickness } })));
  }
  if (record.shape === "polygon") {
    fields.push(number("Height", "m", upper[1] - lower[1], (height) => change(scaled(thing, height)), { ...LIMIT, min: 0.01 }));
    const isSolid = part === "obstacles";
    fields.push(choice("Acts as", { solid: "obstacle", material: "body" }, isSolid ? "solid" : "material", (what) => change(become(thing, what === "solid" ? "solid" : "water"))));
  }
  const set = (name) => (value) => change({ ...thing, record: { ...record, [name]: value } });
  if (part === "rigid") {
    fields.push(number("Density", "kg/m³", record.density ?? 500, set("density"), { min: 1, max: 20_000, step: 50 }));
    if (record.radius === undefined) {
      const degrees = Math.round(((record.rotation ?? 0) * 1800) / Math.PI) / 10;
      fields.push(number("Turned", "°", degrees, (angle) => set("rotation")((angle * Math.PI) / 180), { min: -180, max: 180, step: 5 }));
    }
    fields.push(number("Spin", "rad/s", record.angular_velocity ?? 0, set("angular_velocity"), { min: -100, max: 100, step: 1 }));
    fields.push(number("Friction", "-", record.friction ?? 0.3, set("friction"), { min: 0, max: 10, step: 0.1 }));
    fields.push(number("Bounce", "-", record.restitution ?? 0, set("restitution"), { min: 0, max: 1, step: 0.1 }));
  }
  if (part === "bodies" || part === "rigid") {
    const velocity = record.velocity ?? [0, 0];
    const along = (k) => (value) => set("velocity")(velocity.map((v, axis) => (axis === k ? value : v)));
    ["x", "y"].forEach((name, k) => fields.push(number(`Speed ${name}`, "m/s", velocity[k], along(k), { min: -10, max: 10, step: 0.1 })));
  }
  const direction = part === "emitters" ? directionOf(thing) : null;
  if (direction !== null) {
    fields.push(choice("Flows", Object.fromEntries(Object.keys(DIRECTIONS).map((name) => [name, name])), direction, (name) => change(turned(thing, name))));
    fields.push(number("Speed", "m/s", Math.hypot(...record.velocity), (speed) => change(turned(thing, direction, speed)), { min: 0.1, max: 10, step: 0.1 }));
  }
  if (part === "bodies" || part === "emitters") {
    const name = materialOf(record);
    const options = name in MATERIALS ? MATERIALS : { ...MATERIALS, [name]: "Liquid" };
    fields.push(choice("Material", options, name, (material) => change({ ...thing, record: { ...record, material } })));
  }
  if (otherShape(thing) !== null) {
    fields.push(choice("Shape", { box: "box", ball: "ball" }, record.shape, () => change(otherShape(thing))));
  }
  return fields;
}

/** Show the numbers of the chosen thing of a draft, or what to do where none is chosen. */
export function showForm(draft) {
  const thing = draft.things[draft.selected];
  byId("build-fields").hidden = thing === undefined;
  byId("build-hint").hidden = thing !== undefined;
  if (thing === undefined) return;
  setText("build-name", nameOf(thing, draft.things));
  const focused = [...byId("build-numbers").children].findIndex((field) => field.contains(document.activeElement));
  const change = (next) => {
    draft.remember();
    draft.replace(next);
  };
  byId("build-numbers").replaceChildren(...fieldsOf(thing, change));
  byId("build-numbers").children[focused]?.querySelector("input, select").focus();
}
