//! What a constitutive model computes, and what a particle carries for it.

use std::fmt::Debug;

use crate::linalg::{Lanes, Matrix, Symmetrics};

/// What the transfer loops need of a material. What they call is inlined into them, once per material and
/// dimension, and works on a block of particles at a time.
pub trait Constitutive<const D: usize>: Send + Sync {
    /// What one particle carries besides position, velocity and affine matrix.
    type State: State;

    /// The state at a given volume ratio, without shear.
    fn initial_state(&self, volume_ratio: f32) -> Self::State;
    /// tau = J sigma [Pa].
    fn kirchhoff_stress(&self, states: &<Self::State as State>::Block) -> Symmetrics<D>;
    /// Deforms by the velocity gradient `affine[row][column]` [1/s] over `dt` [s], and lets plastic flow happen.
    ///
    /// `crowding` is the density on the grid over the rest density, 0 where unknown.
    fn deform(
        &self,
        states: &mut <Self::State as State>::Block,
        affine: &[[Lanes; D]; D],
        crowding: &Lanes,
        dt: f32,
    );
    /// Whether `deform` looks at `crowding`.
    fn uses_crowding(&self) -> bool {
        false
    }
    /// J of water, det F of solids [-].
    fn volume_ratio(&self, state: &Self::State) -> f32;
    /// Stored elastic energy per rest volume [Pa].
    fn energy_density(&self, state: &Self::State) -> f32;
}

/// State of one particle, and how a block of particles holds it.
pub trait State: Copy + Send + Sync + Debug + PartialEq {
    /// One array over the lanes for each number.
    type Block: Copy + Send + Sync + Debug;

    /// The same state in all lanes.
    fn splat(self) -> Self::Block;
    fn load(block: &Self::Block, lane: usize) -> Self;
    fn store(self, block: &mut Self::Block, lane: usize);
    /// Plain numbers in a fixed order, for snapshots.
    fn write(&self, put: &mut impl FnMut(f32));
    fn read(take: &mut impl FnMut() -> f32) -> Self;
}

/// I + dt C of one particle.
#[inline(always)]
pub(super) fn increment<const D: usize>(
    affine: &[[Lanes; D]; D],
    lane: usize,
    dt: f32,
) -> Matrix<D> {
    Matrix::from_fn(|row, column| {
        let identity = if row == column { 1.0 } else { 0.0 };
        identity + dt * affine[row][column][lane]
    })
}
