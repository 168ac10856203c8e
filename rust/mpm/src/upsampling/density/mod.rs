//! Corrections of the shown particles by densities on grids: relaxation and drift.

mod deposit;
mod descent;
mod drift;
mod relaxation;

pub use drift::DriftCorrection;
pub use relaxation::Relaxation;
