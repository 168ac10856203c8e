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
use crate::grid::{Grid, Layout, PADDING, Span, Window};
use crate::grid_update::SMALLEST_MASS;
use crate::lanes::{Kernel, LANES, Lanes, run_wide};
use crate::math::Vector;
use crate::obstacle::MaterialFriction;
use crate::stencil::spline;

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
#[derive(Debug, Clone)]
struct Side {
    axis: usize,
    /// +1 at a lower wall, -1 at an upper one.
    inward: f32,
    /// Coordinate along the axis of the middle one of the three nodes.
    middle: usize,
    /// Weights of the outer, middle and inner node at the wall.
    weights: [f32; 3],
    /// Middle nodes of the lines that may carry material, as ranges of memory in ascending order.
    lines: Vec<Range<usize>>,
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
                lines: Vec::new(),
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

    /// Finds the node lines across each wall that may carry material.
    pub fn activate<const D: usize>(&mut self, active: &[Span], layout: &Layout<D>) {
        for side in &mut self.sides {
            side.lines.clear();
            for span in active {
                let start = span.row * layout.row_length;
                if side.axis == D - 1 {
                    if span.lo < side.middle && side.middle + 1 < span.hi {
                        side.lines
                            .push(start + side.middle..start + side.middle + 1);
                    }
                } else if layout.row_coordinates(span.row)[side.axis] == side.middle {
                    side.lines.push(start + span.lo..start + span.hi);
                }
            }
        }
    }

    /// Contact with the walls whose node lines stay within a plane, to the grid velocities of some planes.
    pub fn apply_within<const D: usize>(
        &self,
        window: &mut Window<'_, D>,
        friction: &MaterialFriction,
    ) {
        for side in self.sides.iter().filter(|side| side.axis > 0) {
            let place = |node: usize| side.lines.partition_point(|line| line.start < node);
            let lines = &side.lines[place(window.first)..place(window.first + window.nodes.len())];
            self.resolve(window, side, lines, friction);
        }
    }

    /// Contact with the walls across the first axis.
    pub fn apply_across<const D: usize>(&self, grid: &mut Grid<D>, friction: &MaterialFriction) {
        let planes = 0..grid.layout.extent;
        for window in &mut grid.windows(std::iter::once(planes)) {
            for side in self.sides.iter().filter(|side| side.axis == 0) {
                self.resolve(window, side, &side.lines, friction);
            }
        }
    }

    /// Contact on node lines. They have no node in common, so their order has no influence.
    fn resolve<const D: usize>(
        &self,
        window: &mut Window<'_, D>,
        side: &Side,
        lines: &[Range<usize>],
        friction: &MaterialFriction,
    ) {
        let stride = window.layout.stride(side.axis) as isize * side.inward as isize;
        let nodes_across =
            |middle: usize| [-stride, 0, stride].map(|step| (middle as isize + step) as usize);
        // The node that shows whether material touches the wall.
        let telling = usize::from(side.weights[0] < WEAK_OUTER_WEIGHT);
        let mut batch = [[0; 3]; LANES];
        let mut count = 0;
        for middle in lines.iter().cloned().flatten() {
            let nodes = nodes_across(middle - window.first);
            if window.nodes[nodes[telling]].to_array()[3] <= SMALLEST_MASS {
                continue;
            }
            batch[count] = nodes;
            count += 1;
            if count == LANES {
                run_wide(Push {
                    contact: &self.contact,
                    side,
                    window,
                    friction,
                    lines: &batch,
                });
                count = 0;
            }
        }
        run_wide(Push {
            contact: &self.contact,
            side,
            window,
            friction,
            lines: &batch[..count],
        });
    }
}

/// Contact on up to `LANES` node lines; each is its outer, middle and inner node.
struct Push<'a, 'w, const D: usize> {
    contact: &'a Contact,
    side: &'a Side,
    window: &'a mut Window<'w, D>,
    friction: &'a MaterialFriction,
    lines: &'a [[usize; 3]],
}

