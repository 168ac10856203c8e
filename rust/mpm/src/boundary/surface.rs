//! Surfaces of many facets: outlines of segments in 2D, meshes of triangles in 3D.

use super::lattice::Lattice;
use super::outline::segments_around;
use crate::error::MpmError;
use crate::linalg::Vector;
use parry2d_f64::math::Vector as PlanePoint;
use parry2d_f64::query::PointQueryWithLocation as PlaneQuery;
use parry2d_f64::shape::{Polyline, PolylineFlags, SegmentPointLocation};
use parry3d_f64::math::Vector as SpacePoint;
use parry3d_f64::partitioning::BvhNode;
use parry3d_f64::query::PointQueryWithLocation as SpaceQuery;
use parry3d_f64::shape::{TriMesh, TriMeshFlags, Triangle, TrianglePointLocation};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::Arc;

/// A point this near to the surface has the normal of the nearest facet [m]: its direction from the nearest point is lost.
const ON_SURFACE: f64 = 1.0e-9;
/// More than rounding changes a bound on a distance [-].
const ROUNDING: f64 = 1.0e-6;

/// A closed surface. Copies share it.
#[derive(Clone)]
pub struct Surface<const D: usize> {
    soup: Arc<Soup<D>>,
    /// Lowest and highest corner of a box around it [m].
    bounds: [Vector<D>; 2],
    search: Arc<Search>,
    /// Distances at the corners of a lattice; None before `prepared`.
    lattice: Option<Arc<Lattice<D>>>,
}

/// The facets of a surface.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
struct Soup<const D: usize> {
    vertices: Vec<Vector<D>>,
    /// The solid lies on the left of segments, and below triangles that are seen anticlockwise.
    facets: Vec<[u32; 3]>,
}

/// Searches the facet nearest to a point, as bounding volumes in a tree.
enum Search {
    Outline(Polyline),
    Mesh(Box<TriMesh>),
}

impl<const D: usize> Surface<D> {
    /// What a closed polygon encloses by the even-odd rule; edges that lead there and back count as none.
    pub fn outline(corners: &[Vector<D>]) -> Result<Self, MpmError> {
        let refused = |why| Err(MpmError::parameter("obstacle polygon", why, corners.len()));
        if D != 2 {
            return refused("in 2D; a mesh is its like in 3D");
        }
        if !corners.iter().flatten().all(|s| s.is_finite()) {
            return refused("of finite corners");
        }
        let corners: Vec<_> = corners
            .iter()
            .map(|corner| [corner[0], corner[1]])
            .collect();
        let (places, segments) = segments_around(&corners);
        if segments.len() < 3 {
            return refused("of at least three corners that enclose an area");
        }
        Ok(Self::of(Soup {
            vertices: (places.iter())
                .map(|place| Vector::from_fn(|axis, _| place[axis]))
                .collect(),
            facets: segments.iter().map(|[a, b]| [*a, *b, *b]).collect(),
        }))
    }

    /// What a closed mesh encloses, either way round.
    pub fn mesh(vertices: Vec<Vector<D>>, mut triangles: Vec<[u32; 3]>) -> Result<Self, MpmError> {
        let refused = |why, got| Err(MpmError::parameter("obstacle mesh", why, got));
        if D != 3 {
            return refused("in 3D; a polygon is its like in 2D", D);
        }
        if !vertices.iter().flatten().all(|s| s.is_finite()) {
            return refused("of finite vertices", vertices.len());
        }
        let count = vertices.len();
        if (triangles.iter().flatten()).any(|index| *index as usize >= count) {
            return refused("of indices below the number of vertices", count);
        }
        let corner = |index: u32| space(&vertices[index as usize]);
        let scaled = |[a, b, c]: [u32; 3]| {
            let from = corner(a);
            (corner(b) - from).cross(corner(c) - from)
        };
        triangles.retain(|triangle| scaled(*triangle).length_squared() > 0.0);
        let volume: f64 = (triangles.iter())
            .map(|triangle| scaled(*triangle).dot(corner(triangle[0])))
            .sum();
        if volume < 0.0 {
            for triangle in &mut triangles {
                triangle.swap(1, 2);
            }
        }
        if triangles.len() < 4 || volume == 0.0 {
            return refused("of triangles that enclose a volume", triangles.len());
        }
        Ok(Self::of(Soup {
            vertices,
            facets: triangles,
        }))
    }

