//! Particles in blocks, their order on the grid, and which of them sleep.

mod particle;
mod sleep;
mod sort;

pub use particle::{Activity, Block, Group, Particle, Phase};
pub use sleep::{Disturbance, PERIOD, Sleep, count_calm, decide};
pub use sort::{Place, Slab, sort};
