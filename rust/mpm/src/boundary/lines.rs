//! Contact with obstacles at their true surface, as with walls: on each line of nodes that crosses it.
//!
//! Only lines along the axis that is nearest to the normal act, so each part of a surface acts once. See `wall_contact` for
//! the impulse on the three nodes of a line. Nodes alone, inside or out, would put a surface off its place by up to half a
//! cell, and would let material at rest sink.

use super::buckets::Buckets;
use super::contact::ContactKind;
use super::motion::Pose;
use super::node::DEEP_CELLS;
use super::obstacle::Obstacle;
use super::touch::{Touch, touching};
use crate::grid::{Layout, SMALLEST_MASS, spline};
use crate::linalg::Vector;

/// Distance from a surface within which a node begins lines across it [cells].
pub const LINE_CELLS: f32 = 1.01;
/// A line this near to the sharp edge of a face is left out [cells]. With lines up to the edge itself a face would count as
/// wider than it is, as lines are a cell apart, and what flows beside it would be held.
const INSET: f32 = 0.1;
/// The same of rigid bodies, whose lines at an edge hold the columns beside them in part, so that faces count for their area.
const BODY_INSET: f32 = 0.005;
/// How far from a surface its two sides are looked at [cells].
const BESIDE: f32 = 0.25;
/// Distance that counts as none [cells].
pub(super) const ON_SURFACE: f32 = 1.0e-3;
/// Most steps towards a surface; each leaves a fraction of the distance that was left.
pub(super) const MOST_STEPS: usize = 12;

/// A line of three nodes across a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line<const D: usize> {
    /// Memory index of the node outside that it begins at.
    pub node: usize,
    /// Memory index of the middle node.
    pub middle: usize,
    /// From it to the inner node, which lies farther out of the solid.
    step: isize,
    /// Weights of the outer, middle and inner node at the surface.
    weights: [f32; 3],
    /// Where it touches what flows, and what is elastic.
    touching: [Touch; 2],
    pub obstacle: u32,
    pub(super) normal: Vector<D>,
    /// Where the line crosses the surface [m].
    pub x: Vector<D>,
}

/// A line at which material touches a rigid body or is about to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Probe<const D: usize> {
    pub body: u32,
    /// Place on the surface [m], and normal there.
    pub x: Vector<D>,
    pub normal: Vector<D>,
    /// Velocity of the material there [m/s].
    pub u: Vector<D>,
    /// Mass that follows the surface [kg].
    pub mass: f32,
    /// Speed at which the material may come nearer, for it is not yet there [m/s].
    pub closing: f32,
    /// Coulomb coefficient of the material [-].
    pub friction: f32,
}

/// Solids as they are now.
#[derive(Clone, Copy)]
pub struct Solids<'a, const D: usize> {
    pub list: &'a [Obstacle<D>],
    /// Rigid bodies, which end the list: the distance that each reaches from its centre [m].
    pub reaches: &'a [f32],
    /// Empty where all are at rest.
    pub poses: &'a [Option<Pose<D>>],
    /// Where rigid bodies are looked for; None without any.
    pub buckets: Option<&'a Buckets<D>>,
    pub layout: &'a Layout<D>,
    /// Duration of the substep [s].
    pub dt: f32,
    /// Whether elastic bodies may touch them.
    pub elastic: bool,
}

