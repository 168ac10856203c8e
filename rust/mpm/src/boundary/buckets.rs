//! Where to look for rigid bodies: a grid of cells larger than those of the material.

use crate::grid::Layout;
use crate::linalg::Vector;

/// Side of a bucket [cells].
const BUCKET_CELLS: usize = 4;
/// How far around a rigid body it is looked for: more than a particle is moved in a substep, and than a node's spline reaches [cells].
pub const BUCKET_MARGIN_CELLS: f32 = 2.0;

/// The rigid bodies near to each part of the world.
#[derive(Debug, Clone)]
pub struct Buckets<const D: usize> {
    /// Along each axis.
    counts: [usize; D],
    per_metre: f32,
    /// Numbers of obstacles, ascending.
    near: Vec<Vec<u32>>,
    /// Those with bodies.
    used: Vec<usize>,
}

impl<const D: usize> Buckets<D> {
    pub fn new(layout: &Layout<D>) -> Self {
        let counts = layout.extents.map(|nodes| nodes.div_ceil(BUCKET_CELLS));
        Self {
            counts,
            per_metre: 1.0 / (BUCKET_CELLS as f32 * layout.dx()),
            near: vec![Vec::new(); counts.iter().product()],
            used: Vec::new(),
        }
    }

    fn place(&self, x: f32, axis: usize) -> usize {
        // Conversion saturates at zero.
        ((x * self.per_metre) as usize).min(self.counts[axis] - 1)
    }

    /// The rigid bodies that may be near to a point.
    #[inline(always)]
    pub fn at(&self, x: &Vector<D>) -> &[u32] {
        let flat = |flat: usize, axis: usize| flat * self.counts[axis] + self.place(x[axis], axis);
        &self.near[(0..D).fold(0, flat)]
    }

    pub fn clear(&mut self) {
        for place in self.used.drain(..) {
            self.near[place].clear();
        }
    }

    /// Adds a body to the buckets that a ball around its centre may touch.
    pub fn add(&mut self, body: u32, center: &Vector<D>, radius: f32) {
        let lo: [usize; D] = std::array::from_fn(|axis| self.place(center[axis] - radius, axis));
        let hi: [usize; D] = std::array::from_fn(|axis| self.place(center[axis] + radius, axis));
        let mut place = lo;
        loop {
            let flat = (0..D).fold(0, |flat, axis| flat * self.counts[axis] + place[axis]);
            if self.near[flat].is_empty() {
                self.used.push(flat);
            }
            self.near[flat].push(body);
            let Some(axis) = (0..D).rev().find(|&axis| place[axis] < hi[axis]) else {
                return;
            };
            place[axis] += 1;
            place[axis + 1..].copy_from_slice(&lo[axis + 1..]);
        }
    }
}
