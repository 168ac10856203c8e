//! Allowed positions of particles, and their correction.

use super::contact::Walls;
use super::wall_fill::WallFill;
use crate::grid::{Layout, Stencils};
use crate::linalg::{Lanes, Vector};

/// `slow` over sqrt(g / L), L the largest extent of the room. Flows of all sizes, stiffnesses and resolutions expand at
/// rates that scale so.
const SLOW: f32 = 2.0;

/// Where particles may be.
#[derive(Debug, Clone)]
pub struct Bounds<const D: usize> {
    pub walls: Walls<D>,
    /// Fastest rate of expansion [1/s] of what gravity moves between them slowly; a few times faster after a blow.
    pub slow: f32,
    fill: WallFill<D>,
    /// Farther than this is an error.
    lowest: Vector<D>,
    highest: Vector<D>,
}

impl<const D: usize> Bounds<D> {
    pub fn new(walls: Walls<D>, gravity: &Vector<D>, layout: &Layout<D>) -> Self {
        let dx = layout.dx();
        let extent = (walls.upper - walls.lower).max();
        Self {
            walls,
            slow: SLOW * (gravity.norm() / extent).sqrt(),
            fill: WallFill::new(&walls, layout),
            lowest: walls.lower.add_scalar(-dx),
            highest: walls.upper.add_scalar(dx),
        }
    }

    /// Whether a particle may be at this position; false also for NaN.
    #[inline(always)]
    pub fn allows(&self, x: &Vector<D>) -> bool {
        (0..D).all(|axis| x[axis] >= self.lowest[axis] && x[axis] <= self.highest[axis])
    }

    /// The part of the stencil of each particle of a block that lies between the walls, about 1 far from them.
    #[inline(always)]
    pub fn room(&self, stencils: &Stencils<D>) -> Lanes {
        self.fill.at(stencils).0
    }

    /// Puts a particle back on the wall that it passed; false if it is too far past.
    ///
    /// The grid keeps material off the walls; this catches what rounding and single fast particles leave
    /// over.
    #[cold]
    pub fn put_back(&self, x: &mut Vector<D>, v: &mut Vector<D>) -> bool {
        if !self.allows(x) {
            return false;
        }
        self.clamp(x, v);
        true
    }

    /// Puts a particle back on the walls that it passed, and stops it there.
    pub fn clamp(&self, x: &mut Vector<D>, v: &mut Vector<D>) {
        for axis in 0..D {
            let inside = x[axis].clamp(self.walls.lower[axis], self.walls.upper[axis]);
            if inside < x[axis] {
                v[axis] = v[axis].min(0.0);
            } else if inside > x[axis] {
                v[axis] = v[axis].max(0.0);
            }
            x[axis] = inside;
        }
    }
}
