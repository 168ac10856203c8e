//! Where two solids touch or nearly do, by parry.

use crate::geometry::Geometry;
use crate::pose::{Placed, Vector3};

/// A point where two solids touch, or nearly.
#[derive(Debug, Clone, Copy)]
pub struct Touch {
    /// On the surface of either, in the first one's frame [m].
    pub on: [Vector3; 2],
    /// Distance along the normal, negative where they overlap [m].
    pub gap: f64,
    /// Features of both.
    pub features: [u32; 2],
}

/// A shape as parry knows it.
#[derive(Clone)]
pub enum Solid {
    Ball { radius: f64 },
    HalfSpace { normal: Vector3 },
    Plane(plane::Convex),
    Space(space::Convex),
}

impl std::fmt::Debug for Solid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Solid")
    }
}

impl Solid {
    pub fn new<const D: usize>(geometry: &Geometry) -> Self {
        match geometry {
            Geometry::Ball { radius } => Self::Ball { radius: *radius },
            Geometry::HalfSpace { normal } => Self::HalfSpace { normal: *normal },
            _ if D == 2 => Self::Plane(plane::convex(geometry)),
            _ => Self::Space(space::convex(geometry)),
        }
    }
}

/// Finds the points at which two solids are nearer than `reach` [m], and returns the normal from the first to the second, in
/// the first one's frame. `second` is where the second is in that frame.
pub fn touches<const D: usize>(
    [a, b]: [&Solid; 2],
    second: &Placed,
    reach: f64,
    found: &mut Vec<Touch>,
) -> Vector3 {
    match (a, b) {
        (Solid::Ball { radius: r }, Solid::Ball { radius: s }) => {
            let normal = direction(&second.x);
            let gap = second.x.norm() - r - s;
            if gap < reach {
                let on = [normal * *r, second.x - normal * *s];
                found.push(Touch {
                    on,
                    gap,
                    features: [0; 2],
                });
            }
            normal
        }
        (Solid::HalfSpace { normal }, Solid::Ball { radius }) => {
            let gap = second.x.dot(normal) - radius;
            if gap < reach {
                let on = second.x - normal * *radius;
                found.push(Touch {
                    on: [on - normal * gap, on],
                    gap,
                    features: [0; 2],
                });
            }
            *normal
        }
        (Solid::HalfSpace { normal }, Solid::Plane(_) | Solid::Space(_)) => {
            let down = second.turn.inverse() * -normal;
            let mut reached = |own: Vector3, feature: u32| {
                let on = second.apply(&own);
                let gap = on.dot(normal);
                if gap < reach {
                    found.push(Touch {
                        on: [on - normal * gap, on],
                        gap,
                        features: [0, feature],
                    });
                }
            };
            match b {
                Solid::Plane(convex) if D == 2 => plane::lowest(convex, &down, &mut reached),
                Solid::Space(convex) if D == 3 => space::lowest(convex, &down, &mut reached),
                _ => {}
            }
            *normal
        }
        (Solid::Plane(_) | Solid::Space(_), Solid::Ball { radius }) => {
            let (gap, on, normal) = match a {
                Solid::Plane(convex) if D == 2 => plane::nearest(convex, &second.x),
                Solid::Space(convex) if D == 3 => space::nearest(convex, &second.x),
                _ => (f64::INFINITY, Vector3::zeros(), Vector3::y()),
            };
            if gap - radius < reach {
                found.push(Touch {
                    on: [on, second.x - normal * *radius],
                    gap: gap - radius,
                    features: [0; 2],
                });
            }
            normal
        }
        (Solid::Plane(a), Solid::Plane(b)) if D == 2 => plane::both(a, b, second, reach, found),
        (Solid::Space(a), Solid::Space(b)) if D == 3 => space::both(a, b, second, reach, found),
        // The first kinds come first in those above.
        (Solid::Ball { .. } | Solid::Plane(_) | Solid::Space(_), Solid::HalfSpace { .. })
        | (Solid::Ball { .. }, Solid::Plane(_) | Solid::Space(_)) => {
            let start = found.len();
            let first = Placed::ORIGIN;
            let toward = touches::<D>([b, a], &second.relative(&first), reach, found);
            for touch in &mut found[start..] {
                touch.on = [second.apply(&touch.on[1]), second.apply(&touch.on[0])];
                touch.features.reverse();
            }
            -(second.turn * toward)
        }
        _ => Vector3::y(),
    }
}

/// The unit vector towards a point; upwards where there is none.
fn direction(x: &Vector3) -> Vector3 {
    let length = x.norm();
    if length > 0.0 {
        x / length
    } else {
        Vector3::y()
    }
}

