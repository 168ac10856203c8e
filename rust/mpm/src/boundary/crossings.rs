//! Where lines of nodes cross the surface of a convex solid, sixteen nodes at a time.
//!
//! `Solids::line` does the same for one node, with the same operations in the same order.

use super::lines::{LINE_CELLS, Line, MOST_STEPS, ON_SURFACE, Solids, lowest_start};
use super::motion::Pose;
use super::obstacle::Obstacle;
use crate::grid::Layout;
use crate::linalg::{Kernel, LANES, Lanes, Quad, Vector, run_wide};
use std::ops::Range;

/// Nodes with mass that are near to one obstacle.
pub struct Batch<const D: usize> {
    obstacle: usize,
    count: usize,
    /// Coordinates and memory indices.
    nodes: [([usize; D], usize); LANES],
    /// Places [m].
    x: [Lanes; D],
}

impl<const D: usize> Batch<D> {
    pub fn new() -> Self {
        Self {
            obstacle: 0,
            count: 0,
            nodes: [([0; D], 0); LANES],
            x: [[0.0; LANES]; D],
        }
    }

    /// Whether the nodes have to be forgotten before one near to an obstacle is added.
    pub fn ends_before(&self, obstacle: usize) -> bool {
        self.count == LANES || self.count > 0 && self.obstacle != obstacle
    }

    pub fn add(&mut self, obstacle: usize, node: ([usize; D], usize), layout: &Layout<D>) {
        let x = layout.position(node.0);
        for axis in 0..D {
            self.x[axis][self.count] = x[axis];
        }
        self.nodes[self.count] = node;
        (self.obstacle, self.count) = (obstacle, self.count + 1);
    }

    /// Adds the lines that begin at the nodes, along the axes that are asked for in their planes, and forgets the nodes.
    pub fn find(
        &mut self,
        solids: &Solids<'_, D>,
        axes: impl Fn(usize) -> Range<usize>,
        found: &mut [Vec<Line<D>>; D],
    ) {
        let (index, dx) = (self.obstacle, solids.layout.dx());
        let nodes = &self.nodes[..std::mem::take(&mut self.count)];
        if nodes.is_empty() {
            return;
        }
        let (obstacle, pose) = (&solids.list[index], solids.pose(index));
        if !obstacle.shape.is_convex() {
            for &node in nodes {
                let at = obstacle.distance_in(pose, &solids.layout.position(node.0));
                if at.0 > lowest_start(obstacle, dx) && at.0 <= LINE_CELLS * dx {
                    for axis in axes(node.0[0]) {
                        let line = |up: f32| solids.line(index, node, at, axis, up);
                        found[axis].extend([1.0, -1.0].into_iter().filter_map(line));
                    }
                }
            }
            return;
        }
        let crossings = run_wide(Candidates {
            obstacle,
            pose,
            dx,
            inset: solids.inset(index),
            x: self.x,
            count: nodes.len(),
        });
        for (lane, &node) in nodes.iter().enumerate() {
            for axis in axes(node.0[0]) {
                for (crossing, inward) in crossings[axis].iter().zip([1.0, -1.0]) {
                    if crossing.found[lane] {
                        let direction = (axis, inward);
                        let at = crossing.of(lane);
                        let line = solids.line_across(index, node, at, direction, Vector::zeros());
                        found[axis].extend(line);
                    }
                }
            }
        }
    }
}

/// Nodes near to one convex solid.
struct Candidates<'a, const D: usize> {
    obstacle: &'a Obstacle<D>,
    pose: Option<&'a Pose<D>>,
    /// Cell size [m].
    dx: f32,
    /// See `Solids::inset`.
    inset: f32,
    /// Places of the nodes [m].
    x: [Lanes; D],
    /// Of those in use.
    count: usize,
}

/// Where the lines from each node in one direction cross the surface.
#[derive(Debug, Clone, Copy)]
struct Crossings<const D: usize> {
    found: [bool; LANES],
    /// Distance from the node along the axis [cells].
    t: Lanes,
    normal: [Lanes; D],
}

