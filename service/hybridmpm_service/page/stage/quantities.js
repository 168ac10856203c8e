// What particles may be coloured by: one byte for each of them, on a scale that has a unit.

import { FASTEST } from "./particles.js";

const DENSEST = 2; // density over that at rest that the byte 255 stands for
const CELL_SPACINGS = 2; // side of a cell in which particles are counted [spacings at rest]

/** By name: title, unit and what the upper end of the scale stands for. Without one, each material has its own look. */
export const QUANTITIES = {
  speed: { title: "Speed", unit: "m/s", most: FASTEST },
  density: { title: "Density", unit: "× rest", most: DENSEST },
};

/**
 * Density of the matter at each particle over that at rest, one byte each (255 = DENSEST), and the volume of all matter.
 *
 * Particles are counted on a grid, each by linear shares in the cells around it. Beside a wall or a surface cells are
 * filled in part, and so the density is lower there.
 *
 * @returns {bytes, volume [m^dim]}: cells count as far as they are filled, and as one where they are crowded
 */
export function densityOf({ positions, count, dim }, spacing) {
  const side = Math.ceil(1 / (CELL_SPACINGS * spacing)) + 2;
  const cells = new Float32Array(side ** dim);
  const corners = 2 ** dim;
  const places = new Int32Array(count * corners);
  const shares = new Float32Array(count * corners);
  const perCell = (1 / CELL_SPACINGS) ** dim;
  for (let i = 0; i < count; i += 1) {
    for (let corner = 0; corner < corners; corner += 1) {
      let [place, share] = [0, 1];
      for (let axis = 0; axis < dim; axis += 1) {
        const x = positions[i * dim + axis] / 65535 / (CELL_SPACINGS * spacing) + 0.5;
        const low = Math.floor(x);
        const up = (corner >> axis) & 1;
        place = place * side + low + up;
        share *= up === 1 ? x - low : 1 - x + low;
      }
      places[i * corners + corner] = place;
      shares[i * corners + corner] = share;
      cells[place] += share * perCell;
    }
  }
  const bytes = new Uint8Array(count);
  for (let i = 0; i < count; i += 1) {
    let density = 0;
    for (let k = i * corners; k < (i + 1) * corners; k += 1) density += shares[k] * cells[places[k]];
    bytes[i] = Math.min(255, (255 * density) / DENSEST);
  }
  const filled = cells.reduce((sum, density) => sum + Math.min(1, density), 0);
  return { bytes, volume: filled * (CELL_SPACINGS * spacing) ** dim };
}
