//! Contact with the six (four) sides of the box at their true positions between grid nodes.
//!
//! On the line of nodes that crosses a wall at x_w, the velocity of the material at the wall is
//! u = sum_i w_i(x_w) v_i over three nodes. An impulse lambda at that point changes node i by
//! w_i lambda / m_i, so u changes by K lambda with K = sum_i w_i^2 / m_i. Separating contact requires
//! lambda >= 0 with u . n >= 0, friction for a tangential impulse of at most mu lambda. Uniform pressure
//! p pushes node i with exactly -p w_i(x_w) per area, so fluid at rest stays at rest: a wall on the
//! nearest node line would let it sink by up to half a cell.
//!
//! Contact begins where the face of the material is nearer to the wall than its reach. The distance d of a plane face
//! follows from the ratio of the masses of the middle and the inner node, and from the position of the wall between
//! nodes. So the reach does not depend on that position. With a test for mass on a single node it would vary by up to a
//! cell: material would stop at a third of a cell from one wall, and at one and a third from another.

use super::contact::{Contact, Walls};
use super::node::MaterialFriction;
use super::reactions::Reactions;
use super::touch::{Touch, touching};
use super::wall_lines::{ResolveLines, Wall};
use crate::grid::{ActiveSpans, CHUNK, Fields, Layout, PADDING, Span, Window, spline};
use crate::linalg::run_wide;

/// Which lines across walls to change.
#[derive(Debug, Clone, Copy)]
pub struct Lines<'a> {
    /// Those of the grid, or of a field that has its own nodes; and whether that is elastic.
    pub own: Option<bool>,
    /// Those across the first axis, the others, or one after the other.
    pub across_first: &'a [bool],
    /// Duration of the substep [s].
    pub dt: f32,
}

/// One wall on the grid.
#[derive(Debug, Clone)]
struct Side {
    wall: Wall,
    /// Coordinate along the axis of the middle one of the three nodes.
    middle: usize,
    /// See `touching`.
    touching: [Touch; 2],
    /// Memory indices of the middle nodes of the lines that may carry material, in ascending order: those of each line if
    /// lines are parts of rows, else the first of each chunk of lines side by side. First those that something may reach that
    /// flows, and then those that only elastic bodies reach.
    lines: [Vec<usize>; 2],
    /// Those of them whose nodes carry several fields.
    shared_lines: Vec<usize>,
}

/// All walls of a scene, prepared for one grid.
#[derive(Debug, Clone)]
pub struct WallContact {
    sides: Vec<Side>,
}

impl WallContact {
    pub fn new<const D: usize>(walls: &Walls<D>, layout: &Layout<D>) -> Self {
        let side = |axis: usize, position: f32, inward: f32, contact: Contact| {
            let xi = f64::from(position) * layout.resolution as f64 + PADDING as f64;
            let base = (xi - 0.5).floor();
            let mut weights = spline((xi - base) as f32);
            if inward < 0.0 {
                weights.reverse();
            }
            let face = (xi - base - 1.0) * f64::from(inward);
            Side {
                wall: Wall {
                    axis,
                    inward,
                    contact,
                    position: f64::from(position),
                    weights,
                },
                middle: base as usize + 1,
                touching: touching(
                    face,
                    1.0,
                    contact.kind,
                    1.0 / layout.resolution as f64,
                    (true, false),
                ),
                lines: [Vec::new(), Vec::new()],
                shared_lines: Vec::new(),
            }
        };
        let sides = (0..D)
            .flat_map(|axis| {
                let [lower, upper] = walls.contacts[axis];
                [
                    side(axis, walls.lower[axis], 1.0, lower),
                    side(axis, walls.upper[axis], -1.0, upper),
                ]
            })
            .collect();
        Self { sides }
    }

