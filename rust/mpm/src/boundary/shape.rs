//! Geometry of solids as signed distances.

use super::surface::Surface;
use crate::error::MpmError;
use crate::linalg::{LANES, Lanes, Vector};
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

    /// The same for several points, with the same operations.
    #[inline(always)]
    pub fn distances(&self, x: &[Lanes; D]) -> (Lanes, [Lanes; D]) {
        match self {
            Self::Ball { center, radius } => {
                each_distance(x, |x| to_point(sub(x, center), *radius))
            }
            Self::Segment {
                start,
                end,
                thickness,
            } => {
                let along = end - start;
                let squared = along.norm_squared();
                each_distance(x, |x| {
                    let t = (dot(&sub(x, start), &along) / squared).clamp(0.0, 1.0);
                    let nearest = start + along * t;
                    to_point(sub(x, &nearest), 0.5 * thickness)
                })
            }
            Self::Cylinder { start, end, radius } => {
                let length = (end - start).norm();
                let (along, middle) = ((end - start) / length, (start + end) * 0.5);
                each_distance(x, |x| to_cylinder(sub(x, &middle), &along, length, *radius))
            }
            Self::HalfSpace { point, normal } => each_distance(x, |x| {
                let upward = std::array::from_fn(|axis| normal[axis]);
                (dot(&sub(x, point), normal), upward)
            }),
            Self::Box { lower, upper } => each_distance(x, |x| to_box(x, lower, upper)),
            Self::Surface(surface) => each_distance(x, |x| {
                let (distance, normal) = surface.distance(&Vector::from(x));
                (distance, std::array::from_fn(|axis| normal[axis]))
            }),
        }
    }

    /// A number for each of some points, positive only for those outside; most of those by more than `slack` [m], which has to
    /// exceed rounding, have a positive one.
    #[inline(always)]
    pub fn excess(&self, x: &[Lanes; D], slack: f32) -> Lanes {
        match self {
            Self::Ball { center, radius } => each_lane(x, |x| {
                squared(sub(x, center)) - (radius + slack) * (radius + slack)
            }),
            Self::Segment {
                start,
                end,
                thickness,
            } => {
                let (along, radius) = (end - start, 0.5 * thickness + slack);
                let per_length = along / along.norm_squared();
                each_lane(x, |x| {
                    let away = sub(x, start);
                    let t = dot(&away, &per_length).clamp(0.0, 1.0);
                    squared(beside(&away, &along, t)) - radius * radius
                })
            }
            Self::Cylinder { start, end, radius } => {
                let (middle, length) = ((start + end) * 0.5, (end - start).norm());
                let (along, radius) = ((end - start) / length, radius + slack);
                let half = 0.5 * length + slack;
                each_lane(x, |x| {
                    let away = sub(x, &middle);
                    let height = dot(&away, &along);
                    let away = squared(beside(&away, &along, height));
                    (away - radius * radius).max(height.abs() - half)
                })
            }
            Self::HalfSpace { point, normal } => {
                each_lane(x, |x| dot(&sub(x, point), normal) - slack)
            }
            Self::Box { lower, upper } => excess_of_box(x, lower, upper, slack),
            Self::Surface(surface) => {
                let [lower, upper] = surface.bounds();
                excess_of_box(x, &lower, &upper, slack)
            }
        }
    }
}

/// See `Shape::excess`.
#[inline(always)]
fn excess_of_box<const D: usize>(
    x: &[Lanes; D],
    lower: &Vector<D>,
    upper: &Vector<D>,
    slack: f32,
) -> Lanes {
    each_lane(x, |x| {
        let beyond = |axis: usize| (lower[axis] - x[axis]).max(x[axis] - upper[axis]);
        (1..D).fold(beyond(0), |most, axis| most.max(beyond(axis))) - slack
    })
}

/// A number of each point.
#[inline(always)]
fn each_lane<const D: usize>(x: &[Lanes; D], number: impl Fn([f32; D]) -> f32) -> Lanes {
    let mut numbers = [0.0; LANES];
    for i in 0..LANES {
        numbers[i] = number(std::array::from_fn(|axis| x[axis][i]));
    }
    numbers
}

/// Distance and normal of each point.
#[inline(always)]
fn each_distance<const D: usize>(
    x: &[Lanes; D],
    of: impl Fn([f32; D]) -> (f32, [f32; D]),
) -> (Lanes, [Lanes; D]) {
    let (mut distances, mut normals) = ([0.0; LANES], [[0.0; LANES]; D]);
    for i in 0..LANES {
        let (distance, normal) = of(std::array::from_fn(|axis| x[axis][i]));
        distances[i] = distance;
        for axis in 0..D {
            normals[axis][i] = normal[axis];
        }
    }
    (distances, normals)
}

/// One or the other, without a branch.
#[inline(always)]
fn select<const D: usize>(
    first: bool,
    one: (f32, [f32; D]),
    other: (f32, [f32; D]),
) -> (f32, [f32; D]) {
    let choose = |one: f32, other: f32| if first { one } else { other };
    (
        choose(one.0, other.0),
        std::array::from_fn(|axis| choose(one.1[axis], other.1[axis])),
    )
}

