//! The six (four) sides of the box, enforced where they are although that is between grid nodes.
//!
//! On the line of nodes that crosses a wall at x_w, the velocity of the material at the wall is
//! u = sum_i w_i(x_w) v_i over three nodes. An impulse lambda at that point changes node i by
//! w_i lambda / m_i, so u changes by K lambda with K = sum_i w_i^2 / m_i. Separating contact asks for
//! lambda >= 0 with u . n >= 0, friction for a tangential impulse of at most mu lambda. Uniform pressure
//! p pushes node i with exactly -p w_i(x_w) per area, so fluid at rest stays at rest: a wall on the
//! nearest node line would let it sink by up to half a cell.
//!
//! Contact begins where the face of the material is nearer to the wall than `REACH`. The masses of the middle and
//! of the inner node tell: beside a plane face at a distance d from the wall their ratio is a function of d and of the place
//! of the wall between nodes. So the reach is the same wherever the wall lies. A single node that has mass or not would
//! give it away by up to a cell: material would stop at a third of a cell from one wall, at one and a third from another.

use std::ops::Range;

use super::contact::{Contact, ContactKind, remaining_slip};
use super::node::MaterialFriction;
use super::wall_fill::cumulative;
use super::walls::Walls;
use crate::grid::{ActiveSpans, CHUNK, Layout, PADDING, SMALLEST_MASS, Span, Window, spline};
use crate::linalg::{Kernel, LANES, Lanes, Quad, run_wide};

