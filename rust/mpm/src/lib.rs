//! MLS-MPM (Hu et al. 2018) for water, sand and elastic solids in 2D and 3D, on the CPU.
//!
//! One substep is `clear`, `p2g`, `grid_update`, `g2p`, each in the file of that name. Dimension is a
//! const generic; D is 2 or 3. This crate opens no file, reads no clock and knows no Python.

mod boundary;
mod diagnostics;
mod error;
mod grid;
mod initial;
mod linalg;
mod material;
mod measure;
mod openings;
mod particles;
mod settings;
mod snapshot;
mod solver;
mod state;
mod substep;

pub use boundary::{Contact, ContactKind, Motion, Obstacle, Placed, Shape, Swing, Walls};
pub use diagnostics::Diagnostics;
pub use error::MpmError;
pub use initial::Particles;
pub use linalg::{Matrix, Svd, Vector, svd};
pub use material::Material;
pub use measure::grid_mass;
pub use openings::{Emitter, EmitterStatus, Openings};
pub use particles::Sleep;
pub use settings::Settings;
pub use solver::{Carry, Force, MotionReport, Solver};
pub use substep::{Bound, DEFAULT_SPEED_CFL, FrameReport, Substeps, reference_substeps};