impl<'a, const D: usize> Solids<'a, D> {
    pub fn pose(&self, index: usize) -> Option<&'a Pose<D>> {
        self.poses.get(index)?.as_ref()
    }

    /// The numbers of all solids but rigid bodies, then of the rigid bodies that may be near to a point.
    #[inline(always)]
    pub fn near(&self, x: &Vector<D>) -> impl Iterator<Item = usize> + use<'a, D> {
        let first = self.list.len() - self.reaches.len();
        let bodies = self.buckets.map_or(&[][..], |buckets| buckets.at(x));
        (0..first).chain(bodies.iter().map(|body| *body as usize))
    }

    /// Distance from a sharp edge within which lines are left out [cells].
    pub(super) fn inset(&self, index: usize) -> f32 {
        if index >= self.list.len() - self.reaches.len() {
            BODY_INSET
        } else {
            INSET
        }
    }

    /// Whether a point may lie inside of a solid: false for those far from a rigid body.
    #[inline(always)]
    pub fn may_contain(&self, index: usize, x: &Vector<D>) -> bool {
        let first = self.list.len() - self.reaches.len();
        index < first
            || self.pose(index).is_none_or(|pose| {
                let reach = self.reaches[index - first];
                (x - pose.center()).norm_squared() <= reach * reach
            })
    }

    pub(super) fn distance(&self, index: usize, x: &Vector<D>) -> (f32, Vector<D>) {
        self.list[index].distance_in(self.pose(index), x)
    }

    /// Finds the line along an axis from a node near an obstacle, whose distance and normal are given, up or down.
    ///
    /// It begins outside, or below one face of a concave corner: there another face goes on as a plane, as each of two solids does
    /// where one stands on the other.
    #[inline(always)]
    pub fn line(
        &self,
        index: usize,
        node: ([usize; D], usize),
        (distance, normal): (f32, Vector<D>),
        axis: usize,
        inward: f32,
    ) -> Option<Line<D>> {
        // Most lines end here: without a call.
        let left = distance / self.layout.dx();
        let approach = -normal[axis] * inward;
        let is_far = || !(approach > 0.0 && left / approach <= LINE_CELLS);
        if left > ON_SURFACE && self.list[index].shape.is_convex() && is_far() {
            return None;
        }
        self.line_from(index, node, (distance, normal), axis, inward)
    }

    #[inline(never)]
    fn line_from(
        &self,
        index: usize,
        node: ([usize; D], usize),
        (distance, normal): (f32, Vector<D>),
        axis: usize,
        inward: f32,
    ) -> Option<Line<D>> {
        let dx = self.layout.dx();
        let (node, memory) = node;
        let is_convex = self.list[index].shape.is_convex();
        let (mut start, mut left, mut normal) = (self.layout.position(node), distance / dx, normal);
        let lift = if left > 0.0 {
            Vector::zeros()
        } else {
            if is_convex || left <= -DEEP_CELLS || steepest(&normal) == Some(axis) {
                return None;
            }
            normal * (BESIDE * dx - distance)
        };
        if left <= 0.0 {
            start += lift;
            let (distance, at) = self.distance(index, &start);
            if distance <= 0.0 {
                return None;
            }
            (left, normal) = (distance / dx, at);
        }
        let place = |t: f32| {
            let mut place = start;
            place[axis] += inward * t * dx;
            place
        };
        // A step to the plane at the nearest point passes no surface of a convex solid; one as long as the distance passes none.
        let mut t = 0.0;
        for _ in 0..MOST_STEPS {
            if left <= ON_SURFACE {
                break;
            }
            let approach = if is_convex {
                -normal[axis] * inward
            } else {
                1.0
            };
            t += left / approach;
            if !(approach > 0.0 && t <= LINE_CELLS) {
                return None;
            }
            let (distance, at) = self.distance(index, &place(t));
            left = distance / dx;
            // Inside of an edge the nearest face may be another one.
            if left >= 0.0 {
                normal = at;
            }
        }
        // On the next node, up to rounding, where that does not begin the line itself.
        if t > 2.0 - LINE_CELLS && self.distance(index, &place(1.0)).0 > 0.0 {
            return None;
        }
        let t = t.min(1.0);
        if left > ON_SURFACE || steepest(&normal) != Some(axis) {
            return None;
        }
        let (depth, deep) = self.distance(index, &place(t + self.inset(index)));
        let beside = (0..D).any(|other| other != axis && deep[other].abs() > deep[axis].abs());
        if depth < 0.0 && beside {
            return None;
        }
        self.line_across(index, (node, memory), (t, normal), (axis, inward), lift)
    }

    /// The line from a node that crosses a surface with this normal at `t` [cells]: from `lift` beside the node [m].
    pub fn line_across(
        &self,
        index: usize,
        (node, memory): ([usize; D], usize),
        (t, normal): (f32, Vector<D>),
        (axis, inward): (usize, f32),
        lift: Vector<D>,
    ) -> Option<Line<D>> {
        let dx = self.layout.dx();
        let start = self.layout.position(node) + lift;
        let place = |t: f32| {
            let mut place = start;
            place[axis] += inward * t * dx;
            place
        };
        if self.is_hidden(index, &normal, &place(t - BESIDE), &place(t + BESIDE)) {
            return None;
        }
        // From the point above the node back to the node, along the plane.
        let t = t + lift.dot(&normal) / (normal[axis] * inward * dx);
        let x = place(t) - lift;
        if !(0.0..=LINE_CELLS).contains(&t) {
            return None;
        }
        let xi = node[axis] as f32 + inward * t;
        let base = (xi - 0.5).floor();
        if base < 0.0 || base as usize + 3 > self.layout.extents[axis] {
            return None;
        }
        let mut weights = spline(xi - base);
        if inward > 0.0 {
            weights.reverse();
        }
        let stride = self.layout.stride(axis) as isize;
        let steps = base as isize + 1 - node[axis] as isize;
        let mut touching = touching(
            f64::from((base + 1.0 - xi) * inward),
            f64::from(normal[axis].abs()),
            self.list[index].contact.kind,
            f64::from(dx),
            self.elastic,
        );
        // From a node on the surface, up to rounding, one of the two lines leads outwards, and takes what is inside for outside.
        // What flows may meet it, as the other one holds it besides; an elastic body would be held up to a cell off.
        if normal[axis] * inward > 0.0 {
            touching[1] = Touch::NEVER;
        }
        Some(Line {
            node: memory,
            middle: memory.wrapping_add_signed(steps * stride),
            step: if inward > 0.0 { -stride } else { stride },
            weights,
            touching,
            obstacle: index as u32,
            normal,
            x,
        })
    }

    /// Whether another solid hides the surface of one at a point, given with those a little outside and inside.
    ///
    /// In the corner where one stands on another, both act on the nodes below.
    fn is_hidden(
        &self,
        index: usize,
        normal: &Vector<D>,
        outside: &Vector<D>,
        inside: &Vector<D>,
    ) -> bool {
        let dx = self.layout.dx();
        self.near(outside)
            .filter(|other| *other != index && self.may_contain(*other, outside))
            .any(|other| {
                let (distance, upward) = self.distance(other, outside);
                let faces = || upward.dot(normal) < -0.5;
                let rises = || {
                    let above = inside + upward * (BESIDE * dx - distance);
                    self.distance(index, &above).0 < 0.0
                };
                distance < 0.0 && (distance < -2.0 * dx || faces() || !rises())
            })
    }
}

