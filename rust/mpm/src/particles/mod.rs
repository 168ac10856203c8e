//! Particles in blocks, their order on the grid, and which of them sleep.

mod block;
mod cut;
mod group;
mod near;
mod particle;
mod places;
mod slabs;
mod sleep;
mod sort;
mod tiles;

pub use block::Block;
pub use cut::{CutGroup, unlocked};
pub(crate) use group::with_group;
pub use group::{EMITTED, Group, MaterialGroup};
pub use near::near_ones;
pub use particle::{Activity, Particle};
pub use slabs::{COLOURS, MAX_SLABS, Slab, bands, fresh_planes};
pub use sleep::{PERIOD, Sleep, WakeCauses, count_calm, decide};
pub use sort::Sorter;
