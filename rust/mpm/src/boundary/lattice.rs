//! Distances from a surface, found once at the corners of a lattice.

use crate::linalg::Vector;
use threads::interrupted;

/// Distances up to this far are found exactly [spacings]; beyond, bounds on them do.
const BAND: f32 = 7.0;
/// Cells whose middle is up to this far from the surface are tested for edges [spacings].
const TESTED: f32 = 2.5;
/// Where distances between corners are interpolated they are wrong by at most this [spacings].
const ALLOWED: f32 = 0.01;
/// Smallest cosine of the angle between an interpolated normal and the true one.
const ALIKE: f32 = 0.998;
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
    /// `exact` returns distance and normal of a point, given a bound on the distance; `bounds` are those of the surface [m], and no
    /// point outside of `between` matters. Incomplete where the work is `interrupted`.
    pub fn new(
        bounds: [Vector<D>; 2],
        between: Option<[Vector<D>; 2]>,
        spacing: f32,
        exact: impl Fn(&Vector<D>, f32) -> (f32, Vector<D>),
    ) -> Self {
        let around = |spacing: f32| {
            let margin = (BAND + 1.0) * spacing;
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
        lattice.find_distances(&exact);
        lattice.find_edges(&exact);
        lattice
    }

    /// Walks along rows. A distance changes by at most a spacing from one corner to the next, so most need no search.
    fn find_distances(&mut self, exact: &impl Fn(&Vector<D>, f32) -> (f32, Vector<D>)) {
        let row_length = self.counts[D - 1];
        let far = BAND * self.spacing;
        for row in 0..self.rough.len() / row_length {
            if interrupted() {
                self.distances.resize(self.rough.len(), f32::INFINITY);
                return;
            }
            // The bound on the corner before, and the same on how much farther the surface may be.
            let (mut before, mut farthest) = (0.0_f32, f32::INFINITY);
            for column in 0..row_length {
                let nearer = before.abs() - self.spacing;
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
    fn find_edges(&mut self, exact: &impl Fn(&Vector<D>, f32) -> (f32, Vector<D>)) {
        let (near, middle) = (TESTED * self.spacing, Vector::repeat(0.5));
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
            self.rough[corner] = (0..1 << D).any(|part| {
                let within =
                    Vector::from_fn(|axis, _| if part >> axis & 1 == 1 { 0.75 } else { 0.25 });
                let (distance, slope) = self.interpolated(corner, &within);
                let x = self.position(corner) + within * self.spacing;
                let (true_distance, normal) = exact(&x, bound);
                (distance - true_distance).abs() > ALLOWED * self.spacing
                    || slope.dot(&normal) < ALIKE * slope.norm()
            });
        }
    }

    /// Signed distance of a point and the normal; or, where facets have to be asked, a bound on the distance [m].
    pub fn distance(&self, x: &Vector<D>) -> Result<(f32, Vector<D>), f32> {
        let [lower, upper] = &self.bounds;
        let cells = (x - self.lower) / self.spacing;
        let last = |axis: usize| (self.counts[axis] - 1) as f32;
        if !(0..D).all(|axis| cells[axis] >= 0.0 && cells[axis] < last(axis)) {
            let outside = x - Vector::from_fn(|axis, _| x[axis].clamp(lower[axis], upper[axis]));
            let distance = outside.norm();
            return if distance > 0.0 {
                Ok((distance, outside / distance))
            } else {
                Err(f32::INFINITY)
            };
        }
        let corner = (0..D).fold(0, |corner, axis| {
            corner * self.counts[axis] + cells[axis] as usize
        });
        if self.rough[corner] {
            return Err(self.farthest(corner));
        }
        let (distance, slope) = self.interpolated(corner, &cells.map(|s| s - s.floor()));
        let steepness = slope.norm();
        // Halfway between two surfaces the slope is lost.
        if steepness < 0.5 {
            return Err(f32::INFINITY);
        }
        Ok((distance, slope / steepness))
    }

    /// Bound on the distances in the cell above a corner that is near to the surface [m].
    fn farthest(&self, corner: usize) -> f32 {
        self.distances[corner].abs() + (D as f32).sqrt() * self.spacing
    }

    /// Distance and its slope at a place in the cell above a corner, in [0, 1] along each axis.
    #[inline(always)]
    fn interpolated(&self, corner: usize, within: &Vector<D>) -> (f32, Vector<D>) {
        let (mut distance, mut slope) = (0.0, Vector::<D>::zeros());
        for part in 0..1 << D {
            let mut index = 0;
            let mut weights = [0.0; D];
            for axis in 0..D {
                let step = part >> axis & 1;
                index = index * self.counts[axis] + step;
                weights[axis] = if step == 1 {
                    within[axis]
                } else {
                    1.0 - within[axis]
                };
            }
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