impl<const D: usize> Crossings<D> {
    const NONE: Self = Self {
        found: [false; LANES],
        t: [0.0; LANES],
        normal: [[0.0; LANES]; D],
    };

    /// Distance along the axis [cells], and the normal there.
    fn of(&self, lane: usize) -> (f32, Vector<D>) {
        let normal = Vector::from_fn(|axis, _| self.normal[axis][lane]);
        (self.t[lane], normal)
    }
}

/// Whether any lane holds.
#[inline(always)]
fn any(lanes: &[bool; LANES]) -> bool {
    lanes.iter().fold(false, |any, lane| any | lane)
}

impl<const D: usize> Kernel for Candidates<'_, D> {
    /// By axis: up, and down.
    type Output = [[Crossings<D>; 2]; D];

    #[inline(always)]
    fn run<Q: Quad>(self) -> Self::Output {
        let mut crossings = [[Crossings::NONE; 2]; D];
        let (distance, normal) = self.obstacle.distances(self.pose, &self.x);
        let (mut left, mut near) = ([0.0; LANES], [false; LANES]);
        for i in 0..LANES {
            left[i] = distance[i] / self.dx;
            near[i] =
                (distance[i] > 0.0) & (distance[i] <= LINE_CELLS * self.dx) & (i < self.count);
        }
        if any(&near) {
            for (axis, both) in crossings.iter_mut().enumerate() {
                for (crossing, inward) in both.iter_mut().zip([1.0, -1.0]) {
                    *crossing = self.crossing(axis, inward, near, left, normal);
                }
            }
        }
        crossings
    }
}

impl<const D: usize> Candidates<'_, D> {
    /// Places on the lines, so far from their nodes [cells].
    #[inline(always)]
    fn places(&self, axis: usize, inward: f32, t: &Lanes) -> [Lanes; D] {
        let mut places = self.x;
        for i in 0..LANES {
            places[axis][i] += inward * t[i] * self.dx;
        }
        places
    }

    /// From nodes at distances `left` [cells], with the normals there.
    #[inline(always)]
    fn crossing(
        &self,
        axis: usize,
        inward: f32,
        mut found: [bool; LANES],
        mut left: Lanes,
        mut normal: [Lanes; D],
    ) -> Crossings<D> {
        let mut t = [0.0; LANES];
        // A step to the plane at the nearest point passes no surface of a convex solid.
        for _ in 0..MOST_STEPS {
            let mut goes_on = [false; LANES];
            for i in 0..LANES {
                let approach = -normal[axis][i] * inward;
                let next = t[i] + left[i] / approach;
                let there = left[i] <= ON_SURFACE;
                let may = (approach > 0.0) & (next <= LINE_CELLS);
                goes_on[i] = found[i] & !there & may;
                found[i] &= there | may;
                t[i] = if goes_on[i] { next } else { t[i] };
            }
            if !any(&goes_on) {
                break;
            }
            let places = self.places(axis, inward, &t);
            let (distance, at) = self.obstacle.distances(self.pose, &places);
            for i in 0..LANES {
                left[i] = if goes_on[i] {
                    distance[i] / self.dx
                } else {
                    left[i]
                };
            }
            for k in 0..D {
                for i in 0..LANES {
                    // Inside of an edge the nearest face may be another one.
                    let new = goes_on[i] & (left[i] >= 0.0);
                    normal[k][i] = if new { at[k][i] } else { normal[k][i] };
                }
            }
        }
        let mut far = [false; LANES];
        for i in 0..LANES {
            let mut is_steepest = true;
            let size = |k: usize| normal[k][i].abs() * (1.0 + 1.0e-3 * k as f32);
            for k in 0..D {
                is_steepest &= if k <= axis {
                    size(k) <= size(axis)
                } else {
                    size(k) < size(axis)
                };
            }
            found[i] &= (left[i] <= ON_SURFACE) & is_steepest;
            far[i] = found[i] & (t[i] > 2.0 - LINE_CELLS);
        }
        if any(&far) {
            // On the next node, up to rounding, where that does not begin the line itself.
            let next = self.places(axis, inward, &[1.0; LANES]);
            let (distance, _) = self.obstacle.distances(self.pose, &next);
            for i in 0..LANES {
                found[i] &= !(far[i] & (distance[i] > 0.0));
            }
        }
        if any(&found) {
            let mut inside = [0.0; LANES];
            for i in 0..LANES {
                t[i] = t[i].min(1.0);
                inside[i] = t[i] + self.inset;
            }
            let inside = self.places(axis, inward, &inside);
            let (depth, deep) = self.obstacle.distances(self.pose, &inside);
            for i in 0..LANES {
                let mut beside = false;
                for k in 0..D {
                    beside |= deep[k][i].abs() > deep[axis][i].abs();
                }
                found[i] &= !((depth[i] < 0.0) & beside);
            }
        }
        Crossings { found, t, normal }
    }
}

