//! Where lines of nodes cross the surface of a solid.
//!
//! A line goes from a node outside along an axis, step by step: to the plane at the nearest point of a convex solid, which passes
//! no part of it, or as far as the distance to another one. Nodes near to a convex solid are treated many at a time, those near
//! to facets one by one, for the costs of their distances differ. In WebAssembly many at a time would save no time.

use super::lines::{
    BESIDE, Crossing, LINE_CELLS, Line, ON_SURFACE, OPENING_INSET, SMOOTH, lowest_start,
};
use super::motion::Pose;
use super::obstacle::Obstacle;
use super::shape::one;
use super::solids::Solids;
use crate::grid::Layout;
use crate::linalg::{Kernel, LANES, Quad, Vector, run_wide};
use std::ops::Range;

/// Nodes that are treated at a time.
pub const MANY: usize = if cfg!(target_arch = "wasm32") {
    1
} else {
    LANES
};
/// Most steps towards a surface; each leaves a fraction of the distance that was left.
const MOST_STEPS: usize = 12;
/// A line of a rigid body this near to the sharp edge of a face is left out [cells]: the one before holds its column in part.
const BODY_INSET: f32 = 0.005;

/// Coordinates and memory index of a node.
type Node<const D: usize> = ([usize; D], usize);

/// Nodes near to one solid, from which lines are looked for.
pub struct Batch<const D: usize, const N: usize> {
    obstacle: usize,
    count: usize,
    nodes: [Node<D>; N],
    /// Places [m].
    x: [[f32; N]; D],
}

impl<const D: usize, const N: usize> Batch<D, N> {
    pub fn new() -> Self {
        Self {
            obstacle: 0,
            count: 0,
            nodes: [([0; D], 0); N],
            x: [[0.0; N]; D],
        }
    }

    /// Whether the nodes have to be forgotten before one near to an obstacle is added.
    pub fn ends_before(&self, obstacle: usize) -> bool {
        self.count == N || self.count > 0 && self.obstacle != obstacle
    }

    pub fn add(&mut self, obstacle: usize, node: Node<D>, layout: &Layout<D>) {
        let x = layout.position(node.0);
        for axis in 0..D {
            self.x[axis][self.count] = x[axis];
        }
        self.nodes[self.count] = node;
        (self.obstacle, self.count) = (obstacle, self.count + 1);
    }

    /// Moves those nodes to another batch that are near enough to begin lines. `find` empties it before one that it cannot take.
    pub fn pass_on(&mut self, solids: &Solids<D>, to: &mut Self, mut find: impl FnMut(&mut Self)) {
        let index = self.obstacle;
        let count = std::mem::take(&mut self.count);
        // Distances from facets cost too much to be found twice, and one at a time saves nothing.
        let near = if N > 1 && count > 0 && solids.list[index].shape.is_convex() {
            run_wide(Near(Candidates::new(solids, index, self.x, count)))
        } else {
            [true; N]
        };
        for lane in (0..count).filter(|lane| near[*lane]) {
            if to.ends_before(index) {
                find(to);
            }
            for axis in 0..D {
                to.x[axis][to.count] = self.x[axis][lane];
            }
            to.nodes[to.count] = self.nodes[lane];
            (to.obstacle, to.count) = (index, to.count + 1);
        }
    }

    /// Adds the lines that begin at the nodes, along the axes that are asked for in their planes, and forgets the nodes. `elastic`
    /// where elastic bodies may touch them.
    pub fn find(
        &mut self,
        solids: &Solids<D>,
        elastic: bool,
        axes: impl Fn(usize) -> Range<usize>,
        found: &mut [Vec<Line<D>>; D],
    ) {
        let index = self.obstacle;
        let nodes = &self.nodes[..std::mem::take(&mut self.count)];
        if nodes.is_empty() {
            return;
        }
        let mut keep = |node: Node<D>, axis: usize, inward: f32, crossing, lift| {
            let (of, direction) = ((index, elastic), (axis, inward));
            found[axis].extend(solids.line_across(of, node, crossing, direction, lift));
        };
        if solids.list[index].shape.is_convex() {
            let all = Candidates::new(solids, index, self.x, nodes.len());
            let crossings = run_wide(all);
            for (lane, &node) in nodes.iter().enumerate() {
                for axis in axes(node.0[0]) {
                    for (crossing, inward) in crossings[axis].iter().zip([1.0, -1.0]) {
                        if let Some(crossing) = crossing.of(lane) {
                            keep(node, axis, inward, crossing, Vector::zeros());
                        }
                    }
                }
            }
            return;
        }
        for &node in nodes {
            let x = solids.layout.position(node.0);
            let Some((lift, flat, (distance, normal))) = start(solids, index, &x) else {
                continue;
            };
            let (left, normal) = ([distance / solids.layout.dx()], one(&normal));
            let alone = Candidates::new(solids, index, one(&(x + lift)), 1).lifted(lift);
            for axis in axes(node.0[0]).filter(|axis| flat != Some(*axis)) {
                for inward in [1.0, -1.0] {
                    let crossing = alone.crossing(axis, inward, [true], left, normal);
                    if let Some(crossing) = crossing.of(0) {
                        keep(node, axis, inward, crossing, lift);
                    }
                }
            }
        }
    }
}

