//! Arrays of points of a dimension that is chosen at run time.

use ::guidance::GuidanceError;
use numpy::{Ix2, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::array;
use crate::error::config_error;

pub fn raised(error: GuidanceError) -> PyErr {
    config_error(error.to_string())
}

pub fn other_dimension(dim: usize) -> PyErr {
    config_error(format!("space must have the dimension of x, {dim}"))
}

/// Rows of D numbers.
pub fn rows<const D: usize, T: Copy>(numbers: &[T]) -> Vec<[T; D]> {
    numbers.as_chunks().0.to_vec()
}

pub fn fixed<const D: usize, T: Copy + std::fmt::Debug>(
    name: &str,
    numbers: &[T],
) -> PyResult<[T; D]> {
    numbers
        .try_into()
        .map_err(|_| config_error(format!("{name} must have {D} numbers, got {numbers:?}")))
}

pub fn dim_of(name: &str, dim: usize) -> PyResult<usize> {
    if matches!(dim, 2 | 3) {
        return Ok(dim);
    }
    Err(config_error(format!(
        "{name} must be of shape (N, 2) or (N, 3), got {dim} numbers a row"
    )))
}

/// A float64 array (N, D) with the D of the others.
pub fn points<'py>(
    name: &str,
    value: &Bound<'py, PyAny>,
    dim: usize,
) -> PyResult<PyReadonlyArray2<'py, f64>> {
    let expected = format!("float64 of shape (N, {dim})");
    let points = array::<f64, Ix2>(name, &expected, value)?;
    if points.shape()[1] == dim {
        return Ok(points);
    }
    Err(config_error(format!(
        "{name} must be {expected}, got shape {:?}",
        points.shape()
    )))
}