/// Lowest distance of a node at which a line may begin [m].
pub fn lowest_start<const D: usize>(obstacle: &Obstacle<D>, dx: f32) -> f32 {
    if obstacle.shape.is_convex() {
        0.0
    } else {
        -DEEP_CELLS * dx
    }
}

/// The axis nearest to a normal; of two that are as near, the later one.
fn steepest<const D: usize>(normal: &Vector<D>) -> Option<usize> {
    (0..D).max_by(|a, b| {
        let size = |axis: usize| normal[axis].abs() * (1.0 + 1.0e-3 * axis as f32);
        size(*a).total_cmp(&size(*b))
    })
}

impl<const D: usize> Line<D> {
    /// The same with its impulse at another place [m].
    pub(super) fn at(&self, x: Vector<D>) -> Self {
        Self { x, ..*self }
    }

    /// Memory indices of the outer, middle and inner node, and their weights.
    pub fn nodes(&self) -> ([usize; 3], [f32; 3]) {
        let steps = [-self.step, 0, self.step];
        (
            steps.map(|step| self.middle.wrapping_add_signed(step)),
            self.weights,
        )
    }

    /// What the obstacle, a rigid body, is about to meet; None where nothing touches it. The first three of the nodes, which are
    /// given with their weights, are those of the line.
    pub fn probe<const N: usize>(
        &self,
        (nodes, weights): (&[[f32; 4]; N], &[f32; N]),
        is_elastic: bool,
        solids: &Solids<'_, D>,
        friction: impl Fn(f32) -> f32,
    ) -> Option<Probe<D>> {
        let mass = nodes.map(|node| node[3]);
        let touching = self.touching[usize::from(is_elastic)];
        if mass[1] <= SMALLEST_MASS || !touching.touches(mass[1], mass[2]) {
            return None;
        }
        let (mut total, mut held) = (0.0, 0.0);
        let mut u = Vector::<D>::zeros();
        for k in 0..N {
            let weight = weights[k];
            if mass[k] > SMALLEST_MASS {
                total += weight * weight / mass[k];
                held += weight;
                u += Vector::from_fn(|axis, _| nodes[k][axis] * weight);
            }
        }
        u /= held;
        let surface = (solids.pose(self.obstacle as usize))
            .map_or_else(Vector::zeros, |pose| pose.velocity_at(&self.x));
        let approach = held * (surface - u).dot(&self.normal);
        let is_fast = approach > touching.resting_speed(solids.dt);
        Some(Probe {
            body: self.obstacle,
            x: self.x,
            normal: self.normal,
            u,
            mass: held * held / total,
            closing: if is_fast {
                touching.closing(mass[1], mass[2], solids.dt) / held
            } else {
                0.0
            },
            friction: friction(mass[1]),
        })
    }

