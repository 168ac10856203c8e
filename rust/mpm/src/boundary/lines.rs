//! Contact with obstacles at their true surface, as with walls: on each line of nodes that crosses it.
//!
//! Only lines along the axis that is nearest to the normal act, so each part of a surface acts once. See `wall_contact` for
//! the impulse on the three nodes of a line. Nodes alone, inside or out, would put a surface off its place by up to half a
//! cell, and would let material at rest sink.

use super::contact::ContactKind;
use super::node::DEEP_CELLS;
use super::obstacle::Obstacle;
use super::shape::Shape;
use super::solids::Solids;
use super::touch::{Touch, heights, shear, touching};
use crate::grid::{SMALLEST_MASS, spline};
use crate::linalg::Vector;

/// Distance from a surface within which a node begins lines across it [cells].
pub const LINE_CELLS: f32 = 1.01;
/// How far from a surface its two sides are looked at [cells].
pub const BESIDE: f32 = 0.25;
/// Lines this near to the sharp edge of an opening of a few cells are left out. So what flows through n cells has n + 1 columns
/// of nodes wherever the edges lie between them. With one less half as much flows through two cells.
pub const OPENING_INSET: f32 = 0.55;
/// Two faces whose normals have a larger cosine have no edge between them: the surface is round there, or nearly flat.
pub const SMOOTH: f32 = 0.8;
/// Widest opening whose edges are left out [cells], and the step in which its other side is looked for.
const OPENING_CELLS: f32 = 8.0;
/// Of wider ones, up to so many cells, lines this near to the edge are left out [cells]. With lines up to the edge itself the faces
/// count as wider than they are, as lines are a cell apart. Where nothing is opposite that does no harm, and holds water at a corner.
const WIDE_OPENING_CELLS: f32 = 16.0;
const WIDE_INSET: f32 = 0.1;
const OPENING_STEP: f32 = 0.5;
/// Distance that counts as none [cells].
pub const ON_SURFACE: f32 = 1.0e-3;

/// Where a line of nodes crosses a surface.
#[derive(Debug, Clone, Copy)]
pub struct Crossing<const D: usize> {
    /// Distance from the node along the axis [cells].
    pub t: f32,
    pub normal: Vector<D>,
    /// Whether a sharp edge is within `OPENING_INSET`; never of a rigid body.
    pub is_near_edge: bool,
}

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

/// The nodes of a line as one body has them: the outer, middle and inner one, and at edges those of columns beside (see `edge`).
pub struct LineNodes<const N: usize> {
    /// Velocity and, in lane 3, mass; zero where there is none.
    pub values: [[f32; 4]; N],
    /// At the surface.
    pub weights: [f32; N],
    pub is_elastic: bool,
    /// Coulomb coefficient of the material [-].
    pub friction: f32,
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
    /// Speed at which the material may come nearer, for it is not yet at rest there; below 0 that at which it is moved back [m/s].
    pub closing: f32,
    /// Coulomb coefficient of the material [-].
    pub friction: f32,
}