    /// `soup` has facets.
    fn of(soup: Soup<D>) -> Self {
        let search = Search::of(&soup);
        let none = [f32::INFINITY, f32::NEG_INFINITY].map(Vector::repeat);
        let around = |[low, high]: [Vector<D>; 2], at: &Vector<D>| [low.inf(at), high.sup(at)];
        Self {
            bounds: soup.vertices.iter().fold(none, around),
            soup: Arc::new(soup),
            search: Arc::new(search),
            lattice: None,
        }
    }

    /// The solid extended by `far` [m] where it ends on walls: facets at whose coordinates along an axis, and in that direction, it
    /// does go so far beyond.
    pub(super) fn through(&self, ends: impl Fn(usize, f32, f32) -> bool, far: f32) -> Self {
        let mut soup = (*self.soup).clone();
        for axis in 0..D {
            for outward in [-1.0, 1.0] {
                soup.extend(axis, outward, |s| ends(axis, s, outward), far);
            }
        }
        if soup.facets == self.soup.facets {
            return self.clone();
        }
        Self::of(soup)
    }

    /// The same surface, with distances found once for a scene with cells `dx` [m], up to so many cells inside and outside. Farther
    /// off, and outside of `between`, bounds on distances do.
    pub(super) fn prepared(
        &self,
        dx: f32,
        bands: [f32; 2],
        between: Option<[Vector<D>; 2]>,
    ) -> Self {
        let exact = |x: &Vector<D>, bound: f32| self.exact(x, bound);
        let lattice = Lattice::new(self.bounds(), between, dx, bands, exact);
        Self {
            lattice: Some(Arc::new(lattice)),
            ..self.clone()
        }
    }

    /// Returns a point where two triangles that have no corner in common cross; None where none do, and in 2D.
    pub fn crossing(&self) -> Option<Vector<D>> {
        let Search::Mesh(mesh) = &*self.search else {
            return None;
        };
        (0..mesh.num_triangles() as u32).find_map(|one| {
            let triangle = mesh.triangle(one);
            let around = BvhNode::leaf(triangle.local_aabb(), 0);
            let near = mesh.bvh().leaves(|node: &BvhNode| node.intersects(&around));
            let mut others = near.filter(|other| *other > one);
            others.find_map(|other| {
                let place = crossing_of(&triangle, &mesh.triangle(other))?.to_array();
                Some(Vector::from_fn(|axis, _| place[axis] as f32))
            })
        })
    }

    /// The corners [m].
    pub fn vertices(&self) -> &[Vector<D>] {
        &self.soup.vertices
    }

    /// Three corners each of the triangles, seen anticlockwise from outside; two of segments, the last one twice.
    pub fn facets(&self) -> &[[u32; 3]] {
        &self.soup.facets
    }

    /// Lowest and highest corner of a box around the surface [m].
    pub fn bounds(&self) -> [Vector<D>; 2] {
        self.bounds
    }

    /// Largest distance of a vertex from `center` [m].
    pub fn reach(&self, center: &Vector<D>) -> f32 {
        let away = |vertex: &Vector<D>| (vertex - center).norm();
        self.soup.vertices.iter().map(away).fold(0.0, f32::max)
    }

    /// Signed distance, negative inside, and the unit normal of the nearest surface point.
    ///
    /// Of a prepared surface far from it, a bound that is nearer to zero.
    pub fn distance(&self, x: &Vector<D>) -> (f32, Vector<D>) {
        self.distance_below(x, f32::INFINITY)
    }

    /// The same, given a bound on its absolute value [m], by which the facets are found sooner.
    pub(super) fn distance_below(&self, x: &Vector<D>, farthest: f32) -> (f32, Vector<D>) {
        let known = |lattice: &Arc<Lattice<D>>| lattice.distance(x);
        match self.lattice.as_ref().map(known) {
            None => self.exact(x, farthest),
            Some(Ok(found)) => found,
            Some(Err(bound)) => self.exact(x, bound),
        }
    }

