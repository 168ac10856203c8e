//! One solid, at rest or in prescribed motion.

use super::beyond::Beyond;
use super::contact::{Contact, ContactKind, Walls};
use super::motion::{Motion, Pose};
use super::shape::{Distances, Shape, farthest_corner, one, the_one};
use crate::error::MpmError;
use crate::linalg::{Kernel, Quad, Vector, run_wide};
use serde::{Deserialize, Serialize};

/// Distances that contact needs, inside and outside, of surfaces at rest and of moving ones [cells].
const AT_REST: [f32; 2] = [4.5, 4.0];
const MOVING: [f32; 2] = [7.0, 6.0];
/// A solid: its shape, contact and motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Obstacle<const D: usize> {
    /// The solid at time 0.
    pub shape: Shape<D>,
    pub contact: Contact,
    /// None for a solid at rest.
    pub motion: Option<Motion<D>>,
}

impl<const D: usize> Obstacle<D> {
    /// A solid at rest; an error as in `Shape::check`, or for friction that is not >= 0.
    pub fn new(shape: Shape<D>, contact: Contact) -> Result<Self, MpmError> {
        shape.check()?;
        if contact
            .friction
            .is_some_and(|mu| !(mu >= 0.0 && mu.is_finite()))
        {
            return Err(MpmError::parameter(
                "friction",
                "finite and >= 0",
                contact.friction,
            ));
        }
        Ok(Self {
            shape,
            contact,
            motion: None,
        })
    }

    /// The same solid in motion.
    #[must_use]
    pub fn moving(self, motion: Motion<D>) -> Self {
        Self {
            motion: Some(motion),
            ..self
        }
    }

    /// Returns the solid as it acts in a world of this length [m] with cells `dx` [m]: it goes on behind the walls that it ends on.
    pub(super) fn prepared(self, walls: &Walls<D>, length: f32, dx: f32) -> Self {
        let beyond = Beyond::new(walls, self.motion, length);
        let shape = match &self.shape {
            Shape::Surface(surface) => {
                let bands = if self.motion.is_some() {
                    MOVING
                } else {
                    AT_REST
                };
                Shape::Surface(beyond.surface(surface, dx, bands))
            }
            shape => beyond.convex(shape),
        };
        Self { shape, ..self }
    }

    /// Returns a rigid body, given by its shape about its centre, as it acts where cells are `dx` [m] large: material meets it with
    /// its own friction.
    pub(super) fn of_body(shape: &Shape<D>, dx: f32) -> Self {
        let shape = match shape {
            Shape::Surface(surface) => Shape::Surface(surface.prepared(dx, MOVING, None)),
            shape => shape.clone(),
        };
        let (kind, friction) = (ContactKind::Separating, None);
        Self {
            shape,
            contact: Contact { kind, friction },
            motion: None,
        }
    }

    /// Returns the same solid, prepared for many distances of which those beyond `reach` [m] may be nearer to zero.
    #[must_use]
    pub fn within(&self, reach: f32) -> Self {
        let shape = match &self.shape {
            Shape::Surface(surface) => Shape::Surface(surface.prepared(reach, [1.5; 2], None)),
            shape => shape.clone(),
        };
        Self {
            shape,
            ..self.clone()
        }
    }

