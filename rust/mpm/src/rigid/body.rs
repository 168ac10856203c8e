//! A rigid body of a scene.

use rigid::{Body, Facets, Geometry, Hull, Placed, Rotation, Vector3};
use serde::{Deserialize, Serialize};

use super::convert::{double, pose_of, single};
use crate::boundary::{Shape, Surface, Walls};
use crate::error::MpmError;
use crate::linalg::Vector;

/// Most rigid bodies of a scene.
pub const MOST_BODIES: usize = 200;

/// A rigid body at the start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RigidBody<const D: usize> {
    /// A box, a ball or, in 3D, a cylinder, before it is turned; or a surface, whose corners have the body as their convex hull.
    pub shape: Shape<D>,
    /// Turn about the centre: a vector along the axis, of the angle's length [rad]; in 2D the last component alone.
    pub turn: [f32; 3],
    /// [kg/m^3]
    pub density: f32,
    /// Velocity of the centre [m/s].
    pub velocity: Vector<D>,
    /// Angular velocity [rad/s]; in 2D the last component alone.
    pub spin: [f32; 3],
    /// Coulomb coefficient on walls, obstacles and other rigid bodies [-].
    pub friction: f32,
    /// Speed of parting over speed of meeting [-].
    pub restitution: f32,
}

impl<const D: usize> RigidBody<D> {
    /// Refuses values out of range, and bodies whose centre is not between the walls; `number` names it.
    pub(crate) fn check(&self, number: usize, walls: &Walls<D>) -> Result<(), MpmError> {
        self.shape.check()?;
        let refuse = |name: &str, allowed: &'static str, value: &dyn std::fmt::Debug| {
            let name = format!("rigid[{number}].{name}");
            Err(MpmError::parameter(name, allowed, value))
        };
        let is_cylinder = matches!(self.shape, Shape::Cylinder { .. });
        let is_known = match &self.shape {
            Shape::Ball { .. } | Shape::Box { .. } => true,
            Shape::Surface(surface) => hull_of(surface).is_some(),
            _ => false,
        };
        if !(is_known || D == 3 && is_cylinder) {
            let allowed = "a box, a ball, in 3D a cylinder, or a hull that encloses something";
            return refuse("shape", allowed, &self.shape);
        }
        if !walls.contains(&self.center()) {
            let allowed = "with its centre between the walls";
            return refuse("shape", allowed, &self.shape);
        }
        if !(self.density > 0.0 && self.density.is_finite()) {
            return refuse("density", "finite and > 0 kg/m^3", &self.density);
        }
        if !(self.friction >= 0.0 && self.friction.is_finite()) {
            return refuse("friction", "finite and >= 0", &self.friction);
        }
        if !(0.0..=1.0).contains(&self.restitution) {
            return refuse("restitution", "in [0, 1]", &self.restitution);
        }
        let mut numbers = self.velocity.iter().chain(&self.turn).chain(&self.spin);
        let is_plane = |v: &[f32; 3]| D == 3 || v[0] == 0.0 && v[1] == 0.0;
        if !numbers.all(|number| number.is_finite())
            || !is_plane(&self.turn)
            || !is_plane(&self.spin)
        {
            let allowed = "of finite velocity, turn and spin, in 2D about the third axis";
            return refuse(
                "motion",
                allowed,
                &(self.velocity.as_slice(), self.turn, self.spin),
            );
        }
        Ok(())
    }

    /// Centre of mass at the start [m].
    pub fn center(&self) -> Vector<D> {
        match &self.shape {
            Shape::Ball { center, .. } => *center,
            Shape::Surface(surface) => {
                hull_of(surface).map_or_else(Vector::zeros, |(_, center)| single(&center))
            }
            shape => {
                let [lower, upper] = middle_of(shape);
                (lower + upper) * 0.5
            }
        }
    }

    /// The shape about the centre of mass, in the body's own frame.
    pub(super) fn own_shape(&self) -> Shape<D> {
        let center = self.center();
        let up = Vector::from_fn(|axis, _| if axis == 1 { 1.0 } else { 0.0 });
        match &self.shape {
            Shape::Ball { radius, .. } => Shape::Ball {
                center: Vector::zeros(),
                radius: *radius,
            },
            Shape::Box { lower, upper } => Shape::Box {
                lower: lower - center,
                upper: upper - center,
            },
            Shape::Cylinder { start, end, radius } => {
                let half = up * ((end - start).norm() * 0.5);
                Shape::Cylinder {
                    start: -half,
                    end: half,
                    radius: *radius,
                }
            }
            Shape::Surface(surface) => {
                let found = hull_of(surface).and_then(|(hull, _)| surface_of(&hull));
                Shape::Surface(found.expect("others are refused"))
            }
            _ => unreachable!("others are refused"),
        }
    }

    /// The surface of a hull about its centre of mass, in the body's own frame; None of other shapes.
    pub fn surface(&self) -> Option<Surface<D>> {
        match self.own_shape() {
            Shape::Surface(surface) => Some(surface),
            _ => None,
        }
    }

    /// Mass [kg], in 2D per metre of depth.
    pub fn mass(&self) -> f64 {
        self.body().mass.mass
    }

    /// Signed distances of points from it at the start [m].
    pub fn distances(&self, points: impl Iterator<Item = Vector<D>>) -> Vec<f32> {
        let (shape, pose) = (self.own_shape(), pose_of::<D>(&self.moving(), 0.0));
        let distance = |x: Vector<D>| shape.distance(&pose.at_start(&x)).0;
        points.map(distance).collect()
    }

    /// What does not change of it.
    pub(crate) fn body(&self) -> Body {
        let hull = match &self.shape {
            Shape::Surface(surface) => hull_of(surface),
            _ => None,
        };
        let geometry = match &self.own_shape() {
            Shape::Surface(_) => Geometry::Hull(hull.expect("others are refused").0),
            Shape::Ball { radius, .. } => Geometry::Ball {
                radius: f64::from(*radius),
            },
            Shape::Cylinder { end, radius, .. } => Geometry::Cylinder {
                radius: f64::from(*radius),
                half_length: f64::from(end.norm()),
            },
            shape => {
                let [_, upper] = middle_of(shape);
                Geometry::Box {
                    half: double(&upper),
                }
            }
        };
        Body::new::<D>(
            geometry,
            f64::from(self.density),
            f64::from(self.friction),
            f64::from(self.restitution),
        )
    }

    /// Where it is at the start, and its motion.
    pub(crate) fn moving(&self) -> rigid::Moving {
        let vector = |v: &[f32; 3]| Vector3::from_fn(|axis, _| f64::from(v[axis]));
        let lies = match &self.shape {
            Shape::Cylinder { start, end, .. } => rigid::turn_of_y(&double(&(end - start))),
            _ => Rotation::identity(),
        };
        rigid::Moving {
            placed: Placed {
                x: double(&self.center()),
                turn: rigid::turned(&lies, &vector(&self.turn)),
            },
            v: double(&self.velocity),
            w: vector(&self.spin),
            support: rigid::Rates::NONE,
        }
    }
}

