//! The stages of one substep: `p2g`, `grid_update`, `g2p`, how threads share them, and how long it may be.

mod g2p;
mod grid_update;
mod meeting;
mod p2g;
mod stages;
mod timestep;
#[cfg(test)]
mod transfer_tests;

pub use g2p::{Outcome, gather};
pub use grid_update::GridForces;
pub use meeting::Meeting;
pub use p2g::{P2gStep, for_each_row, scatter_row};
pub use stages::{Interruption, Stage, Substep};
pub use timestep::{
    Bound, DEFAULT_SPEED_CFL, FrameReport, MAX_SUBSTEPS, StepChooser, Substeps, cfl_substeps,
    reference_substeps,
};