/// Where the lines of a node near to a surface of facets begin: how far beside it [m], along which axis none does, and the distance
/// and the normal there.
///
/// Below one face of a concave corner another face goes on as a plane, as each of two solids does where one stands on the other.
fn start<const D: usize>(
    solids: &Solids<D>,
    index: usize,
    x: &Vector<D>,
) -> Option<(Vector<D>, Option<usize>, (f32, Vector<D>))> {
    let dx = solids.layout.dx();
    let (distance, normal) = solids.distance(index, x);
    if distance <= lowest_start(&solids.list[index], dx) || distance > LINE_CELLS * dx {
        return None;
    }
    if distance > 0.0 {
        return Some((Vector::zeros(), None, (distance, normal)));
    }
    let lift = normal * (BESIDE * dx - distance);
    let at = solids.distance(index, &(x + lift));
    let flat = (0..D).find(|axis| is_steepest(&one(&normal), 0, *axis));
    (at.0 > 0.0).then_some((lift, flat, at))
}

/// Whether an axis is the nearest to a normal; of two that are as near, the later one.
#[inline(always)]
fn is_steepest<const D: usize, const N: usize>(
    normal: &[[f32; N]; D],
    lane: usize,
    axis: usize,
) -> bool {
    let size = |k: usize| normal[k][lane].abs() * (1.0 + 1.0e-3 * k as f32);
    let is_behind = |k: usize| size(k) < size(axis) || k <= axis && size(k) == size(axis);
    (0..D).fold(true, |all, k| all & is_behind(k))
}

/// Nodes near to one solid, or places beside them.
struct Candidates<'a, const D: usize, const N: usize> {
    obstacle: &'a Obstacle<D>,
    pose: Option<&'a Pose<D>>,
    is_convex: bool,
    /// Cell size [m].
    dx: f32,
    is_body: bool,
    /// Places of the nodes [m].
    x: [[f32; N]; D],
    /// Of those in use.
    count: usize,
    /// How far beside their nodes the places are [m].
    lift: Vector<D>,
}

/// Where the lines from several nodes in one direction cross the surface.
#[derive(Debug, Clone, Copy)]
struct Crossings<const D: usize, const N: usize> {
    found: [bool; N],
    t: [f32; N],
    normal: [[f32; N]; D],
    near_edge: [bool; N],
}

impl<const D: usize, const N: usize> Crossings<D, N> {
    const NONE: Self = Self {
        found: [false; N],
        t: [0.0; N],
        normal: [[0.0; N]; D],
        near_edge: [false; N],
    };

    /// None where there is no crossing.
    fn of(&self, lane: usize) -> Option<Crossing<D>> {
        self.found[lane].then(|| Crossing {
            t: self.t[lane],
            normal: Vector::from_fn(|axis, _| self.normal[axis][lane]),
            is_near_edge: self.near_edge[lane],
        })
    }
}

/// Whether any lane holds.
#[inline(always)]
fn any<const N: usize>(lanes: &[bool; N]) -> bool {
    lanes.iter().fold(false, |any, lane| any | lane)
}

impl<const D: usize, const N: usize> Kernel for Candidates<'_, D, N> {
    /// By axis: up, and down.
    type Output = [[Crossings<D, N>; 2]; D];

    #[inline(always)]
    fn run<Q: Quad>(self) -> Self::Output {
        let mut crossings = [[Crossings::NONE; 2]; D];
        let (distance, normal) = self.obstacle.measure(self.pose, &self.x);
        let (mut left, mut near) = ([0.0; N], [false; N]);
        for i in 0..N {
            left[i] = distance[i] / self.dx;
            near[i] = self.begins(distance[i]) & (i < self.count);
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

/// Which of them are near enough to begin lines.
struct Near<'a, const D: usize, const N: usize>(Candidates<'a, D, N>);

impl<const D: usize, const N: usize> Kernel for Near<'_, D, N> {
    type Output = [bool; N];

    #[inline(always)]
    fn run<Q: Quad>(self) -> Self::Output {
        let (distance, _) = self.0.obstacle.measure(self.0.pose, &self.0.x);
        distance.map(|distance| self.0.begins(distance))
    }
}