    /// The solid as it is at a time [s].
    pub fn at(&self, time: f64) -> Placed<'_, D> {
        let pose = self.motion.map(|motion| motion.pose(time));
        Placed {
            obstacle: self,
            pose,
        }
    }

    /// Signed distance and unit normal in the world.
    pub(super) fn distance_in(&self, pose: Option<&Pose<D>>, x: &Vector<D>) -> (f32, Vector<D>) {
        let ([distance], normal) = self.distances(pose, &one(x));
        (distance, the_one(&normal))
    }

    /// The same for several points. The bits of each do not depend on their number.
    #[inline(always)]
    pub(super) fn distances<const N: usize>(
        &self,
        pose: Option<&Pose<D>>,
        x: &[[f32; N]; D],
    ) -> Distances<D, N> {
        let Some(pose) = pose else {
            return self.shape.distances(x);
        };
        let (distances, normals) = self.shape.distances(&pose.all_at_start(x));
        (distances, pose.turn_all(&normals))
    }

    /// The same, compiled once: at each place that asks, the code for all shapes would fill the cache of instructions.
    pub(super) fn measure<const N: usize>(
        &self,
        pose: Option<&Pose<D>>,
        x: &[[f32; N]; D],
    ) -> Distances<D, N> {
        let obstacle = self;
        run_wide(Measure { obstacle, pose, x })
    }

    /// Whether points may lie inside; see `Shape::may_contain`.
    #[inline(always)]
    pub(super) fn may_contain<const N: usize>(
        &self,
        pose: Option<&Pose<D>>,
        x: &[[f32; N]; D],
        slack: f32,
    ) -> [bool; N] {
        match pose {
            Some(pose) => self.shape.may_contain(&pose.all_at_start(x), slack),
            None => self.shape.may_contain(x, slack),
        }
    }

    /// Signed distance and unit normal in the world of a point inside; None outside.
    pub(super) fn depth_in(
        &self,
        pose: Option<&Pose<D>>,
        x: &Vector<D>,
    ) -> Option<(f32, Vector<D>)> {
        if let Shape::Surface(surface) = &self.shape
            && !surface.may_contain(&pose.map_or(*x, |pose| pose.at_start(x)))
        {
            return None;
        }
        let found = self.distance_in(pose, x);
        (found.0 < 0.0).then_some(found)
    }

    /// Lowest and highest corner of a box around the solid in the world [m]; infinite of one that reaches to infinity.
    pub(super) fn bounds_in(&self, pose: Option<&Pose<D>>) -> [Vector<D>; 2] {
        let [lower, upper] = self.shape.bounds();
        let Some(pose) = pose else {
            return [lower, upper];
        };
        let half = (upper - lower) * 0.5;
        if half.iter().any(|half| !half.is_finite()) {
            return [f32::NEG_INFINITY, f32::INFINITY].map(Vector::repeat);
        }
        let middle = pose.apply(&(lower + half));
        let sides = (0..D).map(|axis| {
            let side = Vector::from_fn(|other, _| if other == axis { half[axis] } else { 0.0 });
            pose.turn(&side).abs()
        });
        let reach: Vector<D> = sides.sum();
        [middle - reach, middle + reach]
    }

    /// Bound on the speed of those points of the solid that can touch material [m/s], in a world up to this corner.
    pub(super) fn speed(&self, pose: &Pose<D>, corner: &Vector<D>) -> f32 {
        let Some(motion) = self.motion else {
            return 0.0;
        };
        let everywhere = farthest_corner(&Vector::zeros(), corner, &pose.center());
        motion.speed(self.shape.reach(&motion.center()).min(everywhere))
    }
}

/// See `Obstacle::measure`.
struct Measure<'a, const D: usize, const N: usize> {
    obstacle: &'a Obstacle<D>,
    pose: Option<&'a Pose<D>>,
    x: &'a [[f32; N]; D],
}

impl<const D: usize, const N: usize> Kernel for Measure<'_, D, N> {
    type Output = Distances<D, N>;

    #[inline(always)]
    fn run<Q: Quad>(self) -> Self::Output {
        self.obstacle.distances(self.pose, self.x)
    }
}

/// An obstacle at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Placed<'a, const D: usize> {
    obstacle: &'a Obstacle<D>,
    pose: Option<Pose<D>>,
}

impl<const D: usize> Placed<'_, D> {
    /// Signed distance of a point from the surface [m], negative inside.
    pub fn distance(&self, x: &Vector<D>) -> f32 {
        self.obstacle.distance_in(self.pose.as_ref(), x).0
    }

    /// The same for points one after the other; of many facets it is quicker where neighbours follow each other.
    pub fn distances(&self, points: impl Iterator<Item = Vector<D>>) -> Vec<f32> {
        let Shape::Surface(surface) = &self.obstacle.shape else {
            return points.map(|x| self.distance(&x)).collect();
        };
        let mut before: Option<(Vector<D>, f32)> = None;
        let at_start = points.map(|x| self.pose.map_or(x, |pose| pose.at_start(&x)));
        let below = at_start.map(|x| {
            // A distance changes by at most the way from point to point.
            let farthest = before.map_or(f32::INFINITY, |(other, distance)| {
                distance.abs() + (x - other).norm()
            });
            let distance = surface.distance_below(&x, farthest).0;
            before = Some((x, distance));
            distance
        });
        below.collect()
    }

    /// Position of the point of the solid that is at `x` at time 0.
    pub fn moved(&self, x: &Vector<D>) -> Vector<D> {
        self.pose.map_or(*x, |pose| pose.apply(x))
    }
}
