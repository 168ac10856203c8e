//! The stages of one substep: `p2g`, `grid_update`, `g2p`, and how long it may be.

mod g2p;
mod grid_update;
mod p2g;
mod timestep;
#[cfg(test)]
mod transfer_tests;

pub use g2p::{g2p, gather};
pub use grid_update::{GridForces, grid_update};
pub use p2g::{P2gStep, for_each_row, p2g, scatter_row};
pub use timestep::{
    Bound, DEFAULT_SPEED_CFL, FrameReport, StepChooser, Substeps, reference_substeps,
};
