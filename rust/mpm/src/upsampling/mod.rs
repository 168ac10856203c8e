//! Upsampling from the coarse particles that are simulated to the particles that are shown.
//!
//! Coarse MPM or a network moves the coarse particles; an `Upsampler` moves all particles of the scene with them. In
//! an update, displacements of the coarse particles are scattered to the nodes of their grid, as P2G scatters momentum,
//! and interpolated to the shown particles, as G2P interpolates velocity (`field`, `interpolation`). Shown particles
//! that have become denser than at rest are then moved apart (`density`), and kept between walls and outside of
//! obstacles. Positions between two updates are computed on demand from the latest update and never stored in the
//! state, so reading them does not change the simulation.
//!
//! An update takes positions, affine matrices and masses of the coarse particles, whatever simulator they come from.

mod block;
mod coarse;
mod density;
mod exchange;
mod field;
mod force;
mod interpolation;
mod snapshot;
mod surfaces;
#[cfg(test)]
mod tests;
mod upsampler;

pub use coarse::CoarseParticles;
pub use snapshot::UPSAMPLER_VERSION;
pub use upsampler::{Upsampler, UpsamplingConstants};