macro_rules! narrow {
    ($name:ident, $parry:ident, $hull:path, [$($axis:ident),*], $rotation:expr, $cylinder:expr) => {
        pub mod $name {
            use super::{Geometry, Placed, Touch, Vector3};
            use $parry::math::{Pose, Vector};
            use $parry::query::PointQuery;
            use $parry::query::details::{contact_manifold_cuboid_cuboid, contact_manifold_pfm_pfm};
            use $parry::shape::{Cuboid, PackedFeatureId, PolygonalFeature, PolygonalFeatureMap, Segment};
            use std::sync::Arc;

            type Manifold = $parry::query::ContactManifold<(), ()>;

            /// What parry can ask a shape for.
            trait Shape: PolygonalFeatureMap + PointQuery + Send + Sync {}
            impl<S: PolygonalFeatureMap + PointQuery + Send + Sync> Shape for S {}

            /// A convex shape and the radius by which it is rounded.
            #[derive(Clone)]
            pub struct Convex {
                shape: Arc<dyn Shape>,
                cuboid: Option<Cuboid>,
                /// Corners; none where it has round parts.
                corners: Vec<Vector3>,
                radius: f64,
            }

            fn to(v: &Vector3) -> Vector {
                Vector::new($(v.$axis),*)
            }

            fn from(v: &Vector) -> Vector3 {
                let mut result = Vector3::zeros();
                $(result.$axis = v.$axis;)*
                result
            }

            fn pose(placed: &Placed) -> Pose {
                let turn = $rotation;
                Pose::from_parts(to(&placed.x), turn(placed))
            }

            pub fn convex(geometry: &Geometry) -> Convex {
                let (mut cuboid, mut corners, mut rounded) = (None, Vec::new(), 0.0);
                let shape: Arc<dyn Shape> = match geometry {
                    Geometry::Box { half } => {
                        let shape = Cuboid::new(to(half));
                        cuboid = Some(shape);
                        let sides = |number: usize, axis: usize| if number >> axis & 1 == 0 { -half[axis] } else { half[axis] };
                        let dimensions = [$(stringify!($axis)),*].len();
                        corners = (0..1 << dimensions)
                            .map(|number| Vector3::from_fn(|axis, _| if axis < dimensions { sides(number, axis) } else { 0.0 }))
                            .collect();
                        Arc::new(shape)
                    }
                    Geometry::Capsule { start, end, radius } => {
                        rounded = *radius;
                        Arc::new(Segment::new(to(start), to(end)))
                    }
                    Geometry::Hull(hull) => {
                        corners.clone_from(&hull.points);
                        let points: Vec<Vector> = hull.points.iter().map(to).collect();
                        Arc::new($hull(hull, points))
                    }
                    Geometry::Cylinder { radius, half_length } => {
                        let of_size: fn(f64, f64) -> Option<Arc<dyn Shape>> = $cylinder;
                        of_size(*radius, *half_length).expect("cylinders are in space")
                    }
                    Geometry::Ball { .. } | Geometry::HalfSpace { .. } => unreachable!("these need no parry"),
                };
                Convex {
                    shape,
                    cuboid,
                    corners,
                    radius: rounded,
                }
            }

            /// Calls back with the points that may be lowest, with the number of each.
            pub fn lowest(convex: &Convex, down: &Vector3, reached: &mut impl FnMut(Vector3, u32)) {
                for (number, corner) in (0..).zip(&convex.corners) {
                    reached(*corner, number);
                }
                if convex.corners.is_empty() {
                    let mut feature = PolygonalFeature::default();
                    convex.shape.local_support_feature(to(down), &mut feature);
                    for k in 0..feature.num_vertices {
                        let PackedFeatureId(number) = feature.vids[k];
                        reached(from(&feature.vertices[k]) + down * convex.radius, number);
                    }
                }
            }

            /// Signed distance of a point, the nearest point of the surface, and the normal there.
            pub fn nearest(convex: &Convex, x: &Vector3) -> (f64, Vector3, Vector3) {
                let found = convex.shape.project_local_point(to(x), false);
                let on = from(&found.point);
                let away = if found.is_inside { on - x } else { x - on };
                let normal = super::direction(&away);
                let distance = if found.is_inside { -away.norm() } else { away.norm() };
                (distance - convex.radius, on + normal * convex.radius, normal)
            }

            pub fn both(a: &Convex, b: &Convex, second: &Placed, reach: f64, found: &mut Vec<Touch>) -> Vector3 {
                let mut manifold = Manifold::new();
                let pose = pose(second);
                match (&a.cuboid, &b.cuboid) {
                    (Some(a), Some(b)) => contact_manifold_cuboid_cuboid(&pose, a, b, reach, &mut manifold),
                    _ => {
                        contact_manifold_pfm_pfm(&pose, &*a.shape, a.radius, None, &*b.shape, b.radius, None, reach, &mut manifold);
                    }
                }
                for point in &manifold.points {
                    if point.dist < reach {
                        found.push(Touch {
                            on: [from(&point.local_p1), second.apply(&from(&point.local_p2))],
                            gap: point.dist,
                            features: [point.fid1.0, point.fid2.0],
                        });
                    }
                }
                from(&manifold.local_n1)
            }
        }
    };
}

fn plane_hull(
    _: &crate::hull::Hull,
    points: Vec<parry2d_f64::math::Vector>,
) -> parry2d_f64::shape::ConvexPolygon {
    parry2d_f64::shape::ConvexPolygon::from_convex_polyline_unmodified(points)
        .expect("a hull has at least three corners")
}

fn space_hull(
    hull: &crate::hull::Hull,
    points: Vec<parry3d_f64::math::Vector>,
) -> parry3d_f64::shape::ConvexPolyhedron {
    parry3d_f64::shape::ConvexPolyhedron::from_convex_mesh(points, &hull.triangles)
        .expect("hulls are closed surfaces")
}

narrow!(
    plane,
    parry2d_f64,
    super::plane_hull,
    [x, y],
    |placed: &Placed| {
        let turn = placed.turn.quaternion();
        let (cosine, sine) = (turn.w * turn.w - turn.k * turn.k, 2.0 * turn.w * turn.k);
        parry2d_f64::math::Rotation::from_cos_sin_unchecked(cosine, sine)
    },
    |_, _| None
);
narrow!(
    space,
    parry3d_f64,
    super::space_hull,
    [x, y, z],
    |placed: &Placed| {
        let turn = placed.turn.quaternion();
        parry3d_f64::math::Rotation::from_xyzw(turn.i, turn.j, turn.k, turn.w)
    },
    |radius, half_length| {
        let shape = parry3d_f64::shape::Cylinder::new(half_length, radius);
        Some(Arc::new(shape))
    }
);
