//! `PyUpsampler`: what Python's `Upsampler` is made around.

use pyo3::prelude::*;

use super::any::AnyUpsampler;
use super::held::Held;

/// All particles of a scene, moved with coarse particles.
#[pyclass(frozen, name = "Upsampler", module = "hybridmpm._native")]
pub struct PyUpsampler {
    pub(super) held: Held<AnyUpsampler>,
    pub(super) dim: usize,
    pub(super) every: u64,
}

impl PyUpsampler {
    /// A copy of the upsampler.
    pub(super) fn contents(&self, py: Python<'_>) -> PyResult<AnyUpsampler> {
        self.held.detached(py, |any| any.clone())
    }
}
