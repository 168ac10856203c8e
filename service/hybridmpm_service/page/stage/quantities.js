// Colours of particles by a quantity: one byte for each, on a scale with a unit.

import { FASTEST } from "./particles.js";

const DENSEST = 2; // density over that at rest that the byte 255 stands for
const CELL_SPACINGS = 2; // side of a cell in which particles are counted [spacings at rest]

/** By name: title, unit and what the upper end of the scale stands for. Without one, each material has its own look. */
export const QUANTITIES = {
  speed: { title: "Speed", unit: "m/s", most: FASTEST },
  density: { title: "Density", unit: "× rest", most: DENSEST },
  pressure: { title: "Pressure", unit: "kPa", most: null }, // up to the highest
};

/** A number that a scale may end with, at least `value`: 1, 2 or 5 times a power of ten. */
export function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(Math.max(value, 1e-6)));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= 0.9999 * value);
}

/**
 * Pressure at each particle, one byte each (255 = `most`), between the means of the cells around it.
 *
 * @param field {cell [m], points, pressure [Pa]} as the service answers it
 * @returns {bytes, most [kPa]}
 */
export function pressureOf({ positions, count, dim }, { cell, points, pressure }) {
  const side = Math.ceil(1 / cell) + 2;
  const index = (place) => place.reduce((sum, x) => sum * side + x, 0);
  const known = new Float32Array(side ** dim).fill(NaN);
  points.forEach((point, i) => {
    known[index(point.map((x) => Math.floor(x / cell)))] = pressure[i];
  });
  const most = roundUp(Math.max(100, ...pressure) / 1000);
  const bytes = new Uint8Array(count);
  const corners = 2 ** dim;
  const low = new Array(dim);
  const part = new Array(dim);
  for (let i = 0; i < count; i += 1) {
    for (let axis = 0; axis < dim; axis += 1) {
      const x = Math.max(0, positions[i * dim + axis] / 65535 / cell - 0.5);
      low[axis] = Math.floor(x);
      part[axis] = x - low[axis];
    }
    let [sum, total] = [0, 0];
    for (let corner = 0; corner < corners; corner += 1) {
      let [at, share] = [0, 1];
      for (let axis = 0; axis < dim; axis += 1) {
        const up = (corner >> axis) & 1;
        at = at * side + low[axis] + up;
        share *= up === 1 ? part[axis] : 1 - part[axis];
      }
      if (Number.isNaN(known[at])) continue;
      sum += share * known[at];
      total += share;
    }
    bytes[i] = total === 0 ? 0 : Math.min(255, Math.max(0, (255 * sum) / total / 1000 / most));
  }
  return { bytes, most };
}

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
