//! Solids that end on walls go on behind them.
//!
//! Particles inside of a solid are moved to its nearest face. Beside a wall that would be its end, and they would pass along the
//! wall. So a solid has no end on a wall, unless it moves away from there.

use super::contact::Walls;
use super::motion::Motion;
use super::shape::Shape;
use super::surface::Surface;
use crate::linalg::Vector;

/// A face counts as on a wall up to this distance from it [lengths of the world].
const ON_WALL: f32 = 1.0e-6;
/// More than the world [lengths of it].
const FAR: f32 = 2.0;
/// Least cosine between a line and the normal of the wall that it ends on. What lies flatter would reach farther along the wall.
const STEEP: f32 = 0.5;

/// The walls behind which a solid may go on.
pub struct Beyond<'a, const D: usize> {
    walls: &'a Walls<D>,
    motion: Option<Motion<D>>,
    /// Largest distance from a wall of what lies on it, and how far behind it a solid goes on [m].
    on_wall: f32,
    far: f32,
}

impl<'a, const D: usize> Beyond<'a, D> {
    /// For a solid with this motion in a world of this length [m].
    pub fn new(walls: &'a Walls<D>, motion: Option<Motion<D>>, length: f32) -> Self {
        let (on_wall, far) = (ON_WALL * length, FAR * length);
        Self {
            walls,
            motion,
            on_wall,
            far,
        }
    }

    /// A solid other than a surface.
    pub fn convex(&self, shape: &Shape<D>) -> Shape<D> {
        match shape {
            Shape::Box { lower, upper } => Shape::Box {
                lower: Vector::from_fn(|axis, _| self.face(axis, lower[axis], -1.0)),
                upper: Vector::from_fn(|axis, _| self.face(axis, upper[axis], 1.0)),
            },
            Shape::Segment {
                start,
                end,
                thickness,
            } => Shape::Segment {
                start: self.end(end, start, 0.0),
                end: self.end(start, end, 0.0),
                thickness: *thickness,
            },
            Shape::Cylinder { start, end, radius } => Shape::Cylinder {
                start: self.end(end, start, *radius),
                end: self.end(start, end, *radius),
                radius: *radius,
            },
            shape => shape.clone(),
        }
    }

    /// A surface, prepared as `Surface::prepared` does: where it can be between the walls.
    pub fn surface(&self, surface: &Surface<D>, dx: f32, bands: [f32; 2]) -> Surface<D> {
        let or_all = |walls: &Vector<D>, all: f32| {
            Vector::from_fn(|axis, _| if self.stays(axis) { walls[axis] } else { all })
        };
        let between = [
            or_all(&self.walls.lower, f32::NEG_INFINITY),
            or_all(&self.walls.upper, f32::INFINITY),
        ];
        surface
            .through(|axis, x, outward| self.stops(axis, x, outward), self.far)
            .prepared(dx, bands, Some(between))
    }

    fn stays(&self, axis: usize) -> bool {
        self.motion.is_none_or(|motion| motion.keeps(axis))
    }

    /// Whether what lies at this coordinate along an axis, at the end in one direction, stays on the wall there or behind it.
    fn stops(&self, axis: usize, x: f32, outward: f32) -> bool {
        let behind = if outward < 0.0 {
            self.walls.lower[axis] - x
        } else {
            x - self.walls.upper[axis]
        };
        behind >= -self.on_wall && self.stays(axis)
    }

    /// Where a face with this coordinate is put.
    fn face(&self, axis: usize, x: f32, outward: f32) -> f32 {
        if self.stops(axis, x, outward) {
            x + outward * self.far
        } else {
            x
        }
    }

    /// Where the end of a line from a point to another one is put, if all of a disc about it with this radius is on a wall.
    fn end(&self, from: &Vector<D>, to: &Vector<D>, radius: f32) -> Vector<D> {
        let along = (to - from).normalize();
        let leaves = |axis: usize| {
            let cosine = along[axis];
            let inmost =
                to[axis] - cosine.signum() * radius * (1.0 - cosine * cosine).max(0.0).sqrt();
            cosine.abs() >= STEEP && self.stops(axis, inmost, cosine)
        };
        if (0..D).any(leaves) {
            to + along * self.far
        } else {
            *to
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::contact::{Contact, ContactKind};
    use super::*;

    const WALL: f32 = 0.1;

    /// Whether each end of a solid about this line goes on behind walls around [0.1, 0.9]^3.
    fn goes_on(line: [[f32; 3]; 2], radius: Option<f32>, motion: Option<Motion<3>>) -> [bool; 2] {
        let contact = Contact {
            kind: ContactKind::Separating,
            friction: None,
        };
        let (lower, upper) = (Vector::repeat(WALL), Vector::repeat(1.0 - WALL));
        let walls = Walls::uniform(lower, upper, contact);
        let [start, end] = line.map(Vector::from);
        let shape = match radius {
            Some(radius) => Shape::Cylinder { start, end, radius },
            None => Shape::Segment {
                start,
                end,
                thickness: 0.05,
            },
        };
        match Beyond::new(&walls, motion, 1.0).convex(&shape) {
            Shape::Segment {
                start: from,
                end: to,
                ..
            }
            | Shape::Cylinder {
                start: from,
                end: to,
                ..
            } => [from != start, to != end],
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn lines_go_on_behind_walls_that_they_end_on() {
        let (post, ramp) = (
            [[0.5, 0.1, 0.5], [0.5, 0.4, 0.5]],
            [[0.3, 0.4, 0.5], [0.9, 0.2, 0.5]],
        );
        assert_eq!(goes_on(post, Some(0.05), None), [true, false]);
        assert_eq!(goes_on(ramp, None, None), [false, true]);
        // A part of the disc at its end is between the walls.
        assert_eq!(goes_on(ramp, Some(0.05), None), [false; 2]);
        let flat = [[0.3, 0.12, 0.5], [0.6, 0.1, 0.5]];
        assert_eq!(goes_on(flat, None, None), [false; 2]);
        for (velocity, spin, stays) in [
            ([0.1, 0.0, 0.1], [0.0, 2.0, 0.0], true),
            ([0.0, 0.1, 0.0], [0.0; 3], false),
            ([0.0; 3], [1.0, 0.0, 0.0], false),
        ] {
            let motion = Motion::new(Vector::from(velocity), &spin, Vector::zeros(), None);
            let ends = goes_on(post, Some(0.05), motion.ok());
            assert_eq!(ends, [stays, false], "{velocity:?} {spin:?}");
        }
    }
}
