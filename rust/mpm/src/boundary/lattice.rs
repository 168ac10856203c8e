//! Distances from a surface, found once at the corners of a lattice.

use crate::linalg::Vector;
use threads::interrupted;

/// Corners for each cell of the grid of a scene along an axis.
const FINER: f32 = 2.0;
/// Distance from the surface within which it is looked for edges [cells].
const TESTED: f32 = 1.2;
/// Where distances between corners are interpolated they are wrong by at most this [cells].
const ALLOWED: f32 = 0.015;
/// Smallest cosine of the angle between an interpolated normal and the true one.
const ALIKE: f32 = 0.995;
/// Largest number of corners; the spacing grows with surfaces that would need more.
const MOST_CORNERS: f32 = 4.0e6;

/// Signed distances at the corners of cells.
pub struct Lattice<const D: usize> {
    lower: Vector<D>,
    spacing: f32,
    /// Number of corners along each axis.
    counts: [usize; D],
    /// Corner by corner, the last axis first.
    distances: Vec<f32>,
    /// Whether facets have to be asked in the cell above each corner.
    rough: Vec<bool>,
    /// Of the surface [m].
    bounds: [Vector<D>; 2],
}

impl<const D: usize> Lattice<D> {
    /// `exact` returns distance and normal of a point, given a bound on the distance; `bounds` are those of the surface and `dx` the
    /// cells of the scene [m]. Distances are found up to `bands` inside and outside [cells]; beyond, bounds on them do. Points
    /// outside of `between` do not matter. Incomplete where the work is `interrupted`.
    pub fn new(
        bounds: [Vector<D>; 2],
        between: Option<[Vector<D>; 2]>,
        dx: f32,
        bands: [f32; 2],
        exact: impl Fn(&Vector<D>, f32) -> (f32, Vector<D>),
    ) -> Self {
        let bands = bands.map(|cells| cells * dx);
        let spacing = dx / FINER;
        let around = |spacing: f32| {
            let margin = bands[1] + spacing;
            let (mut lower, mut upper) =
                (bounds[0].add_scalar(-margin), bounds[1].add_scalar(margin));
            if let Some([lowest, highest]) = between {
                lower = lower.sup(&lowest.add_scalar(-margin));
                upper = upper.inf(&highest.add_scalar(margin)).sup(&lower);
            }
            (lower, upper - lower)
        };
        let (_, extent) = around(spacing);
        let corners: f32 = extent.iter().map(|length| length / spacing + 2.0).product();
        let spacing = spacing * libm::powf((corners / MOST_CORNERS).max(1.0), 1.0 / D as f32);
        let (lower, extent) = around(spacing);
        let counts = std::array::from_fn(|axis| (extent[axis] / spacing) as usize + 2);
        let total = counts.iter().product();
        let mut lattice = Self {
            lower,
            spacing,
            counts,
            distances: Vec::with_capacity(total),
            rough: vec![false; total],
            bounds,
        };
        lattice.find_distances(bands, &exact);
        lattice.find_edges(dx, &exact);
        lattice
    }

    /// Walks along rows. A distance changes by at most a spacing from one corner to the next, so most need no search.
    fn find_distances(
        &mut self,
        bands: [f32; 2],
        exact: &impl Fn(&Vector<D>, f32) -> (f32, Vector<D>),
    ) {
        let row_length = self.counts[D - 1];
        for row in 0..self.rough.len() / row_length {
            if interrupted() {
                self.distances.resize(self.rough.len(), f32::INFINITY);
                return;
            }
            // The bound on the corner before, and the same on how much farther the surface may be.
            let (mut before, mut farthest) = (0.0_f32, f32::INFINITY);
            for column in 0..row_length {
                let nearer = before.abs() - self.spacing;
                let far = bands[usize::from(before > 0.0)];
                if nearer > far {
                    (before, farthest) = (nearer.copysign(before), f32::INFINITY);
                } else {
                    let corner = self.position(row * row_length + column);
                    before = exact(&corner, farthest).0;
                    farthest = before.abs() + self.spacing;
                }
                self.distances.push(before);
            }
        }
    }

    /// Marks the cells in which interpolated distances or normals are not true.
    fn find_edges(&mut self, dx: f32, exact: &impl Fn(&Vector<D>, f32) -> (f32, Vector<D>)) {
        let (near, middle) = (TESTED * dx, Vector::repeat(0.5));
        for corner in 0..self.rough.len() {
            let place = self.place(corner);
            let is_cell = (0..D).all(|axis| place[axis] + 1 < self.counts[axis]);
            if !is_cell || self.interpolated(corner, &middle).0.abs() > near {
                continue;
            }
            if interrupted() {
                return;
            }
            let bound = self.farthest(corner);
            // In 3D every other one of eight points.
            let parts = (0_usize..1 << D).filter(|part| D == 2 || part.count_ones() % 2 == 0);
            self.rough[corner] = parts.into_iter().any(|part| {
                let within =
                    Vector::from_fn(|axis, _| if part >> axis & 1 == 1 { 0.75 } else { 0.25 });
                let (distance, slope) = self.interpolated(corner, &within);
                let x = self.position(corner) + within * self.spacing;
                let (true_distance, normal) = exact(&x, bound);
                (distance - true_distance).abs() > ALLOWED * dx
                    || slope.dot(&normal) < ALIKE * slope.norm()
            });
        }
    }