#[cfg(test)]
mod tests {
    use super::super::contact::{Contact, ContactKind};
    use super::super::motion::Motion;
    use super::super::shape::Shape;
    use super::*;

    fn check<const D: usize>() {
        let point = |at: [f32; 3]| Vector::<D>::from_fn(|axis, _| at[axis]);
        let (lower, upper) = (point([0.25, 0.2, 0.4]), point([0.6, 0.5, 0.75]));
        let shapes = [
            Shape::Ball {
                center: point([0.5, 0.4, 0.5]),
                radius: 0.2,
            },
            Shape::Box { lower, upper },
            Shape::Segment {
                start: lower,
                end: upper,
                thickness: 0.07,
            },
            Shape::Cylinder {
                start: lower,
                end: upper,
                radius: 0.1,
            },
            Shape::HalfSpace {
                point: lower,
                normal: (upper - lower).normalize(),
            },
        ];
        let layout = Layout::<D>::unit(32);
        let contact = Contact {
            kind: ContactKind::Separating,
            friction: None,
        };
        let spin: &[f32] = if D == 2 { &[1.0] } else { &[0.3, 0.5, 1.0] };
        let motion = Motion::new(point([0.1, 0.05, 0.0]), spin, lower, None).unwrap();
        for (shape, time) in shapes.into_iter().flat_map(|shape| {
            let at = move |time| (shape.clone(), time);
            [0.0, 0.31, 0.9].map(at)
        }) {
            let list = [Obstacle::new(shape, contact).unwrap().moving(motion)];
            let solids = Solids {
                list: &list,
                reaches: &[],
                poses: &[Some(motion.pose(time))],
                buckets: None,
                layout: &layout,
                dt: 1.0e-4,
                elastic: true,
            };
            let (mut batch, mut found) = (Batch::new(), std::array::from_fn(|_| Vec::new()));
            let mut alone: [Vec<Line<D>>; D] = std::array::from_fn(|_| Vec::new());
            for memory in 0..layout.row_count() * layout.row_length {
                let mut node = layout.row_coordinates(memory / layout.row_length);
                node[D - 1] = memory % layout.row_length;
                let at = list[0].distance_in(solids.pose(0), &layout.position(node));
                if at.0.abs() > 2.0 * layout.dx() {
                    continue;
                }
                if batch.ends_before(0) {
                    batch.find(&solids, |_| 0..D, &mut found);
                }
                batch.add(0, (node, memory), &layout);
                if at.0 > 0.0 && at.0 <= LINE_CELLS * layout.dx() {
                    for axis in 0..D {
                        let line = |up: f32| solids.line(0, (node, memory), at, axis, up);
                        alone[axis].extend([1.0, -1.0].into_iter().filter_map(line));
                    }
                }
            }
            batch.find(&solids, |_| 0..D, &mut found);
            assert!(found.iter().map(Vec::len).sum::<usize>() > 20);
            assert!(found == alone, "{:?} at {time} s", list[0].shape);
        }
    }

    #[test]
    fn lines_are_those_from_one_node_at_a_time() {
        check::<2>();
        check::<3>();
    }
}
