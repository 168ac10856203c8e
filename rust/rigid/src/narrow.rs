//! Where two solids touch or nearly do, by parry.

use crate::geometry::{Facets, Geometry};
use crate::pose::{Placed, Vector3};

/// A point where two solids touch, or nearly.
#[derive(Debug, Clone, Copy)]
pub struct Touch {
    /// On the surface of either, in the first one's frame [m].
    pub on: [Vector3; 2],
    /// From the first to the second, in the first one's frame.
    pub normal: Vector3,
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
    Outline(plane::Surface),
    Mesh(space::Surface),
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
            Geometry::Surface(facets) if D == 2 => Self::Outline(plane::Surface::new(facets)),
            Geometry::Surface(facets) => Self::Mesh(space::Surface::new(facets)),
            _ if D == 2 => Self::Plane(plane::convex(geometry)),
            _ => Self::Space(space::convex(geometry)),
        }
    }
}

/// Finds the points at which two solids are nearer than `reach` [m]. `second` is where the second is in the first one's frame.
pub fn touches<const D: usize>(
    [a, b]: [&Solid; 2],
    second: &Placed,
    reach: f64,
    found: &mut Vec<Touch>,
) {
    match (a, b) {
        (Solid::Ball { radius: r }, Solid::Ball { radius: s }) => {
            let normal = direction(&second.x);
            let gap = second.x.norm() - r - s;
            if gap < reach {
                let on = [normal * *r, second.x - normal * *s];
                found.push(Touch {
                    on,
                    normal,
                    gap,
                    features: [0; 2],
                });
            }
        }
        (Solid::HalfSpace { normal }, Solid::Ball { radius }) => {
            let gap = second.x.dot(normal) - radius;
            if gap < reach {
                let on = second.x - normal * *radius;
                found.push(Touch {
                    on: [on - normal * gap, on],
                    normal: *normal,
                    gap,
                    features: [0; 2],
                });
            }
        }
        (Solid::HalfSpace { normal }, Solid::Plane(_) | Solid::Space(_)) => {
            let down = second.turn.inverse() * -normal;
            let mut reached = |own: Vector3, feature: u32| {
                let on = second.apply(&own);
                let gap = on.dot(normal);
                if gap < reach {
                    found.push(Touch {
                        on: [on - normal * gap, on],
                        normal: *normal,
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
                    normal,
                    gap: gap - radius,
                    features: [0; 2],
                });
            }
        }
        (Solid::Outline(a), Solid::Ball { radius }) if D == 2 => {
            a.with_ball(&second.x, *radius, reach, found);
        }
        (Solid::Outline(a), Solid::Plane(b)) if D == 2 => a.with(b, second, reach, found),
        (Solid::Mesh(a), Solid::Ball { radius }) if D == 3 => {
            a.with_ball(&second.x, *radius, reach, found);
        }
        (Solid::Mesh(a), Solid::Space(b)) if D == 3 => a.with(b, second, reach, found),
        (Solid::Plane(a), Solid::Plane(b)) if D == 2 => plane::both(a, b, second, reach, found),
        (Solid::Space(a), Solid::Space(b)) if D == 3 => space::both(a, b, second, reach, found),
        // The first kinds come first in those above.
        (Solid::Ball { .. } | Solid::Plane(_) | Solid::Space(_), Solid::HalfSpace { .. })
        | (Solid::Ball { .. }, Solid::Plane(_) | Solid::Space(_)) => {
            let start = found.len();
            let first = Placed::ORIGIN;
            touches::<D>([b, a], &second.relative(&first), reach, found);
            for touch in &mut found[start..] {
                touch.on = [second.apply(&touch.on[1]), second.apply(&touch.on[0])];
                touch.normal = -(second.turn * touch.normal);
                touch.features.reverse();
            }
        }
        _ => {}
    }
}

/// How far outside of a surface a direction is followed to tell whether it leads away from the nearest point there, as a part of a
/// length of the body; and the least part of the way that is then the distance. Where two facets meet in a ridge or lie in one plane,
/// a body would else stumble over the edge of the one that it leaves.
const AWAY: f64 = 1.0e-3;
const LEAST_AWAY: f64 = 0.999;

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
    ($name:ident, $parry:ident, $hull:path, $facet:ident, $soup:ident, $new_soup:path, [$($axis:ident),*], $rotation:expr, $cylinder:expr) => {
        pub mod $name {
            use super::{AWAY, Facets, Geometry, LEAST_AWAY, Placed, Touch, Vector3};
            use $parry::bounding_volume::Aabb;
            use $parry::math::{Pose, Vector};
            use $parry::partitioning::BvhNode;
            use $parry::query::{PointQuery, PointQueryWithLocation};
            use $parry::query::details::{contact_manifold_cuboid_cuboid, contact_manifold_pfm_pfm};
            use $parry::shape::{$facet, $soup, Cuboid, PackedFeatureId, PolygonalFeature, PolygonalFeatureMap};
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
                /// Largest distance of a point from the origin [m].
                reach: f64,
            }

            /// A closed surface.
            #[derive(Clone)]
            pub struct Surface {
                soup: Arc<$soup>,
                facets: Arc<Vec<$facet>>,
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
                        Arc::new($parry::shape::Segment::new(to(start), to(end)))
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
                    Geometry::Ball { .. } | Geometry::HalfSpace { .. } | Geometry::Surface(_) => {
                        unreachable!("these are no convex shapes of parry")
                    }
                };
                Convex {
                    shape,
                    cuboid,
                    corners,
                    radius: rounded,
                    reach: geometry.reach(),
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

            impl Surface {
                pub fn new(given: &Facets) -> Self {
                    let points: Vec<Vector> = given.points.iter().map(to).collect();
                    let (soup, facets) = $new_soup(points, &given.facets);
                    Self {
                        soup: Arc::new(soup),
                        facets: Arc::new(facets),
                    }
                }

                /// The numbers of the facets near to a ball.
                fn near(&self, center: &Vector3, radius: f64) -> Vec<u32> {
                    let (low, high) = (center.add_scalar(-radius), center.add_scalar(radius));
                    let around = BvhNode::leaf(Aabb::new(to(&low), to(&high)), 0);
                    let leaves = self.soup.bvh().leaves(|node: &BvhNode| node.intersects(&around));
                    let mut found: Vec<u32> = leaves.collect();
                    found.sort_unstable();
                    found
                }

                /// Whether a point of the surface is the nearest one to places on the way from it along a direction.
                fn leads_away(&self, on: &Vector3, normal: &Vector3, size: f64) -> bool {
                    let way = AWAY * size;
                    let place = to(&(on + normal * way));
                    let (found, _) = self.soup.project_local_point_and_get_location(place, false);
                    !found.is_inside && (place - found.point).length() >= LEAST_AWAY * way
                }

                /// Finds the points at which a ball is near.
                pub fn with_ball(&self, center: &Vector3, radius: f64, reach: f64, found: &mut Vec<Touch>) {
                    let (nearest, _) = self.soup.project_local_point_and_get_location(to(center), false);
                    if nearest.is_inside {
                        // Its middle has come in: the nearest place leads out.
                        let on = from(&nearest.point);
                        let normal = super::direction(&(on - center));
                        let gap = -(on - center).norm() - radius;
                        found.push(Touch { on: [on, center - normal * radius], normal, gap, features: [0; 2] });
                        return;
                    }
                    for number in self.near(center, radius + reach) {
                        let facet = &self.facets[number as usize];
                        let on = from(&facet.project_local_point(to(center), false).point);
                        let away = center - on;
                        let (gap, normal) = (away.norm() - radius, super::direction(&away));
                        if gap < reach && self.leads_away(&on, &normal, radius) {
                            found.push(Touch { on: [on, center - normal * radius], normal, gap, features: [number, 0] });
                        }
                    }
                }

                /// Finds the points at which a convex solid is near.
                pub fn with(&self, solid: &Convex, second: &Placed, reach: f64, found: &mut Vec<Touch>) {
                    let pose = pose(second);
                    for number in self.near(&second.x, solid.reach + reach) {
                        let facet = &self.facets[number as usize];
                        let mut manifold = Manifold::new();
                        contact_manifold_pfm_pfm(&pose, facet, 0.0, None, &*solid.shape, solid.radius, None, reach, &mut manifold);
                        let normal = from(&manifold.local_n1);
                        for point in &manifold.points {
                            let on = from(&point.local_p1);
                            if point.dist < reach && self.leads_away(&on, &normal, solid.reach) {
                                found.push(Touch {
                                    on: [on, second.apply(&from(&point.local_p2))],
                                    normal,
                                    gap: point.dist,
                                    features: [number.wrapping_mul(31) ^ point.fid1.0, point.fid2.0],
                                });
                            }
                        }
                    }
                }
            }

            pub fn both(a: &Convex, b: &Convex, second: &Placed, reach: f64, found: &mut Vec<Touch>) {
                let mut manifold = Manifold::new();
                let pose = pose(second);
                match (&a.cuboid, &b.cuboid) {
                    (Some(a), Some(b)) => contact_manifold_cuboid_cuboid(&pose, a, b, reach, &mut manifold),
                    _ => {
                        contact_manifold_pfm_pfm(&pose, &*a.shape, a.radius, None, &*b.shape, b.radius, None, reach, &mut manifold);
                    }
                }
                let normal = from(&manifold.local_n1);
                for point in &manifold.points {
                    if point.dist < reach {
                        found.push(Touch {
                            on: [from(&point.local_p1), second.apply(&from(&point.local_p2))],
                            normal,
                            gap: point.dist,
                            features: [point.fid1.0, point.fid2.0],
                        });
                    }
                }
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

fn plane_surface(
    points: Vec<parry2d_f64::math::Vector>,
    facets: &[[u32; 3]],
) -> (
    parry2d_f64::shape::Polyline,
    Vec<parry2d_f64::shape::Segment>,
) {
    use parry2d_f64::shape::{Polyline, PolylineFlags};
    let segments = facets.iter().map(|facet| [facet[0], facet[1]]).collect();
    let line = Polyline::with_flags(points, Some(segments), PolylineFlags::ORIENTED);
    let segments = line.segments().collect();
    (line, segments)
}

fn space_surface(
    points: Vec<parry3d_f64::math::Vector>,
    facets: &[[u32; 3]],
) -> (
    parry3d_f64::shape::TriMesh,
    Vec<parry3d_f64::shape::Triangle>,
) {
    use parry3d_f64::shape::{TriMesh, TriMeshFlags};
    let mesh = TriMesh::with_flags(points, facets.to_vec(), TriMeshFlags::ORIENTED)
        .expect("a surface has triangles");
    let triangles = mesh.triangles().collect();
    (mesh, triangles)
}

narrow!(
    plane,
    parry2d_f64,
    super::plane_hull,
    Segment,
    Polyline,
    super::plane_surface,
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
    Triangle,
    TriMesh,
    super::space_surface,
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
