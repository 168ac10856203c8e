// Demonstrations of control: water and sand, flat and in space, along an arrow and into an oval.

import { ovalBetween } from "../sketch/sketch.js";

const ARROW = { kind: "arrow", points: [[0.35, 0.35], [0.6, 0.65]] };
const OVAL = { kind: "ellipse", points: ovalBetween([0.36, 0.45], [0.64, 0.7]) };
const MATERIALS = { water: "Water", sand: "Sand" };
const SHAPES = { arrow: ["along an arrow", ARROW], oval: ["into an oval", OVAL] };

const demoOf = (material, dim, shape) => ({
  title: `${MATERIALS[material]} ${SHAPES[shape][0]}${dim === 3 ? ", in space" : ""}`,
  preset: {
    scene: { scenario: `${material}_${dim}d`, seed: 0, solver: "mpm", coarse: null },
    frame: 60,
    sketch: SHAPES[shape][1],
    settings: { hold: 40 },
    seconds: 1,
    repeats: false,
  },
});

const names = Object.keys(MATERIALS).flatMap((material) =>
  [2, 3].flatMap((dim) => Object.keys(SHAPES).map((shape) => [material, dim, shape])),
);

/** By the name of its picture: {title, preset as in presets.js}. */
export const DEMOS = Object.fromEntries(names.map((parts) => [`${parts.join("-")}`, demoOf(...parts)]));
