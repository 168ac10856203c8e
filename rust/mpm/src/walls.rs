//! The six (four) sides of the box, enforced where they are although that is between grid nodes.
//!
//! On the line of nodes that crosses a wall at x_w, the velocity of the material at the wall is
//! u = sum_i w_i(x_w) v_i over three nodes. An impulse lambda at that point changes node i by
//! w_i lambda / m_i, so u changes by K lambda with K = sum_i w_i^2 / m_i. Separating contact asks for
//! lambda >= 0 with u . n >= 0, friction for a tangential impulse of at most mu lambda. Uniform pressure
//! p pushes node i with exactly -p w_i(x_w) per area, so fluid at rest stays at rest: a wall on the
//! nearest node line would let it sink by up to half a cell.

use std::ops::Range;

use wide::f32x4;

use crate::contact::{Contact, ContactKind, remaining_slip};
use crate::error::MpmError;
use crate::grid::{Grid, Layout, PADDING};
use crate::grid_update::SMALLEST_MASS;
use crate::math::Vector;
use crate::obstacle::MaterialFriction;
use crate::stencil::{Stencils, spline};

/// Positions of the walls [m] and their surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Walls<const D: usize> {
    pub lower: Vector<D>,
    pub upper: Vector<D>,
    pub contact: Contact,
}

impl<const D: usize> Walls<D> {
    /// Whether a point lies between the walls; false also for NaN.
    #[inline(always)]
    pub fn contain(&self, x: &Vector<D>) -> bool {
        (0..D).all(|axis| x[axis] >= self.lower[axis] && x[axis] <= self.upper[axis])
    }

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
    /// One in the lane of the axis, zero in the others.
    normal: f32x4,
    /// One in the lanes of the other axes, zero elsewhere.
    tangential: f32x4,
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
            let lanes = |one: &dyn Fn(usize) -> bool| {
                f32x4::from(std::array::from_fn(|lane| f32::from(u8::from(one(lane)))))
            };
            Side {
                axis,
                inward,
                middle: base as usize + 1,
                weights,
                normal: lanes(&|lane| lane == axis),
                tangential: lanes(&|lane| lane != axis && lane < D),
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
            // The node that shows whether material touches the wall, looked at before the others.
            let first = indices[usize::from(side.weights[0] < WEAK_OUTER_WEIGHT)];
            if grid.nodes[first].to_array()[3] <= SMALLEST_MASS {
                continue;
            }
            let nodes = indices.map(|index| grid.nodes[index]);
            let masses = nodes.map(|node| node.to_array()[3]);
            // Empty nodes have no velocity to speak of and take no impulse.
            let weights: [f32; 3] = std::array::from_fn(|i| {
                if masses[i] > SMALLEST_MASS {
                    side.weights[i]
                } else {
                    0.0
                }
            });
            let at_wall = nodes[0] * f32x4::splat(weights[0])
                + nodes[1] * f32x4::splat(weights[1])
                + nodes[2] * f32x4::splat(weights[2]);
            let approach = -at_wall.to_array()[side.axis] * side.inward;
            if self.contact.kind == ContactKind::Separating && approach <= 0.0 {
                continue;
            }
            let mu = self
                .contact
                .friction
                .unwrap_or_else(|| friction.at(grid, middle, masses[1]));
            let slip = at_wall * side.tangential;
            let lost = match self.contact.kind {
                ContactKind::Sticky => 1.0,
                ContactKind::Separating if mu > 0.0 => {
                    1.0 - remaining_slip((slip * slip).reduce_add().sqrt(), mu * approach)
                }
                ContactKind::Slip | ContactKind::Separating => 0.0,
            };
            // How the velocity at the wall has to change, and what share of it each node takes.
            let change =
                side.normal * f32x4::splat(approach * side.inward) - slip * f32x4::splat(lost);
            let mobility: [f32; 3] =
                std::array::from_fn(|i| weights[i] / masses[i].max(SMALLEST_MASS));
            let total: f32 = (0..3).map(|i| mobility[i] * weights[i]).sum();
            for i in 0..3 {
                grid.nodes[indices[i]] = nodes[i] + change * f32x4::splat(mobility[i] / total);
            }
        }
    }
}

/// How full of material the grid can be near the walls, where part of each stencil lies outside.
#[derive(Debug, Clone)]
pub struct WallFill<const D: usize> {
    /// Per axis and node, the part of the node's spline between the walls, in [0, 1].
    nodes: [Vec<f32>; D],
}

impl<const D: usize> WallFill<D> {
    pub fn new(walls: &Walls<D>, layout: &Layout<D>) -> Self {
        let cells = |x: f32| f64::from(x) * layout.resolution as f64 + PADDING as f64;
        let nodes = std::array::from_fn(|axis| {
            let (lower, upper) = (cells(walls.lower[axis]), cells(walls.upper[axis]));
            (0..layout.extent)
                .map(|i| (cumulative(upper - i as f64) - cumulative(lower - i as f64)) as f32)
                .collect()
        });
        Self { nodes }
    }

    /// Part of the stencil of one particle of a block that lies between the walls; 1 far from them.
    #[inline(always)]
    pub fn at(&self, stencils: &Stencils<D>, lane: usize) -> f32 {
        let mut fill = 1.0;
        for axis in 0..D {
            let base = stencils.base[axis][lane] as usize;
            let nodes = &self.nodes[axis][base..base + 3];
            let w = &stencils.weights[axis];
            fill *= nodes[0] * w[0][lane] + nodes[1] * w[1][lane] + nodes[2] * w[2][lane];
        }
        fill
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
    use crate::lanes::LANES;

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
        let at = |x: f32, y: f32| fill.at(&Stencils::at(&[[x; LANES], [y; LANES]], &layout), 0);
        assert!((at(0.5, 0.5) - 1.0).abs() < 1e-6);
        // Not exactly: between nodes, the spline of splines is not symmetric.
        assert!((at(0.1, 0.5) - 0.5).abs() < 0.02 && (at(0.5, 0.9) - 0.5).abs() < 0.02);
        assert!((at(0.9, 0.1) - 0.25).abs() < 0.02);
        assert!((at(0.1 + 3.01 / 64.0, 0.5) - 1.0).abs() < 1e-6);
    }
}