    /// Finds the node lines across each wall that may have mass.
    pub fn activate<const D: usize>(
        &mut self,
        active: &ActiveSpans,
        fields: &Fields<D>,
        layout: &Layout<D>,
    ) {
        let map = fields.map();
        for side in &mut self.sides {
            let mut lines = std::mem::take(&mut side.lines[0]);
            lines.clear();
            let chunks = |span: &Span| {
                let start = span.row * layout.row_length;
                (start + span.lo..start + span.hi).step_by(CHUNK)
            };
            if side.wall.axis == 0 {
                let planes = side.middle..side.middle + 1;
                lines.extend(active.of_planes(planes).iter().flat_map(chunks));
            } else if side.wall.axis == D - 1 {
                let reached = |span: &&Span| span.lo < side.middle && side.middle + 1 < span.hi;
                let middle = |span: &Span| span.row * layout.row_length + side.middle;
                let spans = active.all().iter().filter(reached);
                lines.extend(spans.map(middle));
            } else {
                for plane in 0..layout.planes() {
                    let row = plane * layout.rows_per_plane() + side.middle;
                    let spans = active.of_planes(plane..plane + 1);
                    let first = spans.partition_point(|span| span.row < row);
                    let of_row = spans[first..].iter().take_while(|span| span.row == row);
                    lines.extend(of_row.flat_map(chunks));
                }
            }
            side.shared_lines.clear();
            if fields.meet() {
                let shared = lines.iter();
                let shared = shared.filter(|line| map.is_shared(**line / CHUNK));
                side.shared_lines.extend(shared);
            }
            side.lines[1].clear();
            let elastic = lines.extract_if(.., |line| map.only_elastic(*line / CHUNK));
            side.lines[1].extend(elastic);
            side.lines[0] = lines;
        }
    }

    /// The other chunks of the lines across walls that have nodes in a chunk.
    pub fn chunks_of_lines<const D: usize>(
        &self,
        layout: &Layout<D>,
        chunk: usize,
        others: &mut Vec<usize>,
    ) {
        for side in &self.sides {
            let (at, stride, of_line) = if side.wall.axis == D - 1 {
                let of_node = |node: usize| node / CHUNK;
                let of_line = of_node(side.middle - 1)..=of_node(side.middle + 1);
                (chunk % (layout.row_length / CHUNK), 1, of_line)
            } else {
                let stride = layout.stride(side.wall.axis) / CHUNK;
                let at = chunk / stride % layout.extents[side.wall.axis];
                (at, stride, side.middle - 1..=side.middle + 1)
            };
            if of_line.contains(&at) {
                others.extend(
                    of_line
                        .filter(|&k| k != at)
                        .map(|k| chunk + k * stride - at * stride),
                );
            }
        }
    }

    /// Whether lines in a window carry several fields.
    pub fn has_shared_lines<const D: usize>(&self, window: &Window<'_, D>) -> bool {
        let shared = |side: &Side| !lines_in(window, &side.shared_lines).is_empty();
        self.sides.iter().any(shared)
    }

    /// Coordinates along the first axis of the walls across it.
    pub fn planes(&self) -> Vec<usize> {
        let across = self.sides.iter().filter(|side| side.wall.axis == 0);
        across.map(|side| side.middle).collect()
    }

    /// Applies contact with all walls to the grid velocities of a window of planes, which contains with the planes of a
    /// wall also those before and behind it.
    pub fn apply<const D: usize>(
        &self,
        window: &mut Window<'_, D>,
        friction: &MaterialFriction,
        lines: Lines<'_>,
        reactions: &mut Reactions<D>,
    ) {
        let dt = lines.dt;
        for across_first in lines.across_first {
            // Corners: walls across the first axis come last.
            let sides = self.sides.iter();
            for side in sides.filter(|side| (side.wall.axis == 0) == *across_first) {
                let upper = usize::from(side.wall.inward < 0.0);
                let mut wrench =
                    (reactions.kept).then_some(&mut reactions.walls[side.wall.axis][upper]);
                let friction = match side.wall.contact.friction {
                    Some(mu) => MaterialFriction::Uniform(mu),
                    None => *friction,
                };
                // Lines of a side have no node in common, so their order has no influence.
                let mut resolve = |lines: &[usize], elastic: bool| {
                    let lines = lines_in(window, lines);
                    if !lines.is_empty() {
                        run_wide(ResolveLines {
                            window,
                            wall: &side.wall,
                            touching: side.touching[usize::from(elastic)],
                            dt,
                            lines,
                            friction,
                            wrench: wrench.as_deref_mut(),
                        });
                    }
                };
                if let Some(elastic) = lines.own {
                    resolve(&side.shared_lines, elastic);
                } else {
                    resolve(&side.lines[0], false);
                    resolve(&side.lines[1], true);
                }
            }
        }
    }
}

/// Those of some lines, in ascending order, that lie in a window.
fn lines_in<'l, const D: usize>(window: &Window<'_, D>, lines: &'l [usize]) -> &'l [usize] {
    let place = |node: usize| lines.partition_point(|&line| line < node);
    &lines[place(window.first)..place(window.first + window.nodes.len())]
}