    /// Whether a point may lie inside; false tells that it does not, without asking the facets.
    pub(super) fn may_contain(&self, x: &Vector<D>) -> bool {
        let lattice = self.lattice.as_ref();
        lattice.is_none_or(|lattice| lattice.may_contain(x))
    }

    /// The same from the facets, given a bound on its absolute value [m].
    fn exact(&self, x: &Vector<D>, bound: f32) -> (f32, Vector<D>) {
        let place = std::array::from_fn(|axis| if axis < D { f64::from(x[axis]) } else { 0.0 });
        let bound = f64::from(bound) * (1.0 + ROUNDING) + ROUNDING;
        let found = self.search.nearest(place, bound);
        let (distance, normal) = found
            .or_else(|| self.search.nearest(place, f64::MAX))
            .unwrap_or((f64::MAX, [0.0, 1.0, 0.0]));
        (
            distance as f32,
            Vector::from_fn(|axis, _| normal[axis] as f32),
        )
    }
}

impl<const D: usize> Soup<D> {
    /// Moves the facets that lie beyond some coordinate along an axis by `far` [m] and joins them with the others.
    fn extend(&mut self, axis: usize, outward: f32, is_beyond: impl Fn(f32) -> bool, far: f32) {
        let beyond = |index: &u32| is_beyond(self.vertices[*index as usize][axis]);
        let (moved, mut facets): (Vec<_>, Vec<_>) =
            (self.facets.iter().copied()).partition(|facet: &[u32; 3]| facet.iter().all(beyond));
        let mut copies = BTreeMap::new();
        for index in moved.iter().flatten() {
            copies.entry(*index).or_insert_with(|| {
                let mut vertex = self.vertices[*index as usize];
                vertex[axis] += outward * far;
                self.vertices.push(vertex);
                self.vertices.len() as u32 - 1
            });
        }
        if D == 2 {
            // Ends that two of them share need no side.
            let (mut starts, mut ends) = (BTreeSet::new(), BTreeSet::new());
            for [a, b, _] in &moved {
                starts.insert(*a);
                ends.insert(*b);
            }
            let joined = |from: u32, to: u32| [from, to, to];
            facets.extend(starts.difference(&ends).map(|a| joined(*a, copies[a])));
            facets.extend(ends.difference(&starts).map(|b| joined(copies[b], *b)));
        } else {
            let edges = |[a, b, c]: &[u32; 3]| [[*a, *b], [*b, *c], [*c, *a]];
            let all: BTreeSet<_> = moved.iter().flat_map(edges).collect();
            for [a, b] in all.iter().filter(|[a, b]| !all.contains(&[*b, *a])) {
                facets.extend([[*a, *b, copies[b]], [*a, copies[b], copies[a]]]);
            }
        }
        facets.extend(moved.iter().map(|facet| facet.map(|index| copies[&index])));
        self.facets = facets;
    }
}

impl Search {
    fn of<const D: usize>(soup: &Soup<D>) -> Self {
        let vertices = soup.vertices.iter();
        if D == 2 {
            let points = vertices.map(|v| PlanePoint::new(f64::from(v[0]), f64::from(v[1])));
            let segments = soup.facets.iter().map(|facet| [facet[0], facet[1]]);
            let (points, segments) = (points.collect(), Some(segments.collect()));
            Self::Outline(Polyline::with_flags(
                points,
                segments,
                PolylineFlags::ORIENTED,
            ))
        } else {
            let points = vertices.map(space).collect();
            let flags = TriMeshFlags::ORIENTED;
            let mesh = TriMesh::with_flags(points, soup.facets.clone(), flags);
            Self::Mesh(Box::new(mesh.expect("a surface has triangles")))
        }
    }

