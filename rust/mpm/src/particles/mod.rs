//! Particles in blocks, their order on the grid, and which of them sleep.

mod block;
mod group;
mod particle;
mod slabs;
mod sleep;
mod sort;
mod tiles;

pub use block::Block;
pub(crate) use group::with_group;
pub use group::{Group, Phase};
pub use particle::{Activity, Particle};
pub use slabs::Slab;
pub use sleep::{Disturbance, PERIOD, Sleep, count_calm, decide};
pub use sort::sort;
