//! Fixed solids: signed distances, contact on grid nodes, and particles kept outside.

use wide::f32x4;

use crate::contact::Contact;
use crate::error::MpmError;
use crate::grid::{Grid, Layout, Span};
use crate::grid_update::SMALLEST_MASS;
use crate::math::{Vector, vector};

/// Geometry of a solid [m].
#[derive(Debug, Clone, Copy, PartialEq)]
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
    /// Solid on the side that the unit normal points away from.
    HalfSpace {
        point: Vector<D>,
        normal: Vector<D>,
    },
}

impl<const D: usize> Shape<D> {
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
            Self::HalfSpace { point, normal } => ((x - point).dot(normal), *normal),
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

/// A fixed solid and its surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Obstacle<const D: usize> {
    pub shape: Shape<D>,
    pub contact: Contact,
}

impl<const D: usize> Obstacle<D> {
    /// Refuses numbers that are not finite, radii and thicknesses of no size, and empty boxes.
    pub fn new(shape: Shape<D>, contact: Contact) -> Result<Self, MpmError> {
        let finite = |v: &Vector<D>| v.iter().all(|s| s.is_finite());
        let (sound, name, allowed) = match &shape {
            Shape::Ball { center, radius } => (
                finite(center) && *radius > 0.0 && radius.is_finite(),
                "ball",
                "a finite centre with radius > 0",
            ),
            Shape::Box { lower, upper } => (
                finite(lower) && finite(upper) && (0..D).all(|axis| lower[axis] < upper[axis]),
                "box",
                "finite with lower < upper on each axis",
            ),
            Shape::Segment {
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
            Shape::HalfSpace { point, normal } => (
                finite(point) && (normal.norm() - 1.0).abs() < 1.0e-4,
                "half_space",
                "a finite point with a unit normal",
            ),
        };
        if !sound {
            return Err(MpmError::parameter(
                format!("obstacle {name}"),
                allowed,
                shape,
            ));
        }
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
        Ok(Self { shape, contact })
    }
}

/// Nodes this deep inside are reached by no particle.
const BAND_CELLS: f32 = 4.0;

/// A grid node inside an obstacle.
#[derive(Debug, Clone, Copy)]
struct SolidNode<const D: usize> {
    /// Position in its row.
    column: u32,
    obstacle: u32,
    normal: Vector<D>,
}

/// All obstacles of a scene, prepared for one grid.
#[derive(Debug, Clone)]
pub struct Obstacles<const D: usize> {
    pub list: Vec<Obstacle<D>>,
    nodes: Vec<SolidNode<D>>,
    /// Nodes of row r are `nodes[row_starts[r]..row_starts[r + 1]]`; empty without obstacles.
    row_starts: Vec<u32>,
    /// Whether a particle whose stencil starts at this node may touch an obstacle.
    near: Vec<bool>,
}

impl<const D: usize> Obstacles<D> {
    pub fn new(list: Vec<Obstacle<D>>, layout: &Layout<D>) -> Self {
        let mut prepared = Self {
            list,
            nodes: Vec::new(),
            row_starts: Vec::new(),
            near: Vec::new(),
        };
        if prepared.list.is_empty() {
            return prepared;
        }
        let dx = layout.dx();
        // From a stencil's base to its particle is at most 1.5 cells on each axis, and the particle is
        // tested after it has moved by up to one more.
        let reach = (1.5 * (D as f32).sqrt() + 1.0) * dx;
        prepared.row_starts.push(0);
        for row in 0..layout.row_count() {
            let mut node = layout.row_coordinates(row);
            for column in 0..layout.extent {
                node[D - 1] = column;
                let x = layout.position(node);
                let mut near = false;
                for (index, obstacle) in prepared.list.iter().enumerate() {
                    let (distance, normal) = obstacle.shape.distance(&x);
                    near |= distance < reach;
                    if distance <= 0.0 && distance > -BAND_CELLS * dx {
                        prepared.nodes.push(SolidNode {
                            column: column as u32,
                            obstacle: index as u32,
                            normal,
                        });
                    }
                }
                prepared.near.push(near);
            }
            prepared.row_starts.push(prepared.nodes.len() as u32);
        }
        prepared
    }

    /// Applies contact to the grid velocities of one active span.
    pub fn apply(&self, grid: &mut Grid<D>, span: Span, material_friction: &MaterialFriction) {
        if self.list.is_empty() {
            return;
        }
        let nodes = self.row_starts[span.row] as usize..self.row_starts[span.row + 1] as usize;
        for node in &self.nodes[nodes] {
            let column = node.column as usize;
            if column < span.lo || column >= span.hi {
                continue;
            }
            let index = span.row * grid.layout.extent + column;
            let lanes = grid.nodes[index].to_array();
            if lanes[3] > SMALLEST_MASS {
                let v = Vector::from_fn(|axis, _| lanes[axis]);
                let friction = material_friction.at(grid, index, lanes[3]);
                let contact = self.list[node.obstacle as usize].contact;
                let v = contact.resolve(&v, &node.normal, friction);
                grid.nodes[index] = with_velocity(lanes, &v);
            }
        }
    }

    /// Whether the particle with this lowest stencil node has to be tested.
    #[inline(always)]
    pub fn near(&self, node: usize) -> bool {
        !self.near.is_empty() && self.near[node]
    }

    /// Moves a particle that got into an obstacle back to its surface.
    #[inline(never)]
    pub fn push_out(&self, x: &mut Vector<D>, v: &mut f32x4, material_friction: f32) {
        for obstacle in &self.list {
            let (distance, normal) = obstacle.shape.distance(x);
            if distance < 0.0 {
                *x -= normal * distance;
                let after = obstacle
                    .contact
                    .resolve(&vector(*v), &normal, material_friction);
                *v = with_velocity(v.to_array(), &after);
            }
        }
    }
}

/// Wall friction of the material at a node: one number, or the mass-weighted mean of several.
#[derive(Debug, Clone, Copy)]
pub enum MaterialFriction {
    Uniform(f32),
    Mixed,
}

impl MaterialFriction {
    #[inline(always)]
    pub fn at<const D: usize>(&self, grid: &Grid<D>, index: usize, mass: f32) -> f32 {
        match self {
            Self::Uniform(friction) => *friction,
            Self::Mixed => grid.friction_mass[index] / mass,
        }
    }
}

/// A node with another velocity and the same mass.
#[inline(always)]
pub fn with_velocity<const D: usize>(mut lanes: [f32; 4], v: &Vector<D>) -> f32x4 {
    lanes[..D].copy_from_slice(v.as_slice());
    f32x4::from(lanes)
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
    }
}
