//! The six (four) sides of the box, enforced where they are although that is between grid nodes.
//!
//! On the line of nodes that crosses a wall at x_w, the velocity of the material at the wall is
//! u = sum_i w_i(x_w) v_i over three nodes. An impulse lambda at that point changes node i by
//! w_i lambda / m_i, so u changes by K lambda with K = sum_i w_i^2 / m_i. Separating contact asks for
//! lambda >= 0 with u . n >= 0, friction for a tangential impulse of at most mu lambda. Uniform pressure
//! p pushes node i with exactly -p w_i(x_w) per area, so fluid at rest stays at rest: a wall on the
//! nearest node line would let it sink by up to half a cell.

use std::ops::Range;

use crate::contact::{Contact, ContactKind, remaining_slip};
use crate::error::MpmError;
use crate::grid::{Grid, Layout, PADDING};
use crate::math::Vector;
use crate::obstacle::{MaterialFriction, with_velocity};
use crate::stencil::{Stencil, spline};

/// Positions of the walls [m] and their surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Walls<const D: usize> {
    pub lower: Vector<D>,
    pub upper: Vector<D>,
    pub contact: Contact,
}

impl<const D: usize> Walls<D> {
    /// Refuses walls outside [0, 1] or closer to each other than four cells.
    pub fn check(&self, dx: f32) -> Result<(), MpmError> {
        for axis in 0..D {
            let (lower, upper) = (self.lower[axis], self.upper[axis]);
            if !(lower >= 0.0 && upper <= 1.0 && upper - lower >= 4.0 * dx) {
                return Err(MpmError::parameter(
                    format!("walls along axis {axis}"),
                    "in [0, 1] and at least four cells apart",
                    (lower, upper),
                ));
            }
        }
        if self
            .contact
            .friction
            .is_some_and(|mu| !(mu >= 0.0 && mu.is_finite()))
        {
            return Err(MpmError::parameter(
                "wall_friction",
                "finite and >= 0",
                self.contact.friction,
            ));
        }
        Ok(())
    }
}

/// Where the outermost node has a weight below this, material may rest on the wall without touching
/// that node, so contact then starts with the middle node.
const WEAK_OUTER_WEIGHT: f32 = 0.06;

/// One wall on the grid.
#[derive(Debug, Clone, Copy)]
struct Side {
    axis: usize,
    /// +1 at a lower wall, -1 at an upper one.
    inward: f32,
    /// Coordinate along the axis of the middle one of the three nodes.
    middle: usize,
    /// Weights of the outer, middle and inner node at the wall.
    weights: [f32; 3],
}

/// All walls of a scene, prepared for one grid.
#[derive(Debug, Clone)]
pub struct WallContact {
    contact: Contact,
    sides: Vec<Side>,
}

impl WallContact {
    pub fn new<const D: usize>(walls: &Walls<D>, layout: &Layout<D>) -> Self {
        let side = |axis: usize, position: f32, inward: f32| {
            let xi = f64::from(position) * layout.resolution as f64 + PADDING as f64;
            let base = (xi - 0.5).floor();
            let mut weights = spline((xi - base) as f32);
            if inward < 0.0 {
                weights.reverse();
            }
            Side {
                axis,
                inward,
                middle: base as usize + 1,
                weights,
            }
        };
        let sides = (0..D)
            .flat_map(|axis| {
                [
                    side(axis, walls.lower[axis], 1.0),
                    side(axis, walls.upper[axis], -1.0),
                ]
            })
            .collect();
        Self {
            contact: walls.contact,
            sides,
        }
    }

    /// Applies contact to the grid velocities.
    pub fn apply<const D: usize>(&self, grid: &mut Grid<D>, friction: &MaterialFriction) {
        for side in &self.sides {
            if side.axis == D - 1 {
                self.across_rows(grid, side, friction);
            } else {
                self.along_rows(grid, side, friction);
            }
        }
    }

    fn across_rows<const D: usize>(
        &self,
        grid: &mut Grid<D>,
        side: &Side,
        friction: &MaterialFriction,
    ) {
        for k in 0..grid.active.len() {
            let span = grid.active[k];
            if span.lo < side.middle && side.middle + 1 < span.hi {
                let middle = span.row * grid.layout.extent + side.middle;
                self.resolve(grid, side, middle..middle + 1, friction);
            }
        }
    }

    fn along_rows<const D: usize>(
        &self,
        grid: &mut Grid<D>,
        side: &Side,
        friction: &MaterialFriction,
    ) {
        let layout = grid.layout;
        let candidates = if side.axis == 0 {
            let row = |plane: usize| plane * layout.rows_per_plane();
            let first = grid.active.partition_point(|s| s.row < row(side.middle));
            first
                ..grid
                    .active
                    .partition_point(|s| s.row < row(side.middle + 1))
        } else {
            0..grid.active.len()
        };
        for k in candidates {
            let span = grid.active[k];
            if layout.row_coordinates(span.row)[side.axis] == side.middle {
                let start = span.row * layout.extent;
                self.resolve(grid, side, start + span.lo..start + span.hi, friction);
            }
        }
    }

