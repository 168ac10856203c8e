//! Geometry of solids as signed distances.

use super::surface::Surface;
use crate::error::MpmError;
use crate::linalg::Vector;
use serde::{Deserialize, Serialize};

/// Geometry of a solid [m].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Shape<const D: usize> {
    Ball {
        center: Vector<D>,
        radius: f32,
    },
    Box {
        lower: Vector<D>,
        upper: Vector<D>,
    },
    /// All points within half the thickness of a segment.
    Segment {
        start: Vector<D>,
        end: Vector<D>,
        thickness: f32,
    },
    /// Within a radius of the line between the centres of two flat ends.
    Cylinder {
        start: Vector<D>,
        end: Vector<D>,
        radius: f32,
    },
    /// Solid on the side that the unit normal points away from.
    HalfSpace {
        point: Vector<D>,
        normal: Vector<D>,
    },
    /// What a polygon or a mesh encloses.
    Surface(Surface<D>),
}

impl<const D: usize> Shape<D> {
    /// Refuses numbers that are not finite, radii and thicknesses of no size, and empty boxes.
    pub fn check(&self) -> Result<(), MpmError> {
        let finite = |v: &Vector<D>| v.iter().all(|s| s.is_finite());
        let (sound, name, allowed) = match self {
            Self::Ball { center, radius } => (
                finite(center) && *radius > 0.0 && radius.is_finite(),
                "ball",
                "a finite centre with radius > 0",
            ),
            Self::Box { lower, upper } => (
                finite(lower) && finite(upper) && (0..D).all(|axis| lower[axis] < upper[axis]),
                "box",
                "finite with lower < upper on each axis",
            ),
            Self::Segment {
                start,
                end,
                thickness,
            } => (
                finite(start)
                    && finite(end)
                    && start != end
                    && *thickness > 0.0
                    && thickness.is_finite(),
                "segment",
                "finite with two different ends and thickness > 0",
            ),
            Self::Cylinder { start, end, radius } => (
                finite(start) && finite(end) && start != end && *radius > 0.0 && radius.is_finite(),
                "cylinder",
                "finite with two different ends and radius > 0",
            ),
            Self::HalfSpace { point, normal } => (
                finite(point) && (normal.norm() - 1.0).abs() < 1.0e-4,
                "half_space",
                "a finite point with a unit normal",
            ),
            // Checked when it was made.
            Self::Surface(_) => return Ok(()),
        };
        if sound {
            return Ok(());
        }
        Err(MpmError::parameter(
            format!("obstacle {name}"),
            allowed,
            self,
        ))
    }

    /// Largest distance of a point of the solid from `center`; infinite for a half-space.
    pub fn reach(&self, center: &Vector<D>) -> f32 {
        match self {
            Self::Ball {
                center: own,
                radius,
            } => (own - center).norm() + radius,
            Self::Box { lower, upper } => farthest_corner(lower, upper, center),
            Self::Segment {
                start,
                end,
                thickness,
            } => (start - center).norm().max((end - center).norm()) + 0.5 * thickness,
            Self::Cylinder { start, end, radius } => {
                (start - center).norm().max((end - center).norm()) + radius
            }
            Self::HalfSpace { .. } => f32::INFINITY,
            Self::Surface(surface) => surface.reach(center),
        }
    }

    /// Lowest and highest corner of a box around the solid [m]; infinite for a half-space.
    pub fn bounds(&self) -> [Vector<D>; 2] {
        let (one, other, beyond) = match self {
            Self::Ball { center, radius } => (center, center, *radius),
            Self::Box { lower, upper } => (lower, upper, 0.0),
            Self::Segment {
                start,
                end,
                thickness,
            } => (start, end, 0.5 * thickness),
            Self::Cylinder { start, end, radius } => (start, end, *radius),
            Self::HalfSpace { point, .. } => (point, point, f32::INFINITY),
            Self::Surface(surface) => return surface.bounds(),
        };
        [
            Vector::from_fn(|axis, _| one[axis].min(other[axis]) - beyond),
            Vector::from_fn(|axis, _| one[axis].max(other[axis]) + beyond),
        ]
    }

    /// Whether the plane at the nearest point of the surface leaves all of the solid on one side.
    pub fn is_convex(&self) -> bool {
        !matches!(self, Self::Surface(_))
    }

