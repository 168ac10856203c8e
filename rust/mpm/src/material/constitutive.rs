//! Interface of constitutive models, and their state in each particle.

use std::fmt::Debug;

use crate::linalg::{Lanes, Symmetrics};

/// What the transfer loops need of a material. What they call is inlined into them, once per material and
/// dimension, and works on a block of particles at a time.
pub trait Constitutive<const D: usize>: Send + Sync {
    /// State of a particle besides position, velocity and affine matrix.
    type State: State;

    /// Whether each body has a velocity field of its own.
    const HAS_OWN_FIELD: bool = false;

    /// The state at a given volume ratio, without shear.
    fn initial_state(&self, volume_ratio: f32) -> Self::State;
    /// tau = J sigma [Pa].
    fn kirchhoff_stress(&self, states: &<Self::State as State>::Block) -> Symmetrics<D>;
    /// Deforms by the velocity gradient `affine[row][column]` [1/s] over `dt` [s], and lets plastic flow happen. Rates
    /// up to `slow` [1/s] are those of matter at rest or in slow flow.
    fn deform(
        &self,
        states: &mut <Self::State as State>::Block,
        affine: &[[Lanes; D]; D],
        dt: f32,
        slow: f32,
    );
    /// Whether `correct_volume` does anything.
    fn corrects_volume(&self) -> bool {
        false
    }
    /// Whether excess density within a single cell counts. Grains do not spread by themselves; water does, and its excess
    /// in single cells is noise.
    fn crowds_within_cells(&self) -> bool {
        false
    }
    /// Pressure per relative loss of volume, of materials that correct their volume [Pa].
    fn bulk_modulus(&self) -> f32 {
        0.0
    }
    /// Volume ratios of the particles of a block.
    fn volumes(&self, states: &<Self::State as State>::Block) -> Volumes;
    /// Corrects the volume ratios of the particles of a block towards the space that they occupy.
    fn correct_volume(
        &self,
        _states: &mut <Self::State as State>::Block,
        _correction: &Correction,
    ) {
    }
    /// J of water, det F of solids [-].
    fn volume_ratios(&self, states: &<Self::State as State>::Block) -> Lanes;
    /// Stored elastic energy per rest volume [Pa].
    fn energy_density(&self, state: &Self::State) -> f32;
}

/// Volume ratios of the particles of a block.
#[derive(Debug, Clone, Copy)]
pub struct Volumes {
    /// Volume over rest volume [-], plastic gains included.
    pub ratio: Lanes,
    /// The pressure [Pa] that belongs to it, negative where matter is apart; 0 for materials that share none.
    pub pressure: Lanes,
}

/// How the volumes of a block are to change.
#[derive(Debug, Clone, Copy)]
pub struct Correction {
    /// Mean pressure of the matter of the same kind around each particle [Pa].
    pub pressure: Lanes,
    /// Part of its deviation from that pressure that each particle loses [-].
    pub sharing: Lanes,
    /// Relative change of volume that is due besides [-].
    pub expansion: Lanes,
}

/// State of one particle, and its layout in a block of particles.
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