impl<const D: usize> Kernel for Push<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self {
            contact,
            side,
            window,
            ..
        } = self;
        let mut mass = [[0.0; LANES]; 3];
        let mut v = [[[0.0; LANES]; 3]; D];
        let mut mu = [contact.friction.unwrap_or(0.0); LANES];
        for (i, line) in self.lines.iter().enumerate() {
            for (step, &node) in line.iter().enumerate() {
                mass[step][i] = window.nodes[node].to_array()[3];
            }
            if contact.friction.is_none() {
                mu[i] = self.friction.at(window, line[1], mass[1][i]);
            }
        }
        let smooth = contact.kind == ContactKind::Slip || mu.iter().all(|&mu| mu == 0.0);
        // A smooth wall changes the velocity along its normal alone.
        let axes = if smooth && contact.kind != ContactKind::Sticky {
            side.axis..side.axis + 1
        } else {
            0..D
        };
        for axis in axes.clone() {
            for (i, line) in self.lines.iter().enumerate() {
                for (step, &node) in line.iter().enumerate() {
                    v[axis][step][i] = window.nodes[node].to_array()[axis];
                }
            }
        }
        push(contact.kind, side, &mass, &mu, &mut v);
        for axis in axes {
            for (i, line) in self.lines.iter().enumerate() {
                for (step, &node) in line.iter().enumerate() {
                    window.nodes[node].as_mut_array()[axis] = v[axis][step][i];
                }
            }
        }
    }
}

/// Changes velocities `v[axis][step]` so that the material at the wall obeys the contact. Without branches.
#[inline(always)]
fn push<const D: usize>(
    kind: ContactKind,
    side: &Side,
    mass: &[Lanes; 3],
    mu: &Lanes,
    v: &mut [[Lanes; 3]; D],
) {
    let mut mobility = [[0.0; LANES]; 3];
    let mut at_wall = [[0.0; LANES]; D];
    let mut total = [0.0; LANES];
    for step in 0..3 {
        let mut weights = [0.0; LANES];
        for i in 0..LANES {
            // Empty nodes have no velocity to speak of and take no impulse.
            let there = mass[step][i] > SMALLEST_MASS;
            weights[i] = if there { side.weights[step] } else { 0.0 };
            mobility[step][i] = weights[i] / if there { mass[step][i] } else { 1.0 };
            total[i] += mobility[step][i] * weights[i];
        }
        for axis in 0..D {
            for i in 0..LANES {
                at_wall[axis][i] += weights[i] * v[axis][step][i];
            }
        }
    }
    let approach = at_wall[side.axis].map(|v| -v * side.inward);
    at_wall[side.axis] = [0.0; LANES];
    let slip = at_wall;
    let mut lost = [if kind == ContactKind::Sticky {
        1.0
    } else {
        0.0
    }; LANES];
    // Impulse per change of the velocity at the wall; each node takes its share.
    let mut impulse = [0.0; LANES];
    for i in 0..LANES {
        impulse[i] = if total[i] > 0.0 { 1.0 / total[i] } else { 0.0 };
    }
    if kind == ContactKind::Separating {
        for i in 0..LANES {
            let mut squared = 0.0;
            for axis in 0..D {
                squared += slip[axis][i] * slip[axis][i];
            }
            lost[i] = 1.0 - remaining_slip(squared.sqrt(), mu[i] * approach[i]);
            impulse[i] = if approach[i] > 0.0 { impulse[i] } else { 0.0 };
        }
    }
    for axis in 0..D {
        let mut change = [0.0; LANES];
        for i in 0..LANES {
            let normal = if axis == side.axis {
                approach[i] * side.inward
            } else {
                0.0
            };
            change[i] = (normal - slip[axis][i] * lost[i]) * impulse[i];
        }
        for step in 0..3 {
            for i in 0..LANES {
                v[axis][step][i] += change[i] * mobility[step][i];
            }
        }
    }
}
