//! Properties of grid nodes common to obstacles and walls.

use wide::f32x4;

use crate::grid::Layout;
use crate::linalg::Vector;

/// Wall friction of the material at a node: one number, or the mass-weighted mean of several.
#[derive(Debug, Clone, Copy)]
pub enum MaterialFriction {
    Uniform(f32),
    Mixed,
}

impl MaterialFriction {
    /// `friction_mass` are the sums of mass times wall friction at some nodes, of which this is one with its mass.
    #[inline(always)]
    pub fn at(&self, friction_mass: &[f32], node: usize, mass: f32) -> f32 {
        match self {
            Self::Uniform(friction) => *friction,
            Self::Mixed => friction_mass[node] / mass,
        }
    }
}

/// Nodes this deep inside are reached by no particle.
pub(super) const BAND_CELLS: f32 = 4.0;

/// An obstacle acts on nodes that lie this deep inside besides its surface: they belong to no line across it [cells].
pub(super) const DEEP_CELLS: f32 = 1.5;

/// Whether an obstacle acts on a node at a distance that differs by at most `moved` [m] from this, and not only at its surface.
pub(super) fn acts_at<const D: usize>(distance: f32, moved: f32, layout: &Layout<D>) -> bool {
    distance - moved <= -DEEP_CELLS * layout.dx() && distance + moved > -BAND_CELLS * layout.dx()
}

/// How far from the middle node of its stencil a particle is tested: it has moved by up to a cell since. More than the spline
/// of a node reaches.
pub(super) fn stencil_reach<const D: usize>(layout: &Layout<D>) -> f32 {
    (0.5 * (D as f32).sqrt() + 1.0) * layout.dx()
}

/// The same before the next sort: with a cell since the last one, and another before the obstacles moved.
pub(super) fn reach_until_sort<const D: usize>(layout: &Layout<D>) -> f32 {
    stencil_reach(layout) + 2.0 * layout.dx()
}

/// Whether what is at a node may touch an obstacle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Nearness {
    Never,
    /// Before particles are sorted next.
    UntilSort,
    /// In this substep.
    Now,
}

/// Changes the velocity of a node, which has mass, and returns the impulse that did it [kg m/s].
pub(super) fn change_velocity<const D: usize>(
    node: &mut f32x4,
    change: impl Fn(&Vector<D>, f32) -> Vector<D>,
) -> Vector<D> {
    let lanes = node.as_mut_array();
    let (v, mass) = (Vector::from_fn(|axis, _| lanes[axis]), lanes[3]);
    let changed = change(&v, mass);
    lanes[..D].copy_from_slice(changed.as_slice());
    (changed - v) * mass
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
