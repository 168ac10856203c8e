//! `Diagnostics`, `FrameReport` and `MotionReport`: values read off a solver.

use mpm::{Diagnostics, FrameReport, MotionReport};
use pyo3::prelude::*;

/// Totals over all particles at one instant.
#[pyclass(frozen, name = "Diagnostics", module = "hybridmpm._native")]
pub struct PyDiagnostics(pub Diagnostics);

#[pymethods]
impl PyDiagnostics {
    #[getter]
    fn mass(&self) -> f64 {
        self.0.mass
    }
    #[getter]
    fn momentum(&self) -> Vec<f64> {
        self.0.momentum.clone()
    }
    #[getter]
    fn centroid(&self) -> Vec<f64> {
        self.0.centroid.clone()
    }
    #[getter]
    fn kinetic_energy(&self) -> f64 {
        self.0.kinetic_energy
    }
    #[getter]
    fn potential_energy(&self) -> f64 {
        self.0.potential_energy
    }
    #[getter]
    fn elastic_energy(&self) -> f64 {
        self.0.elastic_energy
    }
    #[getter]
    fn max_speed(&self) -> f64 {
        self.0.max_speed
    }
    #[getter]
    fn min_volume_ratio(&self) -> f64 {
        self.0.min_volume_ratio
    }
    #[getter]
    fn max_volume_ratio(&self) -> f64 {
        self.0.max_volume_ratio
    }
    #[getter]
    fn emitted_mass(&self) -> f64 {
        self.0.emitted_mass
    }
    #[getter]
    fn removed_mass(&self) -> f64 {
        self.0.removed_mass
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}

/// How the last frame was cut into substeps.
#[pyclass(frozen, name = "FrameReport", module = "hybridmpm._native")]
pub struct PyFrameReport(pub FrameReport);

#[pymethods]
impl PyFrameReport {
    #[getter]
    fn substeps(&self) -> u32 {
        self.0.substeps
    }
    #[getter]
    fn smallest_dt(&self) -> f32 {
        self.0.smallest_dt
    }
    #[getter]
    fn bound(&self) -> &'static str {
        self.0.bound.name()
    }
    #[getter]
    fn max_speed(&self) -> f32 {
        self.0.max_speed
    }
    #[getter]
    fn obstacle_work(&self) -> f64 {
        self.0.obstacle_work
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}

/// Report of a prescribed motion.
#[pyclass(frozen, name = "MotionReport", module = "hybridmpm._native")]
pub struct PyMotionReport(pub MotionReport);

#[pymethods]
impl PyMotionReport {
    #[getter]
    fn density(&self) -> f32 {
        self.0.density
    }
    #[getter]
    fn divergence(&self) -> f32 {
        self.0.divergence
    }
    #[getter]
    fn kinetic_energy(&self) -> f64 {
        self.0.kinetic_energy
    }
    #[getter]
    fn potential_energy(&self) -> f64 {
        self.0.potential_energy
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}
