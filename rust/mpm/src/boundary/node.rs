//! Properties of grid nodes common to obstacles and walls.

use wide::f32x4;

use crate::grid::{Layout, SMALLEST_MASS, Window};
use crate::linalg::Vector;

/// Wall friction of the material at a node: one number, or the mass-weighted mean of several.
#[derive(Debug, Clone, Copy)]
pub enum MaterialFriction {
    Uniform(f32),
    Mixed,
}

impl MaterialFriction {
    #[inline(always)]
    pub fn at<const D: usize>(&self, window: &Window<'_, D>, index: usize, mass: f32) -> f32 {
        match self {
            Self::Uniform(friction) => *friction,
            Self::Mixed => window.friction_mass[index] / mass,
        }
    }
}

/// Nodes this deep inside are reached by no particle.
pub(super) const BAND_CELLS: f32 = 4.0;

/// Whether an obstacle acts on a node at this distance.
pub(super) fn acts_at<const D: usize>(distance: f32, layout: &Layout<D>) -> bool {
    distance <= 0.0 && distance > -BAND_CELLS * layout.dx()
}

/// How far from its stencil's lowest node a particle is tested: it has moved by up to a cell since.
pub(super) fn stencil_reach<const D: usize>(layout: &Layout<D>) -> f32 {
    (1.5 * (D as f32).sqrt() + 1.0) * layout.dx()
}

/// Changes the velocity of a node that has mass, and returns the impulse that did it [kg m/s].
pub(super) fn change_velocity<const D: usize>(
    window: &mut Window<'_, D>,
    index: usize,
    material_friction: &MaterialFriction,
    change: impl Fn(&Vector<D>, f32) -> Vector<D>,
) -> Vector<D> {
    let lanes = window.nodes[index].to_array();
    let mass = lanes[3];
    if mass <= SMALLEST_MASS {
        return Vector::zeros();
    }
    let v = Vector::from_fn(|axis, _| lanes[axis]);
    let changed = change(&v, material_friction.at(window, index, mass));
    window.nodes[index] = with_velocity(lanes, &changed);
    (changed - v) * mass
}

/// A node with another velocity and the same mass.
#[inline(always)]
fn with_velocity<const D: usize>(mut lanes: [f32; 4], v: &Vector<D>) -> f32x4 {
    lanes[..D].copy_from_slice(v.as_slice());
    f32x4::from(lanes)
}

/// Something at grid nodes, ordered by row.
#[derive(Debug, Clone)]
pub struct ByRow<T> {
    pub nodes: Vec<T>,
    /// Row r has `nodes[starts[r]..starts[r + 1]]`; empty where there are no rows.
    starts: Vec<u32>,
}

impl<T> ByRow<T> {
    pub const EMPTY: Self = Self {
        nodes: Vec::new(),
        starts: Vec::new(),
    };

    /// Starts anew, with no row ended.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.starts.clear();
        self.starts.push(0);
    }

    pub fn end_row(&mut self) {
        self.starts.push(self.nodes.len() as u32);
    }

    #[inline(always)]
    pub fn row(&self, row: usize) -> &[T] {
        if self.starts.is_empty() {
            return &[];
        }
        &self.nodes[self.starts[row] as usize..self.starts[row + 1] as usize]
    }
}
