//! `Solver`, its reports, batches of solvers, and `Upsampler`.

mod any;
mod batch;
mod build;
mod class;
mod force;
mod held;
mod report;
mod shown;
mod upsampler;

pub use batch::advance_all;
pub use build::cfl_substeps;
pub use class::PySolver;
pub use report::{PyDiagnostics, PyFrameReport, PyMotionReport};
pub use shown::PyUpsampler;