impl<'a, const D: usize, const N: usize> Candidates<'a, D, N> {
    fn new(solids: &'a Solids<D>, index: usize, x: [[f32; N]; D], count: usize) -> Self {
        let obstacle = &solids.list[index];
        Self {
            obstacle,
            pose: solids.pose(index),
            is_convex: obstacle.shape.is_convex(),
            dx: solids.layout.dx(),
            is_body: solids.is_body(index),
            x,
            count,
            lift: Vector::zeros(),
        }
    }

    fn lifted(self, lift: Vector<D>) -> Self {
        Self { lift, ..self }
    }

    /// Places of the next nodes on the lines, as these have them when they begin lines themselves: to the bit. If a node and the one
    /// behind it disagreed by rounding on which side of a face it lies, each would leave the line to the other.
    #[inline(always)]
    fn next(&self, axis: usize, inward: f32) -> [[f32; N]; D] {
        let mut places = self.x;
        for place in &mut places[axis] {
            let node = ((*place - self.lift[axis]) / self.dx).round();
            *place = (node + inward) * self.dx + self.lift[axis];
        }
        places
    }

    /// Whether a node at this distance [m] may begin lines.
    #[inline(always)]
    fn begins(&self, distance: f32) -> bool {
        (distance > 0.0) & (distance <= LINE_CELLS * self.dx)
    }

    /// Places on the lines, so far from their nodes [cells].
    #[inline(always)]
    fn places(&self, axis: usize, inward: f32, t: &[f32; N]) -> [[f32; N]; D] {
        let mut places = self.x;
        for i in 0..N {
            places[axis][i] += inward * t[i] * self.dx;
        }
        places
    }

    /// Whether the nearest face so far behind each crossing [cells] is another one, across a sharp edge. In a thin plate it may be
    /// the one opposite, and then none.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn is_behind_edge(
        &self,
        (axis, inward): (usize, f32),
        t: &[f32; N],
        inset: f32,
        normal: &[[f32; N]; D],
    ) -> [bool; N] {
        let inside = self.places(axis, inward, &t.map(|t| t + inset));
        let (depth, deep) = self.obstacle.measure(self.pose, &inside);
        // A line of an obstacle on the edge itself, up to rounding, is at it.
        let most = if self.is_body {
            0.0
        } else {
            ON_SURFACE * self.dx
        };
        std::array::from_fn(|i| {
            let (mut beside, mut cosine) = (false, 0.0);
            for k in 0..D {
                beside |= deep[k][i].abs() > deep[axis][i].abs();
                cosine += deep[k][i] * normal[k][i];
            }
            (depth[i] < most) & beside & (cosine.abs() < SMOOTH)
        })
    }

    /// The crossings from those nodes that count, at distances `left` [cells], with the normals there.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn crossing(
        &self,
        axis: usize,
        inward: f32,
        mut found: [bool; N],
        mut left: [f32; N],
        mut normal: [[f32; N]; D],
    ) -> Crossings<D, N> {
        let mut t = [0.0; N];
        for _ in 0..MOST_STEPS {
            let mut goes_on = [false; N];
            for i in 0..N {
                let steepness = -normal[axis][i] * inward;
                let approach = if self.is_convex { steepness } else { 1.0 };
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
            let (distance, at) = self.obstacle.measure(self.pose, &places);
            for i in 0..N {
                left[i] = if goes_on[i] {
                    distance[i] / self.dx
                } else {
                    left[i]
                };
            }
            for k in 0..D {
                for i in 0..N {
                    // Inside of an edge the nearest face may be another one.
                    let new = goes_on[i] & (left[i] >= 0.0);
                    normal[k][i] = if new { at[k][i] } else { normal[k][i] };
                }
            }
        }
        let mut far = [false; N];
        for i in 0..N {
            // From a node on the surface, up to rounding, one of two lines leads outwards: it would take what is inside for outside.
            let inwards = normal[axis][i] * inward < 0.0;
            found[i] &= (left[i] <= ON_SURFACE) & inwards & is_steepest(&normal, i, axis);
            far[i] = found[i] & (t[i] > 2.0 - LINE_CELLS);
        }
        if any(&far) {
            // On the next node, up to rounding, where that does not begin the line itself.
            let next = self.next(axis, inward);
            let (distance, _) = self.obstacle.measure(self.pose, &next);
            for i in 0..N {
                found[i] &= !(far[i] & (distance[i] > 0.0));
            }
        }
        let mut near_edge = [false; N];
        if any(&found) {
            t = t.map(|t| t.min(1.0));
            let inset = if self.is_body {
                BODY_INSET
            } else {
                OPENING_INSET
            };
            near_edge = self.is_behind_edge((axis, inward), &t, inset, &normal);
            for i in 0..N {
                found[i] &= !(self.is_body & near_edge[i]);
            }
        }
        Crossings {
            found,
            t,
            normal,
            near_edge,
        }
    }
}

#[cfg(test)]
mod tests;
