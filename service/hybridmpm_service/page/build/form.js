// Number fields of the chosen thing.

import { byId, setText } from "../panels/dom.js";
import { sized } from "./rigid.js";
import { cylinderAlong, lieOf, turnedBy } from "./space.js";
import { become, boundsOf, directionOf, directionsOf, MATERIALS, materialOf, moved, nameOf, reshaped, scaled, shapesOf, sidedBox, turned } from "./things.js";

const NAMES = ["x", "y", "z"];
const SIDES = ["Width", "Height", "Depth"];
const TURNS = { none: "as it is", x: "90° about x", y: "90° about y", z: "90° about z" };
const SLANTED = "slanted";
const SMALLEST = 0.01; // m

function number(label, unit, value, change, { min, max, step = 0.01 }) {
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

const named = (names) => Object.fromEntries(names.map((name) => [name, name]));
const degrees = (angle) => Math.round((angle * 1800) / Math.PI) / 10;
const radians = (angle) => (angle * Math.PI) / 180;
const replaced = (list, k, value) => list.map((x, axis) => (axis === k ? value : x));

/** A field for each axis. `change` takes all numbers. */
const vector = (label, unit, values, change, range) => values.map((value, k) => number(`${label} ${NAMES[k]}`, unit, value, (next) => change(replaced(values, k, next)), range));

/** The fields of a thing, each of which calls `change` with the thing as it is then. `room` has the sides of the world [m]. */
function fieldsOf(thing, room, change) {
  const bounds = boundsOf(thing);
  if (bounds === null) return [];
  const middle = bounds[0].map((x, k) => (x + bounds[1][k]) / 2);
  const length = { min: 0, max: Math.max(...room) };
  return [
    ...vector("Middle", "m", middle, (to) => change(moved(thing, to.map((x, k) => x - middle[k]), room)), length),
    ...sizesOf(thing, room, change, length),
    ...(thing.part === "rigid" ? numbersOfRigid(thing, change) : []),
    ...motionOf(thing, change),
    ...flowOf(thing, room, change),
    ...kindOf(thing, room, change),
  ];
}

function sizesOf(thing, room, change, length) {
  const { part, record } = thing;
  const become = (fields) => change({ ...thing, record: { ...record, ...fields } });
  const radius = () => number("Radius", "m", record.radius, (value) => become({ radius: Math.max(SMALLEST, value) }), length);
  if (record.lower !== undefined) {
    const sides = record.upper.map((x, k) => x - record.lower[k]);
    const grown = (k, side) => (part === "rigid" ? { ...thing, record: sized(record, k, side) } : sidedBox(thing, k, side, room));
    return sides.flatMap((side, k) => (side > 0 ? [number(SIDES[k], "m", side, (next) => change(grown(k, next)), { ...length, min: SMALLEST })] : []));
  }
  if (record.shape === "cylinder") {
    const { length: long, axis } = lieOf(record);
    const lies = axis < 0 ? SLANTED : NAMES[axis];
    return [
      radius(),
      number("Length", "m", long, (next) => change({ ...thing, record: cylinderAlong(record, next) }), { ...length, min: SMALLEST }),
      choice("Axis", named(axis < 0 ? [...NAMES, SLANTED] : NAMES), lies, (name) => change({ ...thing, record: cylinderAlong(record, long, NAMES.indexOf(name)) })),
    ];
  }
  if (record.radius !== undefined) return [radius()];
  if (record.thickness !== undefined) return [number("Thickness", "m", record.thickness, (thickness) => become({ thickness }), length)];
  return record.vertices === undefined ? [] : shapeOf(thing, room, change, length);
}

/** Of a polygon or a surface: its height, what it is, and how it lies. */
function shapeOf(thing, room, change, length) {
  const isSolid = thing.part === "obstacles";
  const [lower, upper] = boundsOf(thing);
  const isSurface = room.length === 3;
  const parts = { solid: "obstacle", material: "body", ...(isSurface ? { rigid: "rigid body: its convex hull" } : {}) };
  const fields = [
    number("Height", "m", upper[1] - lower[1], (height) => change(scaled(thing, height, room)), { ...length, min: SMALLEST }),
    choice("Acts as", parts, isSolid ? "solid" : "material", (what) => change(become(thing, what === "material" ? "water" : what))),
  ];
  const quarter = (name) => NAMES.map((axis) => (axis === name ? Math.PI / 2 : 0));
  if (isSurface) fields.push(choice("Turn", TURNS, "none", (name) => change({ ...thing, record: turnedBy(thing.record, quarter(name)) })));
  return fields;
}

function numbersOfRigid(thing, change) {
  const { record } = thing;
  const set = (name) => (value) => change({ ...thing, record: { ...record, [name]: value } });
  const fields = [number("Density", "kg/m³", record.density ?? 500, set("density"), { min: 1, max: 20_000, step: 50 })];
  const inSpace = (record.lower ?? record.center ?? record.start ?? record.points[0]).length === 3;
  const [angle, spin] = [{ min: -180, max: 180, step: 5 }, { min: -100, max: 100, step: 1 }];
  const contact = [
    number("Friction", "-", record.friction ?? 0.3, set("friction"), { min: 0, max: 10, step: 0.1 }),
    number("Bounce", "-", record.restitution ?? 0, set("restitution"), { min: 0, max: 1, step: 0.1 }),
  ];
  if (inSpace) {
    const still = [0, 0, 0];
    fields.push(...contact);
    // A cylinder has its axis, a ball looks the same however it is turned.
    if (record.radius === undefined) fields.push(...vector("Turned", "°", (record.rotation ?? still).map(degrees), (turn) => set("rotation")(turn.map(radians)), angle));
    fields.push(...vector("Spin", "rad/s", record.angular_velocity ?? still, set("angular_velocity"), spin));
  } else {
    if (record.radius === undefined) fields.push(number("Turned", "°", degrees(record.rotation ?? 0), (turn) => set("rotation")(radians(turn)), angle));
    fields.push(number("Spin", "rad/s", record.angular_velocity ?? 0, set("angular_velocity"), spin), ...contact);
  }
  return fields;
}

function motionOf(thing, change) {
  if (thing.part !== "bodies" && thing.part !== "rigid") return [];
  const velocity = thing.record.velocity ?? boundsOf(thing)[0].map(() => 0);
  return vector("Speed", "m/s", velocity, (next) => change({ ...thing, record: { ...thing.record, velocity: next } }), { min: -10, max: 10, step: 0.1 });
}

function flowOf(thing, room, change) {
  const direction = thing.part === "emitters" ? directionOf(thing) : null;
  if (direction === null) return [];
  const names = named(Object.keys(directionsOf(room.length)));
  return [
    choice("Flows", names, direction, (name) => change(turned(thing, name, room))),
    number("Speed", "m/s", Math.hypot(...thing.record.velocity), (speed) => change(turned(thing, direction, room, speed)), { min: 0.1, max: 10, step: 0.1 }),
  ];
}

function kindOf(thing, room, change) {
  const { part, record } = thing;
  const fields = [];
  if (part === "bodies" || part === "emitters") {
    const name = materialOf(record);
    const options = name in MATERIALS ? MATERIALS : { ...MATERIALS, [name]: "Liquid" };
    fields.push(choice("Material", options, name, (material) => change({ ...thing, record: { ...record, material } })));
  }
  const shapes = shapesOf(thing);
  if (shapes.length > 0) fields.push(choice("Shape", named(shapes), record.shape, (shape) => change(reshaped(thing, shape, room))));
  return fields;
}

/** Show the numbers of the chosen thing of a draft, or those of the scene and what to do where none is chosen. */
export function showForm(draft) {
  const thing = draft.things[draft.selected];
  byId("build-hint").hidden = thing !== undefined;
  byId("build-delete").hidden = thing === undefined;
  setText("build-name", thing === undefined ? "Scene" : nameOf(thing, draft.things));
  const focused = [...byId("build-numbers").children].findIndex((field) => field.contains(document.activeElement));
  const change = (next) => {
    draft.remember();
    draft.replace(next);
  };
  const scene = () => number("Resolution", "cells/m", draft.base.resolution, (resolution) => draft.refine(Math.round(resolution)), { min: 8, max: 4096, step: 8 });
  byId("build-numbers").replaceChildren(...(thing === undefined ? [scene()] : fieldsOf(thing, draft.room, change)));
  byId("build-numbers").children[focused]?.querySelector("input, select").focus();
}
