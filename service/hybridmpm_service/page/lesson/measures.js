// What lessons measure: readings of the particles that are shown, beside what the closed form says. Pure functions.

const G = 9.81; // [m/s^2]
const START_SECONDS = [0.3, 0.8]; // in which the rate of an outflow is taken that the rest is compared with
const DEEP_SPACINGS = 2; // width of the columns in which a front is looked for

const inside = (value, [low, high]) => value > low && value < high;

/** Height of the water over a floor [m]: the volume in a column over its width. */
function level({ positions, count, dim }, spacing, across, floor) {
  let found = 0;
  for (let i = 0; i < count; i += 1) {
    if (inside(positions[dim * i] / 65535, across) && positions[dim * i + 1] / 65535 > floor) found += 1;
  }
  return (found * spacing ** 2) / (across[1] - across[0]);
}

/** Times at which a series passes 0, by a line between its points. */
function crossings(series) {
  const found = [];
  for (let i = 1; i < series.length; i += 1) {
    const [[a, [x]], [b, [y]]] = [series[i - 1], series[i]].map(({ time, values }) => [time, values]);
    if (x * y < 0 || (y === 0 && x !== 0)) found.push(a + ((b - a) * x) / (x - y));
  }
  return found;
}

/**
 * By the name in an entry: `read(given, now, series)` returns {values, exact} of a frame, null where there is nothing to read; now is
 * {frame, before: the frame before, spacing}. `figures(given, series)` returns {measured: numbers, exact} to compare.
 */
export const MEASURES = {
  /** Levels in columns beside each other. */
  levels: {
    read: ({ columns, floor, exact }, { frame, spacing }) => ({ values: columns.map((across) => level(frame, spacing, across, floor)), exact }),
  },
  /** Part of the height of a rigid body that is below the water beside it, and its mean over the latest while. */
  submerged: {
    read({ body, side, columns, exact }, { frame, spacing }) {
      if (frame.poses === null) return null;
      const bottom = frame.poses[3 * body + 1] - side / 2;
      const depths = columns.map((across) => level(frame, spacing, across, bottom));
      return { values: [depths.reduce((sum, depth) => sum + depth, 0) / depths.length / side], exact };
    },
    figures({ exact, seconds }, series) {
      const late = series.filter(({ time }) => time >= series.at(-1).time - seconds);
      const mean = late.reduce((sum, { values: [value] }) => sum + value, 0) / late.length;
      return { measured: late.length === 0 ? [] : [mean], exact };
    },
  },
  /** Speed of a jet, beside sqrt(2 g h) of the level over the hole. */
  jet: {
    read({ outside, from, to, tank, floor, hole }, { frame, before, spacing }) {
      const elapsed = before === null ? 0 : frame.time - before.time;
      if (elapsed <= 0) return null;
      let [sum, found, last] = [0, 0, 0];
      for (let i = 0; i < frame.count; i += 1) {
        const [x, y] = [frame.positions[2 * i], frame.positions[2 * i + 1]];
        if (![x, y].every((value, axis) => inside(value / 65535, [from[axis], to[axis]]))) continue;
        // Particles that left the scene meanwhile are of the frame before alone; ids are ascending.
        if (frame.ids === null) last = i;
        else while (before.ids[last] < frame.ids[i]) last += 1;
        // What was still in the hole then was slower for a part of the time.
        if (before.positions[2 * last] / 65535 < outside) continue;
        sum += Math.hypot(x - before.positions[2 * last], y - before.positions[2 * last + 1]) / 65535 / elapsed;
        found += 1;
      }
      const height = level(frame, spacing, tank, floor) + floor - hole;
      return found === 0 || height <= 0 ? null : { values: [sum / found], exact: Math.sqrt(2 * G * height) };
    },
  },
  /** Place of a front of some depth that moves to the right, beside a table of an experiment. */
  front: {
    read({ wall, depth, table }, { frame, spacing }) {
      const counts = new Map();
      for (let i = 0; i < frame.count; i += 1) {
        const column = Math.floor(frame.positions[2 * i] / 65535 / (DEEP_SPACINGS * spacing));
        counts.set(column, (counts.get(column) ?? 0) + 1);
      }
      const least = (DEEP_SPACINGS * depth) / spacing;
      const last = Math.max(...[...counts].filter(([, held]) => held >= least).map(([column]) => column));
      const next = table.findIndex(([time]) => time >= frame.time);
      let exact = null;
      if (next > 0) {
        const [[a, x], [b, y]] = [table[next - 1], table[next]];
        exact = x + ((y - x) * (frame.time - a)) / (b - a);
      }
      return { values: [(last + 1) * DEEP_SPACINGS * spacing - wall], exact };
    },
  },
  /** Part of the matter above a height, beside what is left at the rate of the beginning. */
  outflow: {
    read({ height }, { frame }, series) {
      let above = 0;
      for (let i = 0; i < frame.count; i += 1) above += frame.positions[2 * i + 1] / 65535 > height ? 1 : 0;
      const [first, last] = START_SECONDS.map((time) => series.find((one) => one.time >= time));
      const rate = last === undefined ? null : (last.values[0] - first.values[0]) / (last.time - first.time);
      const left = rate === null ? null : first.values[0] + rate * (frame.time - first.time);
      return { values: [above / frame.count], exact: left !== null && left >= 0 ? left : null };
    },
  },
  /** Slope of the wedge with the area and the height of the middle of a heap [degrees]. */
  slope: {
    read({ floor, exact }, { frame, spacing }) {
      if (frame.count === 0) return null;
      let sum = 0;
      for (let i = 0; i < frame.count; i += 1) sum += frame.positions[2 * i + 1] / 65535;
      const tall = sum / frame.count - floor;
      return { values: [(Math.atan((9 * tall ** 2) / (frame.count * spacing ** 2)) * 180) / Math.PI], exact };
    },
  },
  /** Swing of the difference of two levels, or of the middle of the water about a place, and its period. */
  swing: {
    read({ columns, floor, about, start, exact }, { frame, spacing }) {
      let value = 0;
      if (columns !== undefined) value = level(frame, spacing, columns[0], floor) - level(frame, spacing, columns[1], floor);
      else {
        for (let i = 0; i < frame.count; i += 1) value += frame.positions[2 * i] / 65535 / frame.count;
        value -= about;
      }
      return { values: [value], exact: start * Math.cos((2 * Math.PI * frame.time) / exact) };
    },
    figures({ exact }, series) {
      const times = crossings(series);
      return { measured: times.length < 2 ? [] : [(2 * (times.at(-1) - times[0])) / (times.length - 1)], exact };
    },
  },
};

/** What to compare, {measured: numbers, exact}: the newest readings with something beside them, unless the measure says otherwise. */
export function figuresOf(given, series) {
  const own = MEASURES[given.kind].figures;
  if (own !== undefined) return own(given, series);
  const last = series.findLast(({ exact }) => exact !== null) ?? series.at(-1);
  return last === undefined ? { measured: [], exact: null } : { measured: last.values, exact: last.exact };
}
