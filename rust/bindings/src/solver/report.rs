//! `Diagnostics`, `FrameReport` and `MotionReport`: values read off a solver.

use mpm::{Diagnostics, FrameReport, MotionReport};
use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::convert::read_only;
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
pub struct PyFrameReport {
    pub inner: FrameReport,
    /// Numbers of a row of forces: 3 in 2D, 6 in 3D.
    pub width: usize,
}

#[pymethods]
impl PyFrameReport {
    #[new]
    fn new(
        substeps: u32,
        smallest_dt: f32,
        bound: &str,
        obstacle_work: f64,
        max_speed: f32,
        forces: Vec<Vec<f64>>,
    ) -> PyResult<Self> {
        let bound = mpm::Bound::named(bound)
            .ok_or_else(|| config_error(format!("bound must be one of a report, got {bound:?}")))?;
        let width = forces.first().map_or(3, Vec::len);
        if !matches!(width, 3 | 6) || forces.iter().any(|row| row.len() != width) {
            let message = "forces must have rows of 3 numbers in 2D, or 6 in 3D";
            return Err(config_error(message));
        }
        let inner = FrameReport {
            substeps,
            smallest_dt,
            bound,
            obstacle_work,
            max_speed,
            forces: forces.concat(),
        };
        Ok(Self { inner, width })
    }

    /// Arguments of `new`, by which copies and pickles are made.
    fn __getnewargs__(&self) -> (u32, f32, &'static str, f64, f32, Vec<Vec<f64>>) {
        (
            self.inner.substeps,
            self.inner.smallest_dt,
            self.inner.bound.name(),
            self.inner.obstacle_work,
            self.inner.max_speed,
            (self.inner.forces.chunks(self.width))
                .map(<[f64]>::to_vec)
                .collect(),
        )
    }

    #[getter]
    fn substeps(&self) -> u32 {
        self.inner.substeps
    }
    #[getter]
    fn smallest_dt(&self) -> f32 {
        self.inner.smallest_dt
    }
    #[getter]
    fn bound(&self) -> &'static str {
        self.inner.bound.name()
    }
    #[getter]
    fn max_speed(&self) -> f32 {
        self.inner.max_speed
    }
    #[getter]
    fn obstacle_work(&self) -> f64 {
        self.inner.obstacle_work
    }

    #[getter]
    fn forces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows = self.inner.forces.len() / self.width;
        let forces = self.inner.forces.clone().into_pyarray(py);
        forces.reshape([rows, self.width]).map(read_only)
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.inner)
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