    /// Lets the obstacle act on velocities and masses of the nodes, and returns its impulse [kg m/s] and the work that it does
    /// [J]; None where nothing touches it. `friction` returns that of the material from the mass of the middle node.
    pub fn act<const N: usize>(
        &self,
        (nodes, weights): (&mut [[f32; 4]; N], &[f32; N]),
        is_elastic: bool,
        solids: &Solids<'_, D>,
        friction: impl Fn(f32) -> f32,
    ) -> Option<(Vector<D>, f64)> {
        let mut mass = nodes.map(|node| node[3]);
        let touching = self.touching[usize::from(is_elastic)];
        if mass[1] <= SMALLEST_MASS || !touching.touches(mass[1], mass[2]) {
            return None;
        }
        let pose = solids.pose(self.obstacle as usize);
        let surface = pose.map_or_else(Vector::zeros, |pose| pose.velocity_at(&self.x));
        let contact = solids.list[self.obstacle as usize].contact;
        let mut impulse = Vector::<D>::zeros();
        let is_light = mass[0] * weights[1] < mass[1] * weights[0];
        if contact.kind != ContactKind::Separating && is_light && mass[0] > SMALLEST_MASS {
            // An outer node that is lighter than its weight would take most of the change, and material would creep off by a
            // quarter of a cell before it is held. It stays with the surface, as an empty one does.
            let v = Vector::from_fn(|axis, _| nodes[0][axis]);
            let gain = contact.resolve(&(v - surface), &self.normal, 0.0) + surface - v;
            for axis in 0..D {
                nodes[0][axis] += gain[axis];
            }
            impulse = gain * mass[0];
            mass[0] = 0.0;
        }
        let (mut mobility, mut total, mut missing) = ([0.0; N], 0.0, 0.0);
        let mut u = Vector::<D>::zeros();
        for k in 0..N {
            let weight = weights[k];
            if mass[k] > SMALLEST_MASS {
                mobility[k] = weight / mass[k];
                total += mobility[k] * weight;
                u += Vector::from_fn(|axis, _| nodes[k][axis] * weight);
            } else {
                missing += weight;
            }
        }
        // Where a node is empty, the surface moves as it does.
        u += surface * missing;
        let mut relative = u - surface;
        if relative.dot(&self.normal) < -touching.resting_speed(solids.dt) {
            relative += self.normal * touching.closing(mass[1], mass[2], solids.dt);
        }
        let after = contact.resolve(&relative, &self.normal, friction(mass[1]));
        let change = (after - relative) / total;
        for k in 0..N {
            for axis in 0..D {
                let gain = change[axis] * mobility[k];
                nodes[k][axis] += gain;
                impulse[axis] += gain * mass[k];
            }
        }
        Some((impulse, f64::from(impulse.dot(&surface))))
    }
}