impl<const D: usize> Solids<D> {
    /// The line from a node that crosses a surface: from `lift` beside the node [m]. `elastic` where elastic bodies may touch it.
    pub fn line_across(
        &self,
        (index, elastic): (usize, bool),
        (node, memory): ([usize; D], usize),
        crossing: Crossing<D>,
        (axis, inward): (usize, f32),
        lift: Vector<D>,
    ) -> Option<Line<D>> {
        let dx = self.layout.dx();
        let Crossing { t, normal, .. } = crossing;
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
        if crossing.is_near_edge && self.is_at_opening(index, &normal, (axis, inward), &x) {
            return None;
        }
        let face = node[axis] as f32 + inward * t;
        let xi = face - inward * self.bend(index, &normal, axis) / normal[axis].abs();
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
        let touching = touching(
            f64::from((base + 1.0 - face) * inward),
            f64::from(normal[axis].abs()),
            self.list[index].contact.kind,
            f64::from(dx),
            (elastic, self.is_body(index)),
        );
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

    /// How far out of the round surface of a rigid body a line along an axis holds what flows [cells].
    ///
    /// A line sees the velocity v of its own column, and particles that of the columns beside it, too: to second order they differ
    /// by 1/8 of the derivatives of v across the line. v is tangential all over the surface, and what it gains in area there it
    /// loses along the normal n. So with the curvature 1/R and irrotational flow the line, held at the surface, lets particles move
    /// through it as if it lay deeper, by (3 n_a^2 - 1) / 4R for a ball and 3 (2 n_a^2 - 1) / 8R for a disc.
    fn bend(&self, index: usize, normal: &Vector<D>, axis: usize) -> f32 {
        let dx = self.layout.dx();
        let steepness = normal[axis] * normal[axis];
        let disc =
            |radius: f32, off: f32| 0.375 * dx / radius * (2.0 * steepness - 1.0 + off * off);
        let pose = self.pose(index).filter(|_| self.is_body(index));
        match (&self.list[index].shape, pose) {
            (Shape::Ball { radius, .. }, Some(_)) if D == 2 => disc(*radius, 0.0),
            (Shape::Ball { radius, .. }, Some(_)) => 0.25 * dx / radius * (3.0 * steepness - 1.0),
            (Shape::Cylinder { start, end, radius }, Some(pose)) => {
                let along = pose.turn(&(end - start).normalize());
                if along.dot(normal).abs() < 0.5 {
                    disc(*radius, along[axis])
                } else {
                    0.0
                }
            }
            _ => 0.0,
        }
    }

    /// Whether a line that crosses a face at `x` near its sharp edge lies at an opening, and the next column of nodes holds the face,
    /// for it is farther from any edge.
    fn is_at_opening(
        &self,
        index: usize,
        normal: &Vector<D>,
        (axis, inward): (usize, f32),
        x: &Vector<D>,
    ) -> bool {
        let dx = self.layout.dx();
        let mut inside = *x;
        inside[axis] += inward * OPENING_INSET * dx;
        let (depth, face) = self.distance(index, &inside);
        let others = (0..D).filter(|other| *other != axis);
        let across = others.max_by(|a, b| face[*a].abs().total_cmp(&face[*b].abs()));
        let across = across.expect("at least two axes");
        let step = -face[across].signum() * dx;
        let mut next = inside;
        next[across] += step;
        next[axis] -= step * normal[across] / normal[axis];
        if self.distance(index, &next).0 > depth - ON_SURFACE * dx {
            return false;
        }
        let is_filled = |cells: f32| {
            let there = inside + face * (cells * dx - depth);
            !self.walls.contains(&there)
                || self.near(&there).any(|other| {
                    (self.moves(index) || !self.moves(other))
                        && self.may_contain(other, &there)
                        && self.distance(other, &there).0 < 0.0
                })
        };
        let widest = if depth > -WIDE_INSET * dx {
            WIDE_OPENING_CELLS
        } else {
            OPENING_CELLS
        };
        let steps = (widest / OPENING_STEP) as usize;
        let filled = (0..=steps).find(|step| is_filled(BESIDE + OPENING_STEP * *step as f32));
        filled.is_some_and(|step| step > 0)
    }

    /// Whether another solid hides the surface of one at a point, given with those a little outside and inside.
    ///
    /// In the corner where one stands on another, both act on the nodes below. What moves hides nothing of what is at rest, whose
    /// lines are found once.
    fn is_hidden(
        &self,
        index: usize,
        normal: &Vector<D>,
        outside: &Vector<D>,
        inside: &Vector<D>,
    ) -> bool {
        let dx = self.layout.dx();
        let hides = |other: usize| self.moves(index) || !self.moves(other);
        self.near(outside)
            .filter(|other| *other != index && hides(*other))
            .filter(|other| self.may_contain(*other, outside))
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

    /// Whether a body touches the solid here.
    fn touch<const N: usize>(&self, nodes: &LineNodes<N>) -> Option<Touch> {
        let [_, middle, inner] = [0, 1, 2].map(|k| nodes.values[k][3]);
        let touching = self.touching[usize::from(nodes.is_elastic)];
        let touches = middle > SMALLEST_MASS && touching.touches(middle, inner);
        touches.then_some(touching)
    }

    /// What the solid, a rigid body, is about to meet; None where nothing touches it.
    pub fn probe<const N: usize>(
        &self,
        nodes: &LineNodes<N>,
        solids: &Solids<D>,
    ) -> Option<Probe<D>> {
        let touching = self.touch(nodes)?;
        let (mut total, mut held) = (0.0, 0.0);
        let mut u = Vector::<D>::zeros();
        let first = usize::from(touching.is_light(
            [nodes.values[0][3], nodes.values[1][3]],
            [nodes.weights[0], nodes.weights[1]],
        ));
        for (node, weight) in nodes.values.iter().zip(nodes.weights).skip(first) {
            if node[3] > SMALLEST_MASS {
                total += weight * weight / node[3];
                held += weight;
                u += Vector::from_fn(|axis, _| node[axis] * weight);
            }
        }
        u /= held;
        let surface = solids.velocity(self.obstacle as usize, &self.x);
        let approach = held * (surface - u).dot(&self.normal);
        let closing = if approach > touching.resting_speed(solids.dt) {
            touching.closing(nodes.values[1][3], nodes.values[2][3], solids.dt) / held
        } else {
            0.0
        };
        Some(Probe {
            body: self.obstacle,
            x: self.x,
            normal: self.normal,
            u,
            mass: held * held / total,
            closing,
            friction: nodes.friction,
        })
    }

    /// Lets the solid act on the velocities of a body's nodes, and returns its impulse [kg m/s] and the work that it does [J];
    /// None where nothing touches it.
    pub fn act<const N: usize>(
        &self,
        nodes: &mut LineNodes<N>,
        solids: &Solids<D>,
    ) -> Option<(Vector<D>, f64)> {
        let touching = self.touch(nodes)?;
        if solids.list[self.obstacle as usize].contact.kind == ContactKind::Sticky {
            return Some(self.hold(nodes, solids));
        }
        let (values, weights) = (&mut nodes.values, &nodes.weights);
        let mut mass = values.map(|node| node[3]);
        let surface = solids.velocity(self.obstacle as usize, &self.x);
        let contact = solids.list[self.obstacle as usize].contact;
        let mut impulse = Vector::<D>::zeros();
        if mass[0] > SMALLEST_MASS
            && touching.is_light([mass[0], mass[1]], [weights[0], weights[1]])
        {
            // It would take most of the change, and material would creep off by a quarter of a cell before it is held. It stays
            // with the surface, as an empty one does.
            let v = Vector::from_fn(|axis, _| values[0][axis]);
            let gain = contact.resolve(&(v - surface), &self.normal, 0.0) + surface - v;
            for axis in 0..D {
                values[0][axis] += gain[axis];
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
                u += Vector::from_fn(|axis, _| values[k][axis] * weight);
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
        let after = contact.resolve(&relative, &self.normal, nodes.friction);
        let change = (after - relative) / total;
        for k in 0..N {
            for axis in 0..D {
                let gain = change[axis] * mobility[k];
                values[k][axis] += gain;
                impulse[axis] += gain * mass[k];
            }
        }
        Some((impulse, f64::from(impulse.dot(&surface))))
    }

    /// Holds a body at the solid; see `shear`. Rigid bodies, whose edges have more nodes, hold nothing.
    fn hold<const N: usize>(
        &self,
        nodes: &mut LineNodes<N>,
        solids: &Solids<D>,
    ) -> (Vector<D>, f64) {
        let surface = solids.velocity(self.obstacle as usize, &self.x);
        let heights = heights(self.weights);
        let mass = [0, 1, 2].map(|k| nodes.values[k][3]);
        let mut impulse = Vector::<D>::zeros();
        for axis in 0..D {
            let v = [0, 1, 2].map(|k| nodes.values[k][axis] - surface[axis]);
            let after = shear(mass, heights, v);
            for k in 0..3 {
                let gain = after[k] - v[k];
                nodes.values[k][axis] += gain;
                impulse[axis] += gain * mass[k];
            }
        }
        (impulse, f64::from(impulse.dot(&surface)))
    }
}
