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
    #[pyo3(signature = (is_set=false))]
    fn new(is_set: bool) -> Self {
        let flag = Self::default();
        if is_set {
            flag.set();
        }
        flag
    }

    /// Arguments of `new`: a copy is a flag of its own, in the same state.
    fn __getnewargs__(&self) -> (bool,) {
        (self.is_set(),)
    }

    fn set(&self) {
        self.0.set();
    }

    #[getter]
    fn is_set(&self) -> bool {
        self.0.is_set()
    }
}