    /// Whether a point may lie inside; false only where a corner nearby is farther from the surface than from the point.
    pub fn may_contain(&self, x: &Vector<D>) -> bool {
        let Some((corner, within)) = self.cell(x) else {
            return true;
        };
        if !self.rough[corner] {
            return self.height(corner, &within) < 0.0;
        }
        (0..1 << D).all(|part| {
            let (index, away) = self.corner_of(part, &within);
            self.distances[corner + index] < away.norm() * self.spacing
        })
    }

    /// Signed distance of a point and the normal; or, where facets have to be asked, a bound on the distance [m].
    pub fn distance(&self, x: &Vector<D>) -> Result<(f32, Vector<D>), f32> {
        let Some((corner, within)) = self.cell(x) else {
            let [lower, upper] = &self.bounds;
            let outside = x - Vector::from_fn(|axis, _| x[axis].clamp(lower[axis], upper[axis]));
            let distance = outside.norm();
            return if distance > 0.0 {
                Ok((distance, outside / distance))
            } else {
                Err(f32::INFINITY)
            };
        };
        if self.rough[corner] {
            return Err(self.farthest(corner));
        }
        let (distance, slope) = self.interpolated(corner, &within);
        let steepness = slope.norm();
        // Halfway between two surfaces the slope is lost.
        if steepness < 0.5 {
            return Err(f32::INFINITY);
        }
        Ok((distance, slope / steepness))
    }

    /// The corner below a point and the place in its cell, in [0, 1) along each axis; None beyond the lattice.
    fn cell(&self, x: &Vector<D>) -> Option<(usize, Vector<D>)> {
        let cells = (x - self.lower) / self.spacing;
        let last = |axis: usize| (self.counts[axis] - 1) as f32;
        let is_within = (0..D).all(|axis| cells[axis] >= 0.0 && cells[axis] < last(axis));
        is_within.then(|| {
            let corner = (0..D).fold(0, |corner, axis| {
                corner * self.counts[axis] + cells[axis] as usize
            });
            (corner, cells.map(|s| s - s.floor()))
        })
    }

    /// A corner of a cell from its lowest one: how much higher its index is, and how far a place in the cell lies from it.
    #[inline(always)]
    fn corner_of(&self, part: usize, within: &Vector<D>) -> (usize, Vector<D>) {
        let high = |axis: usize| part >> axis & 1;
        let index = (0..D).fold(0, |index, axis| index * self.counts[axis] + high(axis));
        (
            index,
            Vector::from_fn(|axis, _| within[axis] - high(axis) as f32),
        )
    }

    /// Bound on the distances in the cell above a corner that is near to the surface [m].
    fn farthest(&self, corner: usize) -> f32 {
        self.distances[corner].abs() + (D as f32).sqrt() * self.spacing
    }

    /// Distance at a place in the cell above a corner, as `interpolated`.
    #[inline(always)]
    fn height(&self, corner: usize, within: &Vector<D>) -> f32 {
        let mut values = [0.0; 8];
        for part in 0..1 << D {
            values[part] = self.distances[corner + self.corner_of(part, within).0];
        }
        // Halves the number of values axis by axis: the last bit of a part is the first axis.
        for axis in (0..D).rev() {
            for part in 0..1 << axis {
                let (low, high) = (values[part], values[part + (1 << axis)]);
                values[part] = low + (high - low) * within[axis];
            }
        }
        values[0]
    }

    /// Distance and its slope at a place in the cell above a corner, in [0, 1] along each axis.
    #[inline(always)]
    fn interpolated(&self, corner: usize, within: &Vector<D>) -> (f32, Vector<D>) {
        let (mut distance, mut slope) = (0.0, Vector::<D>::zeros());
        for part in 0..1 << D {
            let (index, away) = self.corner_of(part, within);
            let weights: [f32; D] = std::array::from_fn(|axis| 1.0 - away[axis].abs());
            let value = self.distances[corner + index];
            distance += value * weights.iter().product::<f32>();
            for axis in 0..D {
                let beside = (0..D).filter(|other| *other != axis);
                let share: f32 = beside.map(|other| weights[other]).product();
                slope[axis] += value * if part >> axis & 1 == 1 { share } else { -share };
            }
        }
        (distance, slope / self.spacing)
    }

    fn place(&self, mut corner: usize) -> [usize; D] {
        let mut place = [0; D];
        for axis in (0..D).rev() {
            place[axis] = corner % self.counts[axis];
            corner /= self.counts[axis];
        }
        place
    }

    fn position(&self, corner: usize) -> Vector<D> {
        let place = self.place(corner);
        Vector::from_fn(|axis, _| self.lower[axis] + place[axis] as f32 * self.spacing)
    }
}