/// Distance to the point that lies so far away, less a radius.
#[inline(always)]
fn to_point<const D: usize>(away: [f32; D], radius: f32) -> (f32, [f32; D]) {
    let distance = squared(away).sqrt();
    let up = std::array::from_fn(|axis| if axis == 1 { 1.0 } else { 0.0 });
    // On the centre itself every direction is as good.
    let outward = away.map(|part| part / distance);
    let (_, normal) = select(distance > 0.0, (0.0, outward), (0.0, up));
    (distance - radius, normal)
}

#[inline(always)]
fn to_cylinder<const D: usize>(
    from_middle: [f32; D],
    along: &Vector<D>,
    length: f32,
    radius: f32,
) -> (f32, [f32; D]) {
    let height = dot(&from_middle, along);
    // Past the side and past the nearer end; negative inside.
    let (side, outward) = to_point(beside(&from_middle, along, height), radius);
    let beyond = height.abs() - 0.5 * length;
    let cap = std::array::from_fn(|axis| {
        if height < 0.0 {
            -along[axis]
        } else {
            along[axis]
        }
    });
    let edge = std::array::from_fn(|axis| outward[axis] * side + cap[axis] * beyond);
    let distance = squared(edge).sqrt();
    let at_edge = (distance, edge.map(|part| part / distance));
    let at_face = select(side > beyond, (side, outward), (beyond, cap));
    select((side > 0.0) & (beyond > 0.0), at_edge, at_face)
}

#[inline(always)]
fn to_box<const D: usize>(x: [f32; D], lower: &Vector<D>, upper: &Vector<D>) -> (f32, [f32; D]) {
    let outside = std::array::from_fn(|axis| x[axis] - x[axis].clamp(lower[axis], upper[axis]));
    let distance = squared(outside).sqrt();
    let outer = (distance, outside.map(|part| part / distance));
    let mut inner = (f32::NEG_INFINITY, [0.0; D]);
    for axis in 0..D {
        for (face, side) in [(lower[axis] - x[axis], -1.0), (x[axis] - upper[axis], 1.0)] {
            let normal = std::array::from_fn(|other| if other == axis { side } else { 0.0 });
            inner = select(face > inner.0, (face, normal), inner);
        }
    }
    select(distance > 0.0, outer, inner)
}

#[inline(always)]
fn sub<const D: usize>(x: [f32; D], from: &Vector<D>) -> [f32; D] {
    std::array::from_fn(|axis| x[axis] - from[axis])
}

#[inline(always)]
fn dot<const D: usize>(x: &[f32; D], other: &Vector<D>) -> f32 {
    (1..D).fold(x[0] * other[0], |sum, axis| sum + x[axis] * other[axis])
}

/// The rest of a vector less so many times another one.
#[inline(always)]
fn beside<const D: usize>(x: &[f32; D], other: &Vector<D>, times: f32) -> [f32; D] {
    std::array::from_fn(|axis| x[axis] - other[axis] * times)
}

#[inline(always)]
fn squared<const D: usize>(x: [f32; D]) -> f32 {
    (1..D).fold(x[0] * x[0], |sum, axis| sum + x[axis] * x[axis])
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

    /// Solids of every kind that has an equation.
    fn solids<const D: usize>() -> Vec<Shape<D>> {
        let point = |at: [f32; 3]| Vector::<D>::from_fn(|axis, _| at[axis]);
        let (lower, upper) = (point([0.3, 0.2, 0.4]), point([0.6, 0.45, 0.7]));
        let (start, end) = (point([0.3, 0.3, 0.2]), point([0.6, 0.7, 0.5]));
        vec![
            Shape::Ball {
                center: upper,
                radius: 0.2,
            },
            Shape::Box { lower, upper },
            Shape::Segment {
                start,
                end,
                thickness: 0.02,
            },
            Shape::Cylinder {
                start,
                end,
                radius: 0.01,
            },
            Shape::HalfSpace {
                point: lower,
                normal: (end - start).normalize(),
            },
        ]
    }

    fn check_excess<const D: usize>() {
        let slack = 1.0e-5;
        for (number, shape) in solids::<D>().into_iter().enumerate() {
            let (mut inside, mut seed) = (0, 7_u32);
            let mut random = || {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (seed >> 8) as f32 / (1 << 24) as f32
            };
            for _ in 0..4000 {
                let mut x = [[0.0; LANES]; D];
                x.iter_mut().flatten().for_each(|s| *s = random());
                let excess = shape.excess(&x, slack);
                for i in 0..LANES {
                    let at = Vector::<D>::from_fn(|axis, _| x[axis][i]);
                    let distance = shape.distance(&at).0;
                    inside += usize::from(distance < 0.0);
                    assert!(distance >= 0.0 || excess[i] <= 0.0, "{number} at {at}");
                    assert!(
                        distance < 4.0 * slack || excess[i] > 0.0,
                        "{number} at {at}"
                    );
                }
            }
            assert!(inside > 0, "{number}");
        }
    }

    #[test]
    fn what_lies_outside_by_more_than_the_slack_is_told_from_what_lies_inside() {
        check_excess::<2>();
        check_excess::<3>();
    }
}
