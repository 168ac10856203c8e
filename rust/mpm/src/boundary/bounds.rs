//! Where particles may be, and what happens to those beyond.

use super::wall_fill::WallFill;
use super::walls::Walls;
use crate::grid::{Layout, Stencils};
use crate::linalg::{LANES, Lanes, Vector};

/// Where particles may be.
#[derive(Debug, Clone)]
pub struct Bounds<const D: usize> {
    pub walls: Walls<D>,
    fill: WallFill<D>,
    /// Farther than this is an error.
    lowest: Vector<D>,
    highest: Vector<D>,
    /// Between these, no wall is near.
    inner_lowest: Vector<D>,
    inner_highest: Vector<D>,
}

impl<const D: usize> Bounds<D> {
    pub fn new(walls: Walls<D>, layout: &Layout<D>) -> Self {
        let dx = layout.dx();
        // A stencil and the splines of its nodes reach 3 cells; what a substep adds hardly weighs.
        let far = 3.0 * dx;
        Self {
            walls,
            fill: WallFill::new(&walls, layout),
            lowest: walls.lower.add_scalar(-dx),
            highest: walls.upper.add_scalar(dx),
            inner_lowest: walls.lower.add_scalar(far),
            inner_highest: walls.upper.add_scalar(-far),
        }
    }

    /// Whether a particle may be at this position; false also for NaN.
    #[inline(always)]
    pub fn allows(&self, x: &Vector<D>) -> bool {
        (0..D).all(|axis| x[axis] >= self.lowest[axis] && x[axis] <= self.highest[axis])
    }

    /// Divides by the part of each particle's stencil that lies between the walls.
    #[inline(always)]
    pub fn correct_near_walls(&self, crowding: &mut Lanes, x: &[Lanes; D], stencils: &Stencils<D>) {
        let mut near = [0u32; LANES];
        for axis in 0..D {
            let (lowest, highest) = (self.inner_lowest[axis], self.inner_highest[axis]);
            for i in 0..LANES {
                near[i] |= u32::from((x[axis][i] < lowest) | (x[axis][i] > highest));
            }
        }
        if near.iter().all(|&near| near == 0) {
            return;
        }
        let fill = self.fill.at(stencils);
        for i in 0..LANES {
            // A particle far from walls must not notice that another of its block is near one.
            crowding[i] /= if near[i] == 0 { 1.0 } else { fill[i] };
        }
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
