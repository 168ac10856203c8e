//! `Material`.

use mpm::{Material, MpmError};
use pyo3::prelude::*;

use crate::error::NativeError;

/// Constitutive model and its constants.
#[pyclass(frozen, name = "Material", module = "hybridmpm._native")]
pub struct PyMaterial {
    pub inner: Material,
    kind: &'static str,
}

impl PyMaterial {
    fn new(material: Result<Material, MpmError>, kind: &'static str) -> PyResult<Self> {
        Ok(Self {
            inner: material.map_err(NativeError)?,
            kind,
        })
    }
}

#[pymethods]
impl PyMaterial {
    #[staticmethod]
    #[pyo3(signature = (*, density, bulk_modulus, tension=0.25, wall_friction=0.0, volume_correction=true))]
    fn water(
        density: f32,
        bulk_modulus: f32,
        tension: f32,
        wall_friction: f32,
        volume_correction: bool,
    ) -> PyResult<Self> {
        Self::new(
            Material::water(
                density,
                bulk_modulus,
                tension,
                wall_friction,
                volume_correction,
            ),
            "water",
        )
    }

    #[staticmethod]
    #[pyo3(signature = (*, density, bulk_modulus, viscosity, yield_stress=0.0, flow_index=1.0, tension=0.25, wall_friction=10.0, volume_correction=true))]
    #[expect(clippy::too_many_arguments, reason = "each is a keyword in Python")]
    fn liquid(
        density: f32,
        bulk_modulus: f32,
        viscosity: f32,
        yield_stress: f32,
        flow_index: f32,
        tension: f32,
        wall_friction: f32,
        volume_correction: bool,
    ) -> PyResult<Self> {
        let law = [viscosity, yield_stress, flow_index];
        let material = Material::liquid(
            density,
            bulk_modulus,
            law,
            tension,
            wall_friction,
            volume_correction,
        );
        Self::new(material, "liquid")
    }

    #[staticmethod]
    #[pyo3(signature = (*, density, youngs_modulus, poisson_ratio, friction_angle, wall_friction=0.5, volume_correction=true))]
    fn sand(
        density: f32,
        youngs_modulus: f32,
        poisson_ratio: f32,
        friction_angle: f32,
        wall_friction: f32,
        volume_correction: bool,
    ) -> PyResult<Self> {
        let material = Material::sand(
            density,
            youngs_modulus,
            poisson_ratio,
            friction_angle,
            wall_friction,
            volume_correction,
        );
        Self::new(material, "sand")
    }

    #[staticmethod]
    #[pyo3(signature = (*, density, youngs_modulus, poisson_ratio, wall_friction=0.5))]
    fn elastic(
        density: f32,
        youngs_modulus: f32,
        poisson_ratio: f32,
        wall_friction: f32,
    ) -> PyResult<Self> {
        Self::new(
            Material::elastic(density, youngs_modulus, poisson_ratio, wall_friction),
            "elastic",
        )
    }

    #[getter]
    fn kind(&self) -> &'static str {
        self.kind
    }

    #[getter]
    fn density(&self) -> f32 {
        self.inner.density
    }

    #[getter]
    fn sound_speed(&self) -> f32 {
        self.inner.sound_speed()
    }

    #[getter]
    fn default_cfl(&self) -> f32 {
        self.inner.default_cfl()
    }

    #[getter]
    fn cfl_limit(&self) -> f32 {
        self.inner.cfl_limit()
    }

    fn signal_speed(&self, dim: usize) -> PyResult<f32> {
        if !matches!(dim, 2 | 3) {
            return Err(NativeError(MpmError::parameter("dim", "2 or 3", dim)).into());
        }
        Ok(self.inner.signal_speed(dim))
    }
}