/// Distance from the wall at which material begins to touch it [cells]. Material at rest on a wall, whose lowest particles
/// are up to a third of a cell off it, has to touch; beyond, a coarse grid stops material sooner than a fine one.
const REACH: f64 = 0.45;

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
    /// Mass of the middle node over that of the inner one where material begins to touch the wall [-].
    touching: f32,
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
            // The face at the reach, in cells inward from the middle node.
            let face = (xi - base - 1.0) * f64::from(inward) + REACH;
            Side {
                axis,
                inward,
                middle: base as usize + 1,
                weights,
                touching: (cumulative(-face) / cumulative(1.0 - face)) as f32,
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
    pub fn activate<const D: usize>(&mut self, active: &ActiveSpans, layout: &Layout<D>) {
        for side in &mut self.sides {
            side.lines.clear();
            let along = |span: &Span| {
                let start = span.row * layout.row_length;
                start + span.lo..start + span.hi
            };
            if side.axis == 0 {
                let planes = side.middle..side.middle + 1;
                side.lines
                    .extend(active.of_planes(planes).iter().map(along));
            } else if side.axis == D - 1 {
                let reached = |span: &&Span| span.lo < side.middle && side.middle + 1 < span.hi;
                let across = |span: &Span| {
                    let middle = span.row * layout.row_length + side.middle;
                    middle..middle + 1
                };
                let spans = active.all().iter().filter(reached);
                side.lines.extend(spans.map(across));
            } else {
                for plane in 0..layout.extent {
                    let row = plane * layout.rows_per_plane() + side.middle;
                    let spans = active.of_planes(plane..plane + 1);
                    let first = spans.partition_point(|span| span.row < row);
                    let of_row = spans[first..].iter().take_while(|span| span.row == row);
                    side.lines.extend(of_row.map(along));
                }
            }
        }
    }

    /// Coordinates along the first axis of the walls across it.
    pub fn planes(&self) -> Vec<usize> {
        let across = self.sides.iter().filter(|side| side.axis == 0);
        across.map(|side| side.middle).collect()
    }

    /// Contact with all walls, to the grid velocities of some planes. With the planes of a wall they hold the planes before
    /// and behind it.
    pub fn apply<const D: usize>(&self, window: &mut Window<'_, D>, friction: &MaterialFriction) {
        for across_first in [false, true] {
            // Corners: walls across the first axis come last.
            let sides = self.sides.iter();
            for side in sides.filter(|side| (side.axis == 0) == across_first) {
                let place = |node: usize| side.lines.partition_point(|line| line.start < node);
                let (first, end) = (window.first, window.first + window.nodes.len());
                self.resolve(
                    window,
                    side,
                    &side.lines[place(first)..place(end)],
                    friction,
                );
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
        let friction = match (self.contact.friction, friction) {
            (Some(mu), _) => MaterialFriction::Uniform(mu),
            (None, of_material) => *of_material,
        };
        run_wide(ResolveLines {
            window,
            side,
            lines,
            kind: self.contact.kind,
            friction,
        });
    }
}

/// Contact of one wall on node lines.
struct ResolveLines<'a, 'w, const D: usize> {
    window: &'a mut Window<'w, D>,
    side: &'a Side,
    /// Memory indices of their middle nodes.
    lines: &'a [Range<usize>],
    kind: ContactKind,
    friction: MaterialFriction,
}

impl<const D: usize> Kernel for ResolveLines<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(mut self) {
        let mut batch = [[0; 3]; LANES];
        let mut count = 0;
        let stride = self.window.layout.stride(self.side.axis) as isize;
        let outward = -stride * self.side.inward as isize;
        for range in self.lines {
            // One line, or lines of whole chunks.
            let (start, end) = (
                range.start - self.window.first,
                range.end - self.window.first,
            );
            for chunk in (start..end).step_by(CHUNK) {
                if !self.window.dirty[chunk / CHUNK] {
                    continue;
                }
                for middle in chunk..(chunk + CHUNK).min(end) {
                    let node = |step: isize| (middle as isize + step) as usize;
                    batch[count] = [node(outward), middle, node(-outward)];
                    let mass = self.window.nodes[middle].as_array()[3];
                    let inner = self.window.nodes[node(-outward)].as_array()[3];
                    let touches = mass > SMALLEST_MASS && mass >= self.side.touching * inner;
                    count += usize::from(touches);
                    if count == LANES {
                        self.push(&batch);
                        count = 0;
                    }
                }
            }
        }
        if count > 0 {
            self.push(&batch[..count]);
        }
    }
}

impl<const D: usize> ResolveLines<'_, '_, D> {
    /// Contact on up to `LANES` node lines; each is its outer, middle and inner node.
    #[inline(always)]
    fn push(&mut self, lines: &[[usize; 3]]) {
        // Without friction nothing happens along the wall.
        let smooth = self.kind == ContactKind::Slip
            || self.kind == ContactKind::Separating
                && matches!(self.friction, MaterialFriction::Uniform(0.0));
        if smooth {
            self.push_along(lines, [self.side.axis]);
        } else {
            self.push_along(lines, std::array::from_fn::<_, D, _>(|axis| axis));
        }
    }

    /// The same, for some components of the velocity; one of them is across the wall.
    #[inline(always)]
    fn push_along<const N: usize>(&mut self, lines: &[[usize; 3]], axes: [usize; N]) {
        // Lines that are missing have no mass.
        let mut nodes = LineNodes {
            mass: [[0.0; LANES]; 3],
            v: [[[0.0; LANES]; 3]; N],
        };
        let mut mu = [0.0; LANES];
        for (lane, line) in lines.iter().enumerate() {
            for step in 0..3 {
                let node = self.window.nodes[line[step]].as_array();
                nodes.mass[step][lane] = node[3];
                for k in 0..N {
                    nodes.v[k][step][lane] = node[axes[k]];
                }
            }
            let mass = nodes.mass[1][lane].max(SMALLEST_MASS);
            mu[lane] = self.friction.at(self.window, line[1], mass);
        }
        nodes.apply(self.kind, self.side, &axes, &mu);
        for (lane, line) in lines.iter().enumerate() {
            for step in 0..3 {
                let node = self.window.nodes[line[step]].as_mut_array();
                for k in 0..N {
                    node[axes[k]] = nodes.v[k][step][lane];
                }
            }
        }
    }
}

/// The outer, middle and inner nodes of `LANES` lines, with N components of their velocities.
struct LineNodes<const N: usize> {
    mass: [Lanes; 3],
    v: [[Lanes; 3]; N],
}

impl<const N: usize> LineNodes<N> {
    /// Changes velocities so that the material at the wall obeys the contact. `v[k]` is the component along `axes[k]`.
    #[inline(always)]
    fn apply(&mut self, kind: ContactKind, side: &Side, axes: &[usize; N], mu: &Lanes) {
        for i in 0..LANES {
            let mut mobility = [0.0; 3];
            let mut at_wall = [0.0; N];
            let mut total = 0.0;
            for step in 0..3 {
                // Empty nodes have no velocity to speak of and take no impulse.
                let mass = self.mass[step][i];
                let there = mass > SMALLEST_MASS;
                let weight = if there { side.weights[step] } else { 0.0 };
                mobility[step] = weight / if there { mass } else { 1.0 };
                total += mobility[step] * weight;
                for k in 0..N {
                    at_wall[k] += weight * self.v[k][step][i];
                }
            }
            let (mut approach, mut slip_squared) = (0.0, 0.0);
            for k in 0..N {
                let across = axes[k] == side.axis;
                approach -= if across {
                    at_wall[k] * side.inward
                } else {
                    0.0
                };
                slip_squared += if across { 0.0 } else { at_wall[k] * at_wall[k] };
            }
            let leaves = kind == ContactKind::Separating && approach <= 0.0;
            let none = leaves | (total <= 0.0);
            let lost = match kind {
                ContactKind::Sticky => 1.0,
                ContactKind::Slip => 0.0,
                // Coulomb friction takes at most this part of the slip.
                ContactKind::Separating => {
                    1.0 - remaining_slip(slip_squared.sqrt(), mu[i] * approach)
                }
            };
            // Impulse per change of the velocity at the wall; each node takes its share.
            let impulse = if none { 0.0 } else { 1.0 } / if none { 1.0 } else { total };
            for k in 0..N {
                let across = axes[k] == side.axis;
                let change = if across {
                    approach * side.inward
                } else {
                    -at_wall[k] * lost
                };
                for step in 0..3 {
                    self.v[k][step][i] += change * impulse * mobility[step];
                }
            }
        }
    }
}
