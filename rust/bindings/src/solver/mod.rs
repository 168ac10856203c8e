//! `Solver`, its reports, batches of solvers, and particles that a solver carries.

mod any;
mod batch;
mod build;
mod cancel;
mod carrier;
mod class;
mod force;
mod held;
mod report;

pub use batch::advance_all;
pub use cancel::PyCancelFlag;
pub use carrier::PyCarrier;
pub use class::PySolver;
pub use report::{PyDiagnostics, PyFrameReport, PyMotionReport};
