//! `Diagnostics`, `FrameReport` and `MotionReport`: values read off a solver.

use mpm::{Diagnostics, FrameReport, MotionReport};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::error::config_error;

/// Totals over all particles at one instant.
#[pyclass(frozen, name = "Diagnostics", module = "hybridmpm._native")]
pub struct PyDiagnostics(pub Diagnostics);

#[pymethods]
impl PyDiagnostics {
    #[new]
    #[expect(
        clippy::too_many_arguments,
        reason = "all fields, for copies and pickles"
    )]
    fn new(
        mass: f64,
        momentum: Vec<f64>,
        centroid: Vec<f64>,
        kinetic_energy: f64,
        potential_energy: f64,
        elastic_energy: f64,
        max_speed: f64,
        min_volume_ratio: f64,
        max_volume_ratio: f64,
        emitted_mass: f64,
        removed_mass: f64,
    ) -> Self {
        Self(Diagnostics {
            mass,
            momentum,
            centroid,
            kinetic_energy,
            potential_energy,
            elastic_energy,
            max_speed,
            min_volume_ratio,
            max_volume_ratio,
            emitted_mass,
            removed_mass,
        })
    }

    /// Arguments of `new`, by which copies and pickles are made.
    fn __getnewargs__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let d = &self.0;
        let vectors = (d.momentum.clone(), d.centroid.clone());
        let energies = (d.kinetic_energy, d.potential_energy, d.elastic_energy);
        let extremes = (d.max_speed, d.min_volume_ratio, d.max_volume_ratio);
        let arguments = (
            d.mass,
            vectors.0,
            vectors.1,
            energies.0,
            energies.1,
            energies.2,
            extremes.0,
            extremes.1,
            extremes.2,
            d.emitted_mass,
            d.removed_mass,
        );
        arguments.into_pyobject(py)
    }

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
    #[new]
    fn new(
        substeps: u32,
        smallest_dt: f32,
        bound: &str,
        obstacle_work: f64,
        max_speed: f32,
    ) -> PyResult<Self> {
        let bound = mpm::Bound::named(bound)
            .ok_or_else(|| config_error(format!("bound must be one of a report, got {bound:?}")))?;
        Ok(Self(FrameReport {
            substeps,
            smallest_dt,
            bound,
            obstacle_work,
            max_speed,
        }))
    }

    /// Arguments of `new`, by which copies and pickles are made.
    fn __getnewargs__(&self) -> (u32, f32, &'static str, f64, f32) {
        (
            self.0.substeps,
            self.0.smallest_dt,
            self.0.bound.name(),
            self.0.obstacle_work,
            self.0.max_speed,
        )
    }

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
    #[new]
    fn new(density: f32, divergence: f32, kinetic_energy: f64, potential_energy: f64) -> Self {
        Self(MotionReport {
            density,
            divergence,
            kinetic_energy,
            potential_energy,
        })
    }

    /// Arguments of `new`, by which copies and pickles are made.
    fn __getnewargs__(&self) -> (f32, f32, f64, f64) {
        (
            self.0.density,
            self.0.divergence,
            self.0.kinetic_energy,
            self.0.potential_energy,
        )
    }

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
