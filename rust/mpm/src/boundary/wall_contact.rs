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

use super::contact::{Contact, ContactKind};
use super::node::MaterialFriction;
use super::walls::Walls;
use crate::grid::{Grid, Layout, PADDING, SMALLEST_MASS, Span, Window, spline};

/// Node lines that are computed together.
const BATCH: usize = 4;
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
        let mut batch = [[0; 3]; BATCH];
        let mut count = 0;
        for middle in lines.iter().cloned().flatten() {
            let nodes = nodes_across(middle - window.first);
            if window.nodes[nodes[telling]].to_array()[3] <= SMALLEST_MASS {
                continue;
            }
            batch[count] = nodes;
            count += 1;
            if count == BATCH {
                self.push(window, side, &batch, friction);
                count = 0;
            }
        }
        self.push(window, side, &batch[..count], friction);
    }

    /// Contact on up to `BATCH` node lines; each is its outer, middle and inner node.
    #[inline(always)]
    fn push<const D: usize>(
        &self,
        window: &mut Window<'_, D>,
        side: &Side,
        lines: &[[usize; 3]],
        friction: &MaterialFriction,
    ) {
        // From one vector a node to one vector a component; lines that are missing have no mass.
        let mut nodes: [[f32x4; BATCH]; 3] = std::array::from_fn(|step| {
            let of_line = |i: usize| {
                lines
                    .get(i)
                    .map_or(f32x4::ZERO, |line| window.nodes[line[step]])
            };
            f32x4::transpose(std::array::from_fn(of_line))
        });
        let mu = match (self.contact.friction, friction) {
            (Some(mu), _) | (None, &MaterialFriction::Uniform(mu)) => f32x4::splat(mu),
            (None, mixed) => f32x4::from(std::array::from_fn::<f32, BATCH, _>(|i| {
                lines.get(i).map_or(0.0, |line| {
                    let mass = window.nodes[line[1]].to_array()[3];
                    mixed.at(window, line[1], mass.max(SMALLEST_MASS))
                })
            })),
        };
        apply_contact::<D>(self.contact.kind, side, mu, &mut nodes);
        for (step, nodes) in nodes.into_iter().enumerate() {
            for (line, node) in lines.iter().zip(f32x4::transpose(nodes)) {
                window.nodes[line[step]] = node;
            }
        }
    }
}

/// Changes velocities so that the material at the wall obeys the contact. `nodes[step]` are the components of
/// the outer, middle and inner nodes, the last their mass; each lane is a line of its own.
#[inline(always)]
fn apply_contact<const D: usize>(
    kind: ContactKind,
    side: &Side,
    mu: f32x4,
    nodes: &mut [[f32x4; BATCH]; 3],
) {
    let (zero, one) = (f32x4::ZERO, f32x4::ONE);
    let mut mobility = [zero; 3];
    let mut at_wall = [zero; D];
    let mut total = zero;
    for step in 0..3 {
        // Empty nodes have no velocity to speak of and take no impulse.
        let mass = nodes[step][3];
        let there = mass.simd_gt(f32x4::splat(SMALLEST_MASS));
        let weight = there.bitselect(f32x4::splat(side.weights[step]), zero);
        mobility[step] = weight / there.bitselect(mass, one);
        total += mobility[step] * weight;
        for axis in 0..D {
            at_wall[axis] += weight * nodes[step][axis];
        }
    }
    let approach = at_wall[side.axis] * f32x4::splat(-side.inward);
    let mut slip = at_wall;
    slip[side.axis] = zero;
    let mut none = total.simd_le(zero);
    let lost = match kind {
        ContactKind::Sticky => one,
        ContactKind::Slip => zero,
        ContactKind::Separating => {
            none |= approach.simd_le(zero);
            let speed = slip
                .iter()
                .fold(zero, |sum, &slip| sum + slip * slip)
                .sqrt();
            // Coulomb friction takes at most `capacity` of the slip; see `remaining_slip`.
            let capacity = mu * approach;
            let stops = speed.simd_le(capacity) | speed.simd_eq(zero);
            stops.bitselect(one, capacity / stops.bitselect(one, speed))
        }
    };
    // Impulse per change of the velocity at the wall; each node takes its share.
    let impulse = none.bitselect(zero, one / none.bitselect(one, total));
    for axis in 0..D {
        let change = if axis == side.axis {
            approach * f32x4::splat(side.inward)
        } else {
            zero - slip[axis] * lost
        };
        for step in 0..3 {
            nodes[step][axis] += change * impulse * mobility[step];
        }
    }
}
