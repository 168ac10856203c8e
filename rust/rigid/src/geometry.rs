//! Shapes of solids.

use crate::hull::{Hull, HullError, polygon, polyhedron};
use crate::pose::{Matrix3, Vector3};

/// The shape of a solid about its own origin, which is the centre of mass of those that move [m].
#[derive(Debug, Clone, PartialEq)]
pub enum Geometry {
    Ball {
        radius: f64,
    },
    Box {
        half: Vector3,
    },
    /// About the y axis, in space only.
    Cylinder {
        radius: f64,
        half_length: f64,
    },
    /// All within a radius of a segment.
    Capsule {
        start: Vector3,
        end: Vector3,
        radius: f64,
    },
    /// What lies on the other side of a plane than its normal; it does not move.
    HalfSpace {
        normal: Vector3,
    },
    /// A convex polygon or polyhedron.
    Hull(Hull),
    /// What a closed surface encloses; it does not move by itself.
    Surface(Facets),
}

/// The facets of a closed surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Facets {
    pub points: Vec<Vector3>,
    /// In the plane segments, given by two points and the second once more, with the solid on their left; in space triangles that are
    /// seen anticlockwise from outside.
    pub facets: Vec<[u32; 3]>,
}

impl Geometry {
    /// The hull of some points with its centre of mass at the origin, and where that was.
    pub fn hull<const D: usize>(points: &[Vector3]) -> Result<(Self, Vector3), HullError> {
        let hull = if D == 2 {
            polygon(points)?
        } else {
            polyhedron(points)?
        };
        let center = hull.center();
        Ok((Self::Hull(hull.moved(&-center)), center))
    }

    /// Largest distance of a point from the origin [m].
    pub fn reach(&self) -> f64 {
        match self {
            Self::Ball { radius } => *radius,
            Self::Box { half } => half.norm(),
            Self::Cylinder {
                radius,
                half_length,
            } => radius.hypot(*half_length),
            Self::Capsule { start, end, radius } => start.norm().max(end.norm()) + radius,
            Self::HalfSpace { .. } => f64::INFINITY,
            Self::Hull(Hull { points, .. }) | Self::Surface(Facets { points, .. }) => {
                points.iter().map(Vector3::norm).fold(0.0, f64::max)
            }
        }
    }

    /// A length of the smallest features [m].
    pub fn size<const D: usize>(&self) -> f64 {
        match self {
            Self::Ball { radius } | Self::Capsule { radius, .. } => 2.0 * radius,
            Self::Box { half } => 2.0 * half.iter().take(D).copied().fold(f64::INFINITY, f64::min),
            Self::Cylinder {
                radius,
                half_length,
            } => 2.0 * radius.min(*half_length),
            Self::HalfSpace { .. } | Self::Surface(_) => f64::INFINITY,
            Self::Hull(hull) => hull.size(),
        }
    }

    /// Area in the plane [m^2], or volume [m^3], and the moments of inertia about the origin for a density of one.
    pub fn moments<const D: usize>(&self) -> (f64, Matrix3) {
        let pi = std::f64::consts::PI;
        match (self, D) {
            (Self::Ball { radius }, 2) => {
                let area = pi * radius * radius;
                (area, about_z(0.5 * area * radius * radius))
            }
            (Self::Ball { radius }, _) => {
                let volume = 4.0 / 3.0 * pi * radius * radius * radius;
                let inertia = 0.4 * volume * radius * radius;
                (volume, Matrix3::identity() * inertia)
            }
            (Self::Box { half }, 2) => {
                let area = 4.0 * half.x * half.y;
                (
                    area,
                    about_z(area * (half.x * half.x + half.y * half.y) / 3.0),
                )
            }
            (Self::Box { half }, _) => {
                let volume = 8.0 * half.x * half.y * half.z;
                let squares = half.component_mul(half) / 3.0;
                let about = Vector3::new(
                    squares.y + squares.z,
                    squares.z + squares.x,
                    squares.x + squares.y,
                );
                (volume, Matrix3::from_diagonal(&(about * volume)))
            }
            (
                Self::Cylinder {
                    radius,
                    half_length,
                },
                _,
            ) => {
                let volume = 2.0 * pi * radius * radius * half_length;
                let along = 0.5 * radius * radius;
                let across = 0.25 * radius * radius + half_length * half_length / 3.0;
                let about = Vector3::new(across, along, across) * volume;
                (volume, Matrix3::from_diagonal(&about))
            }
            (Self::Hull(hull), 2) => {
                let (area, moments) = hull.moments();
                (area, about_z(moments[(2, 2)]))
            }
            (Self::Hull(hull), _) => hull.moments(),
            (Self::Capsule { .. } | Self::HalfSpace { .. } | Self::Surface(_), _) => {
                (f64::INFINITY, about_z(f64::INFINITY))
            }
        }
    }
}

/// Inertia of plane motion.
pub fn about_z(inertia: f64) -> Matrix3 {
    let mut matrix = Matrix3::zeros();
    matrix[(2, 2)] = inertia;
    matrix
}
