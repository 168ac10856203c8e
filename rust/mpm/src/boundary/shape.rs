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
        let ([distance], normal) = self.distances(&one(x));
        (distance, the_one(&normal))
    }

    /// The same for several points. The bits of each do not depend on their number.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn distances<const N: usize>(&self, x: &[[f32; N]; D]) -> Distances<D, N> {
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
            Self::HalfSpace { point, normal } => {
                let upward = std::array::from_fn(|axis| normal[axis]);
                each_distance(x, |x| (dot(&sub(x, point), normal), upward))
            }
            Self::Box { lower, upper } => each_distance(x, |x| to_box(x, lower, upper)),
            Self::Surface(surface) => each_distance(x, |x| {
                let (distance, normal) = surface.distance(&Vector::from(x));
                (distance, std::array::from_fn(|axis| normal[axis]))
            }),
        }
    }

    /// Whether points may lie inside; false tells that they do not. `slack` is more than rounding changes a place by [m].
    #[inline(always)]
    pub fn may_contain<const N: usize>(&self, x: &[[f32; N]; D], slack: f32) -> [bool; N] {
        match self {
            Self::Box { lower, upper } => are_within(x, [lower, upper], slack),
            // Facets are asked for few points only.
            Self::Surface(surface) => {
                let [lower, upper] = surface.bounds();
                are_within(x, [&lower, &upper], slack)
            }
            convex => convex.distances(x).0.map(|distance| distance < slack),
        }
    }
}

/// Whether points lie in a box that is larger by `slack` all around.
#[inline(always)]
fn are_within<const D: usize, const N: usize>(
    x: &[[f32; N]; D],
    [lower, upper]: [&Vector<D>; 2],
    slack: f32,
) -> [bool; N] {
    let mut within = [true; N];
    for axis in 0..D {
        for i in 0..N {
            let s = x[axis][i];
            within[i] &= (lower[axis] - s <= slack) & (s - upper[axis] <= slack);
        }
    }
    within
}

/// Signed distances of points [m], and by axis the normals.
pub type Distances<const D: usize, const N: usize> = ([f32; N], [[f32; N]; D]);

/// A vector as the only one of several.
pub fn one<const D: usize>(x: &Vector<D>) -> [[f32; 1]; D] {
    std::array::from_fn(|axis| [x[axis]])
}

/// The only one of several vectors.
pub fn the_one<const D: usize>(all: &[[f32; 1]; D]) -> Vector<D> {
    Vector::from_fn(|axis, _| all[axis][0])
}

/// Distance and normal of each point.
#[inline(always)]
fn each_distance<const D: usize, const N: usize>(
    x: &[[f32; N]; D],
    of: impl Fn([f32; D]) -> (f32, [f32; D]),
) -> Distances<D, N> {
    let (mut distances, mut normals) = ([0.0; N], [[0.0; N]; D]);
    for i in 0..N {
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
