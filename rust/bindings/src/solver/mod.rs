//! `Solver`, its reports, and batches of solvers.

mod any;
mod batch;
mod build;
mod class;
mod force;
mod report;

pub use batch::advance_all;
pub use class::PySolver;
pub use report::{PyDiagnostics, PyFrameReport, PyMotionReport};