/// The convex hull of the corners of a surface about its centre of mass, and where that is; None where it encloses nothing.
fn hull_of<const D: usize>(surface: &Surface<D>) -> Option<(Hull, Vector3)> {
    let corners: Vec<Vector3> = surface.vertices().iter().map(double).collect();
    let hull = if D == 2 {
        rigid::polygon(&corners)
    } else {
        rigid::polyhedron(&corners)
    };
    let hull = hull.ok()?;
    let center = hull.center();
    Some((hull.moved(&-center), center))
}

/// The convex hull of some points as a shape.
pub fn hull<const D: usize>(points: &[Vector<D>]) -> Result<Shape<D>, MpmError> {
    let corners: Vec<Vector3> = points.iter().map(double).collect();
    let hull = if D == 2 {
        rigid::polygon(&corners)
    } else {
        rigid::polyhedron(&corners)
    };
    let surface = hull.ok().and_then(|hull| surface_of(&hull));
    surface.map(Shape::Surface).ok_or_else(|| {
        let allowed = "points that enclose an area or, in 3D, a volume";
        MpmError::parameter("hull", allowed, points.len())
    })
}

/// A hull as the material meets it.
fn surface_of<const D: usize>(hull: &Hull) -> Option<Surface<D>> {
    let corners: Vec<Vector<D>> = hull.points.iter().map(single).collect();
    if D == 2 {
        Surface::outline(&corners).ok()
    } else {
        Surface::mesh(corners, hull.triangles.clone()).ok()
    }
}

/// Two points of a box or cylinder that are opposite each other.
fn middle_of<const D: usize>(shape: &Shape<D>) -> [Vector<D>; 2] {
    match shape {
        Shape::Box { lower, upper } => [*lower, *upper],
        Shape::Segment { start, end, .. } | Shape::Cylinder { start, end, .. } => [*start, *end],
        Shape::Ball { center, .. } => [*center; 2],
        Shape::HalfSpace { point, .. } => [*point; 2],
        Shape::Surface(surface) => surface.bounds(),
    }
}

/// The solid as rigid bodies meet it, about an origin of its own, and where that is.
pub(super) fn solid_of<const D: usize>(shape: &Shape<D>) -> (Geometry, Placed) {
    let [one, other] = middle_of(shape).map(|point| double(&point));
    let middle = (one + other) * 0.5;
    let along = other - one;
    let mut turn = Rotation::identity();
    let geometry = match shape {
        Shape::Ball { radius, .. } => Geometry::Ball {
            radius: f64::from(*radius),
        },
        Shape::Box { .. } => Geometry::Box { half: along * 0.5 },
        Shape::Segment { thickness, .. } => Geometry::Capsule {
            start: along * -0.5,
            end: along * 0.5,
            radius: 0.5 * f64::from(*thickness),
        },
        Shape::Cylinder { radius, .. } => {
            turn = rigid::turn_of_y(&along);
            Geometry::Cylinder {
                radius: f64::from(*radius),
                half_length: 0.5 * along.norm(),
            }
        }
        Shape::HalfSpace { normal, .. } => Geometry::HalfSpace {
            normal: double(normal).normalize(),
        },
        Shape::Surface(surface) => {
            let points = surface.vertices().iter();
            Geometry::Surface(Facets {
                points: points.map(|vertex| double(vertex) - middle).collect(),
                facets: surface.facets().to_vec(),
            })
        }
    };
    (geometry, Placed { x: middle, turn })
}