    /// Signed distance, below `bound` in size, and the normal of the nearest point; None if nothing is so near.
    fn nearest(&self, x: [f64; 3], bound: f64) -> Option<(f64, [f64; 3])> {
        let (away, is_inside, on_facet) = match self {
            Self::Outline(line) => {
                let x = PlanePoint::new(x[0], x[1]);
                let (nearest, (facet, location)) =
                    line.project_local_point_and_get_location_with_max_dist(x, false, bound)?;
                let away = x - nearest.point;
                let normal = line
                    .segment_normal_constraints(facet)
                    .map(|around| around.face);
                let on_edge = matches!(location, SegmentPointLocation::OnEdge(_));
                let normal = normal.map(|n| [n.x, n.y, 0.0]);
                let on_facet = normal.filter(|_| on_edge || away.length() < ON_SURFACE);
                ([away.x, away.y, 0.0], nearest.is_inside, on_facet)
            }
            Self::Mesh(mesh) => {
                let x = SpacePoint::new(x[0], x[1], x[2]);
                let (nearest, (facet, location)) =
                    mesh.project_local_point_and_get_location_with_max_dist(x, false, bound)?;
                let away = x - nearest.point;
                let on_face = matches!(location, TrianglePointLocation::OnFace(..));
                let normal = mesh.triangle(facet).normal();
                let on_facet = normal.filter(|_| on_face || away.length() < ON_SURFACE);
                (
                    away.to_array(),
                    nearest.is_inside,
                    on_facet.map(|n| n.to_array()),
                )
            }
        };
        let length = away.iter().map(|s| s * s).sum::<f64>().sqrt();
        let distance = if is_inside { -length } else { length };
        Some((distance, on_facet.unwrap_or(away.map(|s| s / distance))))
    }
}

/// Where an edge of one triangle passes the other one; None where they touch, or have a corner in common.
fn crossing_of(one: &Triangle, other: &Triangle) -> Option<SpacePoint> {
    if (one.vertices().iter()).any(|corner| other.vertices().contains(corner)) {
        return None;
    }
    [(one, other), (other, one)]
        .iter()
        .find_map(|(of, through)| {
            let normal = through.scaled_normal();
            of.edges().iter().find_map(|edge| {
                let heights = [edge.a, edge.b].map(|end| (end - through.a).dot(normal));
                if heights[0] * heights[1] >= 0.0 {
                    return None;
                }
                let place = edge.a + (edge.b - edge.a) * (heights[0] / (heights[0] - heights[1]));
                let within = through
                    .edges()
                    .iter()
                    .all(|side| (side.b - side.a).cross(place - side.a).dot(normal) > 0.0);
                within.then_some(place)
            })
        })
}

fn space<const D: usize>(v: &Vector<D>) -> SpacePoint {
    SpacePoint::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[D - 1]))
}

impl<const D: usize> PartialEq for Surface<D> {
    fn eq(&self, other: &Self) -> bool {
        self.soup == other.soup
    }
}

/// Names the surface by its numbers and a hash of them, since they may be a million.
impl<const D: usize> fmt::Debug for Surface<D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let vertices = self.soup.vertices.iter().flatten();
        let facets = self.soup.facets.iter().flatten();
        let hash = vertices.map(|s| s.to_bits()).chain(facets.copied());
        let hash = hash.fold(0xcbf2_9ce4_8422_2325, |hash: u64, word| {
            (hash ^ u64::from(word)).wrapping_mul(0x0000_0100_0000_01b3)
        });
        let (vertices, facets) = (self.soup.vertices.len(), self.soup.facets.len());
        write!(
            f,
            "Surface({vertices} vertices, {facets} facets, {hash:016x})"
        )
    }
}

impl<const D: usize> Serialize for Surface<D> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.soup.serialize(serializer)
    }
}

impl<'de, const D: usize> Deserialize<'de> for Surface<D> {
    fn deserialize<R: Deserializer<'de>>(deserializer: R) -> Result<Self, R::Error> {
        let soup = Soup::<D>::deserialize(deserializer)?;
        let count = soup.vertices.len();
        let known = |facet: &[u32; 3]| facet.iter().all(|index| (*index as usize) < count);
        if soup.facets.is_empty() || !soup.facets.iter().all(known) {
            return Err(serde::de::Error::custom("a surface without its vertices"));
        }
        Ok(Self::of(soup))
    }
}

#[cfg(test)]
mod tests;
