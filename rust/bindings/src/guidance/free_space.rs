//! `FreeSpace`: the room between walls and obstacles.

use ::guidance::FreeSpace;
use numpy::{IxDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays::{dim_of, fixed, raised};
use crate::convert::{array, slice_of};

pub enum AnySpace {
    Plane(FreeSpace<2>),
    Space(FreeSpace<3>),
}

/// The room between walls and obstacles.
#[pyclass(frozen, name = "FreeSpace", module = "hybridmpm._native")]
pub struct PyFreeSpace {
    pub inner: AnySpace,
}

#[pymethods]
impl PyFreeSpace {
    #[new]
    fn new(
        py: Python<'_>,
        lower: Vec<f64>,
        spacing: f64,
        distance: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let distance =
            array::<f64, IxDyn>("distance", "float64 with as many axes as lower", distance)?;
        let counts = distance.shape().to_vec();
        let numbers = slice_of(&distance).to_vec();
        let inner = py.detach(|| match dim_of("lower", lower.len())? {
            2 => FreeSpace::new(
                fixed("lower", &lower)?,
                spacing,
                fixed("distance", &counts)?,
                numbers,
            )
            .map(AnySpace::Plane)
            .map_err(raised),
            _ => FreeSpace::new(
                fixed("lower", &lower)?,
                spacing,
                fixed("distance", &counts)?,
                numbers,
            )
            .map(AnySpace::Space)
            .map_err(raised),
        })?;
        Ok(Self { inner })
    }
}
