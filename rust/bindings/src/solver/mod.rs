//! `Solver`, its reports, and batches of solvers.

mod batch;
mod class;
mod report;

pub use batch::advance_all;
pub use class::PySolver;
pub use report::{PyDiagnostics, PyFrameReport, PyMotionReport};
