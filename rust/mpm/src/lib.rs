//! MLS-MPM (Hu et al. 2018) for water, viscous liquids, sand and elastic solids in 2D and 3D, on the CPU.
//!
//! A substep clears the grid and runs `p2g`, `grid_update` and `g2p`, each in the file of that name under `substep`. Every
//! 5 ms of simulated time `volume` compares the volumes of particles with the space that they occupy. The dimension D, 2 or
//! 3, is a const generic. This crate opens no file, reads no clock and does not depend on Python.

mod boundary;
mod diagnostics;
mod error;
mod force;
mod grid;
mod initial;
mod linalg;
mod material;
mod measure;
mod openings;
mod particles;
mod rigid;
mod settings;
mod snapshot;
mod solver;
mod start;
mod state;
mod substep;
#[cfg(test)]
mod tests;
mod upsampling;
mod version;
mod volume;

pub use boundary::{Contact, ContactKind, Motion, Obstacle, Placed, Shape, Surface, Swing, Walls};
pub use diagnostics::Diagnostics;
pub use error::MpmError;
pub use force::Force;
pub use initial::Particles;
pub use linalg::{Instructions, Matrix, Vector, products_are_fused};
pub use material::Material;
pub use measure::grid_mass;
pub use openings::{Emitter, EmitterStatus, Openings};
pub use particles::Sleep;
pub use rigid::{MOST_BODIES, Pull, RigidBody, hull};
pub use settings::SolverSettings;
pub use snapshot::SNAPSHOT_VERSION;
pub use solver::{MotionReport, PrescribeOptions, Solver};
pub use start::Start;
pub use substep::{
    Bound, DEFAULT_SPEED_CFL, FrameReport, MAX_SUBSTEPS, Substeps, cfl_substeps, reference_substeps,
};
pub use upsampling::{CoarseParticles, UPSAMPLER_VERSION, Upsampler, UpsamplingConstants};
pub use version::SOLVER_VERSION;
