//! MLS-MPM (Hu et al. 2018) for water, sand and elastic solids in 2D and 3D, on the CPU.
//!
//! One substep is `clear`, `p2g`, `grid_update`, `g2p`, each in the file of that name. Dimension is a
//! const generic; D is 2 or 3. This crate opens no file, reads no clock and knows no Python.

mod contact;
mod diagnostics;
mod emitter;
mod error;
mod g2p;
mod grid;
mod grid_update;
mod input;
mod lanes;
mod material;
mod math;
mod measure;
mod motion;
mod obstacle;
mod p2g;
mod particle;
mod shape;
mod sleep;
mod snapshot;
mod solver;
mod sort;
mod source;
mod spectrum;
mod stencil;
mod svd;
mod swept;
mod timestep;
#[cfg(test)]
mod transfer_tests;
mod wall_fill;
mod walls;

pub use contact::{Contact, ContactKind};
pub use diagnostics::Diagnostics;
pub use emitter::{Emitter, EmitterStatus};
pub use error::MpmError;
pub use input::{Particles, Settings};
pub use material::Material;
pub use math::{Matrix, Vector};
pub use measure::grid_mass;
pub use motion::{Motion, Swing};
pub use obstacle::{Obstacle, Placed};
pub use shape::Shape;
pub use sleep::Sleep;
pub use solver::{Carry, Force, MotionReport, Solver};
pub use svd::{Svd, svd};
pub use timestep::{Bound, DEFAULT_SPEED_CFL, FrameReport, Substeps, reference_substeps};
pub use walls::Walls;