    /// Contact on the node lines whose middle nodes are given.
    fn resolve<const D: usize>(
        &self,
        grid: &mut Grid<D>,
        side: &Side,
        middles: Range<usize>,
        friction: &MaterialFriction,
    ) {
        let stride = grid.layout.stride(side.axis);
        for middle in middles {
            let (low, high) = (middle - stride, middle + stride);
            let indices = if side.inward > 0.0 {
                [low, middle, high]
            } else {
                [high, middle, low]
            };
            let lanes = indices.map(|index| grid.nodes[index].to_array());
            let touches = if side.weights[0] < WEAK_OUTER_WEIGHT {
                lanes[1][3]
            } else {
                lanes[0][3]
            };
            if touches <= 0.0 {
                continue;
            }
            let mut mobility = [0.0; 3];
            let mut at_wall = Vector::<D>::zeros();
            for i in (0..3).filter(|&i| lanes[i][3] > 0.0) {
                mobility[i] = side.weights[i] / lanes[i][3];
                at_wall += Vector::from_fn(|axis, _| lanes[i][axis]) * side.weights[i];
            }
            let total: f32 = (0..3).map(|i| mobility[i] * side.weights[i]).sum();
            let mu = self
                .contact
                .friction
                .unwrap_or_else(|| friction.at(grid, middle, lanes[1][3]));
            let change = self.velocity_change(&at_wall, side, mu);
            if change == Vector::<D>::zeros() {
                continue;
            }
            for i in (0..3).filter(|&i| lanes[i][3] > 0.0) {
                let v = Vector::from_fn(|axis, _| lanes[i][axis]) + change * (mobility[i] / total);
                grid.nodes[indices[i]] = with_velocity(lanes[i], &v);
            }
        }
    }

    /// How the velocity at the wall has to change.
    #[inline]
    fn velocity_change<const D: usize>(
        &self,
        at_wall: &Vector<D>,
        side: &Side,
        mu: f32,
    ) -> Vector<D> {
        let approach = -at_wall[side.axis] * side.inward;
        match self.contact.kind {
            ContactKind::Sticky => -at_wall,
            ContactKind::Separating if approach <= 0.0 => Vector::zeros(),
            kind => {
                let mut slip = *at_wall;
                slip[side.axis] = 0.0;
                let lost = match kind {
                    ContactKind::Separating => 1.0 - remaining_slip(slip.norm(), mu * approach),
                    _ => 0.0,
                };
                let mut change = slip * -lost;
                change[side.axis] = approach * side.inward;
                change
            }
        }
    }
}

/// How full of material the grid can be near the walls, where part of each stencil lies outside.
#[derive(Debug, Clone)]
pub struct WallFill<const D: usize> {
    /// Per axis and node, the part of the node's spline between the walls, in [0, 1].
    nodes: [Vec<f32>; D],
    /// Positions whose stencil lies between the walls [m].
    inner: [(f32, f32); D],
}

impl<const D: usize> WallFill<D> {
    pub fn new(walls: &Walls<D>, layout: &Layout<D>) -> Self {
        let cells = |x: f32| f64::from(x) * layout.resolution as f64 + PADDING as f64;
        let reach = 3.0 * layout.dx();
        Self {
            nodes: std::array::from_fn(|axis| {
                let (lower, upper) = (cells(walls.lower[axis]), cells(walls.upper[axis]));
                (0..layout.extent)
                    .map(|i| (cumulative(upper - i as f64) - cumulative(lower - i as f64)) as f32)
                    .collect()
            }),
            inner: std::array::from_fn(|axis| {
                (walls.lower[axis] + reach, walls.upper[axis] - reach)
            }),
        }
    }

    /// Density at a particle over the density if everything between the walls were full; 1 inside.
    #[inline(always)]
    pub fn at(&self, x: &Vector<D>, stencil: &Stencil<D>) -> f32 {
        if (0..D).all(|axis| x[axis] > self.inner[axis].0 && x[axis] < self.inner[axis].1) {
            return 1.0;
        }
        (0..D)
            .map(|axis| -> f32 {
                let nodes = &self.nodes[axis][stencil.base[axis]..][..3];
                nodes
                    .iter()
                    .zip(stencil.weights[axis])
                    .map(|(fill, w)| fill * w)
                    .sum()
            })
            .product()
    }
}

/// Integral of the quadratic B-spline centred at zero from minus infinity to t.
fn cumulative(t: f64) -> f64 {
    match t {
        t if t < -1.5 => 0.0,
        t if t < -0.5 => (t + 1.5).powi(3) / 6.0,
        t if t < 0.5 => 0.5 + t * (0.75 - t * t / 3.0),
        t if t < 1.5 => 1.0 - (1.5 - t).powi(3) / 6.0,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stencil_at_a_wall_is_about_half_full_and_in_a_corner_a_quarter() {
        let contact = Contact {
            kind: ContactKind::Separating,
            friction: None,
        };
        let walls = Walls {
            lower: Vector::from_element(0.1),
            upper: Vector::from_element(0.9),
            contact,
        };
        let layout = Layout::<2>::new(64);
        let fill = WallFill::new(&walls, &layout);
        let at = |x: f32, y: f32| {
            let x = Vector::<2>::new(x, y);
            fill.at(&x, &Stencil::at(&layout.cells(&x)))
        };
        assert_eq!(at(0.5, 0.5), 1.0);
        // Not exactly: between nodes, the spline of splines is not symmetric.
        assert!((at(0.1, 0.5) - 0.5).abs() < 0.02 && (at(0.5, 0.9) - 0.5).abs() < 0.02);
        assert!((at(0.9, 0.1) - 0.25).abs() < 0.02);
        assert!((at(0.1 + 3.01 / 64.0, 0.5) - 1.0).abs() < 1e-6);
    }
}
