// Readings of probes, in double precision: the formulas are those of hybridmpm.probes.

const sum = (values) => values.reduce((total, value) => total + value, 0);
const product = (values) => values.reduce((total, value) => total * value, 1);
const between = (value, low, high) => Math.min(Math.max(value, low), high);

/**
 * Reads the probes of a scene. `about` is what the file says of the scene; `now` has functions that return the present
 * state: positions, velocities, masses, simulated, pressures, distances(points), forces, rigid.
 */
class Readings {
  #about;
  #dim;
  #now;
  #state = {}; // what has been read of the present state
  #rooms = new Map(); // free parts of boxes and weights, where no obstacle moves
  #means = new Map(); // of probes whose readings are means: [sums, frames]

  constructor(about, now) {
    [this.#about, this.#now, this.#dim] = [about, now, about.lower.length];
  }

  /** Forget the frames before. */
  begin() {
    this.#means.clear();
  }

  /** Take the forces of a frame into means. */
  note() {
    for (const probe of this.#about.probes) {
      if (probe.kind !== "force" && probe.kind !== "torque") continue;
      this.#state = {};
      const [sums, frames] = this.#means.get(probe) ?? [null, 0];
      const read = this[probe.kind](probe);
      this.#means.set(probe, [read.map((value, i) => value + (sums?.[i] ?? 0)), frames + 1]);
    }
  }

  /** Read all probes: a list of numbers for each. */
  read() {
    this.#state = {};
    const found = this.#about.probes.map((probe) => {
      const mean = this.#means.get(probe);
      return mean === undefined ? this[probe.kind.replace(" ", "_")](probe) : mean[0].map((value) => value / mean[1]);
    });
    this.#means.clear();
    return found;
  }

  density({ points, width, support, samples, least }) {
    const [x, mass] = [this.#get("positions"), this.#get("masses")];
    return points.map((point) => {
      let held = 0;
      this.#near(x, point, support * width, (k) => {
        held += mass[k] * this.#weight(x, k * this.#dim, point, width, support);
      });
      const room = this.#roomAround(point, width, support, samples);
      return room > least ? held / width ** this.#dim / room : NaN;
    });
  }

  patch_density(probe) {
    const [mass, room] = [this.#get("masses"), this.#room(probe)];
    let held = 0;
    this.#inBox(this.#get("positions"), this.#about.spacing, probe, (k, part) => (held += mass[k] * part));
    return [room > 0 ? held / room : NaN];
  }

  pressure({ points, spacing, reach, beside, layer, least, condition }) {
    const [x, pressures, dim] = [this.#get("simulated"), this.#get("pressures"), this.#dim];
    const { lower, upper } = this.#about;
    return points.map((point) => {
      const wall = Math.min(...point.map((value, i) => Math.min(value - lower[i], upper[i] - value)));
      const [distance] = this.#now.distances(point);
      const counts = this.#counting(point, distance, spacing, beside * spacing * Math.sqrt(dim));
      const far = beside + layer - Math.max(0, Math.min(wall, distance)) / spacing;
      const side = between(far, reach, beside) * spacing;
      const near = [];
      this.#near(x, point, side, (k) => near.push(k));
      const room = counts ? this.#now.distances(near.flatMap((k) => Array.from(x.subarray(dim * k, dim * (k + 1))))) : [];
      const normal = Array.from({ length: dim + 1 }, () => new Array(dim + 1).fill(0));
      const right = new Array(dim + 1).fill(0);
      const close = { count: 0, weight: 0, sum: 0 };
      near.forEach((k, n) => {
        const offset = point.map((value, axis) => x[k * dim + axis] - value);
        const weight = !counts ? 1 : counts(offset) ? between(least + room[n] / spacing, 0, 1) : 0;
        const term = [1, ...offset.map((value) => value / side)];
        for (let i = 0; i <= dim; i += 1) {
          right[i] += weight * term[i] * pressures[k];
          for (let j = 0; j <= dim; j += 1) normal[i][j] += weight * term[i] * term[j];
        }
        if (weight === 0 || offset.some((value) => Math.abs(value) >= reach * spacing)) return;
        close.count += 1;
        close.weight += weight;
        close.sum += weight * pressures[k];
      });
      if (close.count === 0) return 0;
      const mean = close.sum / close.weight;
      const scaled = normal.map((row) => row.map((value) => value / normal[0][0]));
      if (close.count > 2 * (dim + 1) && spread(scaled) < condition) {
        return Math.max(solved(scaled, right.map((value) => value / normal[0][0]))[0], Math.min(0, mean));
      }
      return mean;
    });
  }

  patch_pressure(probe) {
    const pressures = this.#get("pressures");
    let [total, pressed] = [0, 0];
    this.#inBox(this.#get("simulated"), this.#about.simulatedSpacing, probe, (k, part) => {
      total += part;
      pressed += part * pressures[k];
    });
    return [total > 0 ? pressed / total : 0];
  }

  height({ up, floorIsLow, lower, upper, steps }) {
    const [x, size, dim] = [this.#get("positions"), this.#about.spacing, this.#dim];
    const across = lower.map((_, axis) => axis).filter((axis) => axis !== up);
    const area = product(across.map((axis) => upper[axis] - lower[axis]));
    const depth = upper[up] - lower[up];
    const held = []; // [height, volume] of particles in the column
    for (let k = 0; k < x.length; k += dim) {
      const middle = lower.map((_, axis) => this.#clipped(x[k + axis], axis, size));
      const part = product(across.map((axis) => overlap(middle[axis], size, lower[axis], upper[axis])));
      if (part > 0) held.push([floorIsLow ? middle[up] - lower[up] : upper[up] - middle[up], part * size ** dim]);
    }
    const step = size / steps;
    const filling = Array.from({ length: Math.ceil((depth + size) / step) }, (_, row) => {
      const level = row * step;
      const window = held.map(([height, volume]) => {
        const within = Math.min(height + size / 2, level + size) - Math.max(height - size / 2, level - size);
        return volume * between(within / size, 0, 1);
      });
      return sum(window) / (area * Math.min(level + size, 2 * size));
    });
    const last = filling.map((value) => value >= 0.5).lastIndexOf(true);
    if (last < 0) return [0];
    if (last + 1 === filling.length) return [depth];
    return [last * step + ((filling[last] - 0.5) / (filling[last] - filling[last + 1])) * step];
  }

  fill_level(probe) {
    const room = this.#room(probe);
    let filled = 0;
    this.#inBox(this.#get("positions"), this.#about.spacing, probe, (_, part) => (filled += part));
    return [room > 0 ? (filled * this.#about.spacing ** this.#dim) / room : NaN];
  }

  submerged({ body, corners, facets, up, floorIsLow, beside, width, steps }) {
    const dim = this.#dim;
    const { lower, upper } = this.#about;
    const placed = placedPoints(this.#get("rigid"), body, corners, dim);
    const x = Array.from({ length: placed.length / dim }, (_, i) => Array.from(placed.subarray(dim * i, dim * (i + 1))));
    const ends = [Math.min, Math.max].map((end) => lower.map((_, axis) => end(...x.map((point) => point[axis]))));
    const middle = placedPoints(this.#get("rigid"), body, new Array(dim).fill(0), dim);
    const levels = [];
    for (let axis = 0; axis < dim; axis += 1) {
      for (const side of [-1, 1]) {
        const place = Array.from(middle);
        place[axis] = ends[(side + 1) / 2][axis] + side * beside;
        const room = side * ([lower, upper][(side + 1) / 2][axis] - place[axis]);
        if (axis === up || room < width / 2) continue;
        const low = lower.map((wall, i) => (i === up ? wall : Math.max(wall, place[i] - width / 2)));
        const high = upper.map((wall, i) => (i === up ? wall : Math.min(wall, place[i] + width / 2)));
        levels.push(this.height({ up, floorIsLow, lower: low, upper: high, steps })[0]);
      }
    }
    const height = x.map((point) => (floorIsLow ? point[up] - lower[up] : upper[up] - point[up]));
    const below = (level) => {
      let volume = 0;
      for (let first = 0; first < facets.length; first += dim) {
        const facet = facets.slice(first, first + dim);
        volume += across(facet.map((corner) => x[corner]), up) * depthOn(facet.map((corner) => level - height[corner]));
      }
      return volume;
    };
    return [below(sum(levels) / levels.length) / below(Math.max(...height))];
  }

  flow({ middle, axes, lower, upper }) {
    const [x, v, mass] = [this.#get("positions"), this.#get("velocities"), this.#get("masses")];
    const [size, dim] = [this.#about.spacing, this.#dim];
    const along = (vector, axis) => sum(axes[axis].map((part, i) => part * vector[i]));
    let moved = 0;
    for (let k = 0; k < mass.length; k += 1) {
      const local = middle.map((value, axis) => x[k * dim + axis] - value);
      const part = product(lower.map((low, axis) => overlap(along(local, axis), size, low, upper[axis])));
      if (part > 0) moved += mass[k] * part * along(v.subarray(k * dim, (k + 1) * dim), 0);
    }
    return [moved / (upper[0] - lower[0])];
  }

  force({ row }) {
    const [forces, width] = [this.#get("forces"), 3 * (this.#dim - 1)];
    if (forces === null) return new Array(this.#dim).fill(NaN);
    return Array.from(forces.subarray(row * width, row * width + this.#dim));
  }

  torque({ row, about }) {
    const [forces, width, dim] = [this.#get("forces"), 3 * (this.#dim - 1), this.#dim];
    if (forces === null) return new Array(dim === 2 ? 1 : 3).fill(NaN);
    const force = forces.subarray(row * width, row * width + dim);
    const torque = forces.subarray(row * width + dim, (row + 1) * width);
    const [[ax, ay, az], [x, y, z]] = [about, force];
    if (dim === 2) return [torque[0] - (ax * y - ay * x)];
    const moment = [ay * z - az * y, az * x - ax * z, ax * y - ay * x];
    return moment.map((value, i) => torque[i] - value);
  }

  #get(what) {
    this.#state[what] ??= this.#now[what]();
    return this.#state[what];
  }

  /** Call `take` with the number of each point nearer than `reach` along all axes. */
  #near(x, point, reach, take) {
    const dim = this.#dim;
    for (let k = 0; k < x.length / dim; k += 1) {
      if (point.every((value, axis) => Math.abs(x[k * dim + axis] - value) < reach)) take(k);
    }
  }

  /** A coordinate of a cube's middle, moved so far that the cube lies behind no wall. */
  #clipped(value, axis, size) {
    return between(value, this.#about.lower[axis] + size / 2, this.#about.upper[axis] - size / 2);
  }

  /** Call `take` with the number of each particle in a box, and the part of it that lies there. */
  #inBox(x, size, { lower, upper }, take) {
    const dim = this.#dim;
    for (let k = 0; k < x.length / dim; k += 1) {
      let part = 1;
      for (let axis = 0; axis < dim && part > 0; axis += 1) {
        part *= overlap(this.#clipped(x[k * dim + axis], axis, size), size, lower[axis], upper[axis]);
      }
      if (part > 0) take(k, part);
    }
  }

  /** Quadratic B-spline around a point, of the particle whose first coordinate is x[at]. */
  #weight(x, at, point, width, support) {
    return product(
      point.map((value, axis) => {
        const u = Math.abs(x[at + axis] - value) / width;
        return u < 0.5 ? 0.75 - u ** 2 : 0.5 * Math.max(support - u, 0) ** 2;
      }),
    );
  }

  /** Whether what lies at an offset from a point counts, for obstacles that are crossed; null where none is near. */
  #counting(point, distance, spacing, widest) {
    if (distance >= widest) return null;
    const step = spacing / 2;
    const moved = (by) => point.map((value, i) => value + by[i]);
    const sides = point.flatMap((_, axis) => [1, -1].map((sign) => moved(point.map((_, i) => (i === axis ? sign * step : 0)))));
    const ends = this.#now.distances(sides.flat());
    const slope = point.map((_, axis) => ends[2 * axis] - ends[2 * axis + 1]);
    const length = Math.max(Math.hypot(...slope), 1e-3 * spacing);
    const normal = slope.map((value) => value / length);
    const along = Array.from({ length: Math.trunc(widest / step) - 1 }, (_, i) => (i + 1) * step);
    const [back, front] = [-1, 1].map((sign) => {
      const places = along.flatMap((way) => moved(normal.map((value) => sign * way * value)));
      const taken = Array.from(this.#now.distances(places), (value) => value <= 0);
      const entered = taken.indexOf(true);
      const left = entered < 0 ? -1 : taken.indexOf(false, entered);
      return left < 0 ? Infinity : (along[entered] + along[left - 1]) / 2;
    });
    return (offset) => {
      const way = sum(offset.map((value, i) => value * normal[i]));
      return way >= -back && way <= front;
    };
  }

  #cached(key, compute) {
    if (this.#about.moves) return compute();
    if (!this.#rooms.has(key)) this.#rooms.set(key, compute());
    return this.#rooms.get(key);
  }

  /** Volume of a box outside of obstacles. */
  #room(probe) {
    const { lower, upper, samples } = probe;
    return this.#cached(probe, () => {
      const free = this.#now.distances(lattice(lower, upper, samples)).map((value) => (value > 0 ? 1 : 0));
      return (product(lower.map((low, axis) => upper[axis] - low)) * sum(free)) / free.length;
    });
  }

  /** Part of the weights around a point that lies between the walls and outside of obstacles. */
  #roomAround(point, width, support, samples) {
    const { lower, upper, solids } = this.#about;
    return this.#cached(point, () => {
      const room = product(
        point.map((value, i) => cumulative((upper[i] - value) / width) - cumulative((lower[i] - value) / width)),
      );
      if (solids.length === 0) return room;
      const reach = support * width;
      const corners = [
        point.map((value, i) => Math.max(value - reach, lower[i])),
        point.map((value, i) => Math.min(value + reach, upper[i])),
      ];
      const cells = lattice(...corners, samples);
      const free = this.#now.distances(cells);
      const weights = Array.from(free, (_, k) => this.#weight(cells, k * this.#dim, point, width, support));
      return (room * sum(weights.map((value, k) => (free[k] > 0 ? value : 0)))) / sum(weights);
    });
  }
}

/** Where points of a rigid body's own frame are, as flat coordinates, by the numbers of all bodies. */
function placedPoints(numbers, body, points, dim) {
  const [cx, cy, cz, w, x, y, z] = numbers.subarray(13 * body);
  const placed = new Float64Array(points.length);
  for (let i = 0; i < points.length; i += dim) {
    const [a, b, c] = [points[i], points[i + 1], dim === 2 ? 0 : points[i + 2]];
    placed[i] = cx + (1 - 2 * (y * y + z * z)) * a + 2 * (x * y - w * z) * b + 2 * (x * z + w * y) * c;
    placed[i + 1] = cy + 2 * (x * y + w * z) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z - w * x) * c;
    if (dim === 3) placed[i + 2] = cz + 2 * (x * z - w * y) * a + 2 * (y * z + w * x) * b + (1 - 2 * (x * x + y * y)) * c;
  }
  return placed;
}

/** Extent of a facet as seen along an axis, with a sign and up to a factor. */
function across(corners, axis) {
  const [first, ...others] = corners.map((corner) => corner.filter((_, i) => i !== axis));
  const [a, b] = others.map((corner) => corner.map((value, i) => value - first[i]));
  return b === undefined ? a[0] : a[0] * b[1] - a[1] * b[0];
}

/** Mean depth on a facet, 0 above the level, by the depths of its corners. */
function depthOn(depths) {
  const dim = depths.length;
  const above = depths.filter((depth) => depth <= 0);
  const under = depths.filter((depth) => depth > 0);
  const cutOff = (single, others) => Math.abs(single) ** dim / (dim * product(others.map((other) => Math.abs(other - single))));
  if (under.length === 0) return 0;
  if (under.length === 1) return cutOff(under[0], above);
  return sum(depths) / dim + (above.length === 0 ? 0 : cutOff(above[0], under));
}

/** Part of a cube's side around x that lies between two places. */
function overlap(x, size, lower, upper) {
  return between((Math.min(x + size / 2, upper) - Math.max(x - size / 2, lower)) / size, 0, 1);
}

/** Middles of count^D equal cells of a box. */
function lattice(lower, upper, count) {
  const dim = lower.length;
  const points = new Float64Array(count ** dim * dim);
  for (let k = 0; k < count ** dim; k += 1) {
    for (let axis = 0; axis < dim; axis += 1) {
      const index = Math.floor(k / count ** (dim - 1 - axis)) % count;
      points[k * dim + axis] = lower[axis] + ((index + 0.5) / count) * (upper[axis] - lower[axis]);
    }
  }
  return points;
}

/** Integral of the quadratic B-spline from minus infinity to t. */
function cumulative(t) {
  if (Math.abs(t) < 0.5) return 0.5 + t * (0.75 - t ** 2 / 3);
  return t < 0 ? Math.max(t + 1.5, 0) ** 3 / 6 : 1 - Math.max(1.5 - t, 0) ** 3 / 6;
}

/** Largest over smallest eigenvalue of a symmetric matrix, by Jacobi's rotations. */
function spread(matrix) {
  const a = matrix.map((row) => row.slice());
  const size = a.length;
  for (let sweep = 0; sweep < 20; sweep += 1) {
    for (let p = 0; p < size; p += 1) {
      for (let q = p + 1; q < size; q += 1) {
        const angle = 0.5 * Math.atan2(2 * a[p][q], a[q][q] - a[p][p]);
        const [c, s] = [Math.cos(angle), Math.sin(angle)];
        for (let k = 0; k < size; k += 1) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
        for (let k = 0; k < size; k += 1) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
      }
    }
  }
  const values = a.map((row, i) => Math.abs(row[i]));
  return Math.max(...values) / Math.min(...values);
}

/** Solution of a system of linear equations, by elimination. */
function solved(matrix, right) {
  const rows = matrix.map((row, i) => [...row, right[i]]);
  const size = rows.length;
  for (let i = 0; i < size; i += 1) {
    const best = rows.slice(i).reduce((found, row, k) => (Math.abs(row[i]) > Math.abs(rows[found][i]) ? k + i : found), i);
    [rows[i], rows[best]] = [rows[best], rows[i]];
    for (let k = 0; k < size; k += 1) {
      if (k === i) continue;
      const factor = rows[k][i] / rows[i][i];
      for (let j = i; j <= size; j += 1) rows[k][j] -= factor * rows[i][j];
    }
  }
  return rows.map((row, i) => row[size] / row[i]);
}
