//! Convex polygons and polyhedra.

use crate::pose::{Matrix3, Vector3};

/// Why points enclose no area or volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HullError;

/// The convex hull of some points.
#[derive(Debug, Clone, PartialEq)]
pub struct Hull {
    /// In the plane in order, anticlockwise.
    pub points: Vec<Vector3>,
    /// In space, three points each, anticlockwise seen from outside; none in the plane.
    pub triangles: Vec<[u32; 3]>,
}

/// The hull of points in the plane.
pub fn polygon(points: &[Vector3]) -> Result<Hull, HullError> {
    // Andrew's monotone chain.
    let mut sorted: Vec<Vector3> = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    sorted.dedup();
    let half = |points: &mut dyn Iterator<Item = Vector3>| {
        let mut chain: Vec<Vector3> = Vec::new();
        for point in points {
            while let [.., a, b] = chain[..] {
                if (b - a).cross(&(point - b)).z > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut sorted.iter().copied());
    hull.extend(half(&mut sorted.iter().rev().copied()));
    let hull = Hull {
        points: hull,
        triangles: Vec::new(),
    };
    if hull.points.len() >= 3 && hull.moments().0 > 0.0 {
        Ok(hull)
    } else {
        Err(HullError)
    }
}

/// The hull of points in space.
pub fn polyhedron(points: &[Vector3]) -> Result<Hull, HullError> {
    let given: Vec<_> = points
        .iter()
        .map(|p| parry3d_f64::math::Vector::new(p.x, p.y, p.z))
        .collect();
    let (points, triangles) =
        parry3d_f64::transformation::try_convex_hull(&given).map_err(|_| HullError)?;
    let hull = Hull {
        points: points.iter().map(|p| Vector3::new(p.x, p.y, p.z)).collect(),
        triangles,
    };
    if hull.moments().0 > 0.0 {
        Ok(hull)
    } else {
        Err(HullError)
    }
}

impl Hull {
    /// Calls back with each part: its measure, its centre, and the sums of x x^T over it about the origin.
    fn parts(&self, mut part: impl FnMut(f64, Vector3, Matrix3)) {
        if self.triangles.is_empty() {
            let next = self.points.iter().cycle().skip(1);
            for (a, b) in self.points.iter().zip(next) {
                let area = 0.5 * a.cross(b).z;
                let second = a * a.transpose() + b * b.transpose() + (a + b) * (a + b).transpose();
                part(area, (a + b) / 3.0, second * (area / 12.0));
            }
        } else {
            for triangle in &self.triangles {
                let [a, b, c] = triangle.map(|index| self.points[index as usize]);
                let volume = a.cross(&b).dot(&c) / 6.0;
                let sum = a + b + c;
                let second = a * a.transpose()
                    + b * b.transpose()
                    + c * c.transpose()
                    + sum * sum.transpose();
                part(volume, sum / 4.0, second * (volume / 20.0));
            }
        }
    }

    /// Area or volume, and the moments of inertia about the origin for a density of one.
    pub fn moments(&self) -> (f64, Matrix3) {
        let (mut measure, mut second) = (0.0, Matrix3::zeros());
        self.parts(|size, _, squares| {
            measure += size;
            second += squares;
        });
        (measure, Matrix3::identity() * second.trace() - second)
    }

    /// Centre of mass [m].
    pub fn center(&self) -> Vector3 {
        let (mut measure, mut sum) = (0.0, Vector3::zeros());
        self.parts(|size, center, _| {
            measure += size;
            sum += center * size;
        });
        sum / measure
    }

    /// The same moved [m].
    #[must_use]
    pub fn moved(&self, by: &Vector3) -> Self {
        Self {
            points: self.points.iter().map(|point| point + by).collect(),
            triangles: self.triangles.clone(),
        }
    }

    /// Diameter of the ball around the origin that fits [m].
    pub fn size(&self) -> f64 {
        let mut smallest = f64::INFINITY;
        if self.triangles.is_empty() {
            let next = self.points.iter().cycle().skip(1);
            for (a, b) in self.points.iter().zip(next) {
                smallest = smallest.min(a.cross(b).z / (b - a).norm());
            }
        } else {
            for triangle in &self.triangles {
                let [a, b, c] = triangle.map(|index| self.points[index as usize]);
                let normal = (b - a).cross(&(c - a)).normalize();
                smallest = smallest.min(normal.dot(&a));
            }
        }
        2.0 * smallest
    }
}
