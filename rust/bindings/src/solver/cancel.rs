//! `CancelFlag`: ends the frame that another thread computes.

use mpm::CancelFlag;
use pyo3::prelude::*;

/// A flag that solvers read in every substep.
#[pyclass(frozen, name = "CancelFlag", module = "hybridmpm._native")]
#[derive(Default)]
pub struct PyCancelFlag(pub CancelFlag);

#[pymethods]
impl PyCancelFlag {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    fn set(&self) {
        self.0.set();
    }

    #[getter]
    fn is_set(&self) -> bool {
        self.0.is_set()
    }
}