    /// Signed distance, negative inside, and the unit normal of the nearest surface point.
    pub fn distance(&self, x: &Vector<D>) -> (f32, Vector<D>) {
        match self {
            Self::Ball { center, radius } => distance_to_point(x, center, *radius),
            Self::Segment {
                start,
                end,
                thickness,
            } => {
                let along = end - start;
                let t = ((x - start).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
                distance_to_point(x, &(start + along * t), 0.5 * thickness)
            }
            Self::Cylinder { start, end, radius } => distance_to_cylinder(x, start, end, *radius),
            Self::HalfSpace { point, normal } => ((x - point).dot(normal), *normal),
            Self::Surface(surface) => surface.distance(x),
            Self::Box { lower, upper } => {
                let nearest = Vector::from_fn(|axis, _| x[axis].clamp(lower[axis], upper[axis]));
                let outside = x - nearest;
                let distance = outside.norm();
                if distance > 0.0 {
                    return (distance, outside / distance);
                }
                let (mut depth, mut axis, mut sign) = (f32::NEG_INFINITY, 0, 1.0);
                for a in 0..D {
                    for (face, side) in [(lower[a] - x[a], -1.0), (x[a] - upper[a], 1.0)] {
                        if face > depth {
                            (depth, axis, sign) = (face, a, side);
                        }
                    }
                }
                let mut normal = Vector::zeros();
                normal[axis] = sign;
                (depth, normal)
            }
        }
    }
}

/// Distance from `x` to the corner of a box that is farthest away.
pub fn farthest_corner<const D: usize>(lower: &Vector<D>, upper: &Vector<D>, x: &Vector<D>) -> f32 {
    Vector::<D>::from_fn(|axis, _| {
        (x[axis] - lower[axis])
            .abs()
            .max((x[axis] - upper[axis]).abs())
    })
    .norm()
}

/// Signed distance to a cylinder with flat ends, and the normal of the nearest surface point.
fn distance_to_cylinder<const D: usize>(
    x: &Vector<D>,
    start: &Vector<D>,
    end: &Vector<D>,
    radius: f32,
) -> (f32, Vector<D>) {
    let length = (end - start).norm();
    let along = (end - start) / length;
    let from_middle = x - (start + end) * 0.5;
    let height = from_middle.dot(&along);
    // Past the side and past the nearer end; negative inside.
    let (beside, outward) =
        distance_to_point(&(from_middle - along * height), &Vector::zeros(), radius);
    let beyond = height.abs() - 0.5 * length;
    let cap = if height < 0.0 { -along } else { along };
    if beside > 0.0 && beyond > 0.0 {
        let edge = outward * beside + cap * beyond;
        let distance = edge.norm();
        return (distance, edge / distance);
    }
    if beside > beyond {
        (beside, outward)
    } else {
        (beyond, cap)
    }
}

fn distance_to_point<const D: usize>(
    x: &Vector<D>,
    center: &Vector<D>,
    radius: f32,
) -> (f32, Vector<D>) {
    let away = x - center;
    let distance = away.norm();
    let up = Vector::from_fn(|axis, _| if axis == 1 { 1.0 } else { 0.0 });
    // On the centre itself every direction is as good.
    (
        distance - radius,
        if distance > 0.0 { away / distance } else { up },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_euclidean_outside_and_negative_inside() {
        let (lower, upper) = (Vector::<2>::new(0.2, 0.2), Vector::<2>::new(0.4, 0.5));
        let square = Shape::Box { lower, upper };
        assert!((square.distance(&Vector::<2>::new(0.43, 0.54)).0 - 0.05).abs() < 1e-6);
        let (depth, normal) = square.distance(&Vector::<2>::new(0.39, 0.3));
        assert!((depth + 0.01).abs() < 1e-6 && normal == Vector::<2>::new(1.0, 0.0));
        let (start, end) = (
            Vector::<3>::new(0.2, 0.2, 0.5),
            Vector::<3>::new(0.6, 0.2, 0.5),
        );
        let ramp = Shape::Segment {
            start,
            end,
            thickness: 0.1,
        };
        let (distance, normal) = ramp.distance(&Vector::<3>::new(0.4, 0.3, 0.5));
        assert!((distance - 0.05).abs() < 1e-6 && (normal.y - 1.0).abs() < 1e-6);
        assert!((ramp.distance(&Vector::<3>::new(0.7, 0.2, 0.5)).0 - 0.05).abs() < 1e-6);
        let post = Shape::Cylinder {
            start,
            end,
            radius: 0.1,
        };
        for (x, distance, normal) in [
            ([0.4, 0.35, 0.5], 0.05, [0.0, 1.0, 0.0]),
            ([0.65, 0.22, 0.5], 0.05, [1.0, 0.0, 0.0]),
            ([0.63, 0.34, 0.5], 0.05, [0.6, 0.8, 0.0]),
            ([0.4, 0.2, 0.57], -0.03, [0.0, 0.0, 1.0]),
            ([0.21, 0.2, 0.52], -0.01, [-1.0, 0.0, 0.0]),
        ] {
            let (found, toward) = post.distance(&Vector::<3>::from(x));
            assert!((found - distance).abs() < 1e-6, "{x:?}: {found}");
            assert!((toward - Vector::<3>::from(normal)).norm() < 1e-5, "{x:?}");
        }
    }
}
