//! Checks of arrays and names, done once for all entry points.

use mpm::{Contact, ContactKind, Vector};
use numpy::{Element, PyReadonlyArray, PyUntypedArrayMethods, ndarray::Dimension};
use pyo3::prelude::*;

use crate::error::config_error;

/// The numbers of a C-contiguous array.
pub fn slice_of<'a, T: Element, D: Dimension>(
    name: &str,
    array: &'a PyReadonlyArray<'_, T, D>,
) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|_| {
        config_error(format!("{name} must be C-contiguous, got strides {:?}", array.strides()))
    })
}

/// D floats.
pub fn vector<const D: usize>(name: &str, values: &[f64]) -> PyResult<Vector<D>> {
    if values.len() != D {
        return Err(config_error(format!("{name} must have {D} components, got {}", values.len())));
    }
    Ok(Vector::from_fn(|axis, _| values[axis] as f32))
}

pub fn contact(kind: &str, friction: Option<f32>) -> PyResult<Contact> {
    let kind = match kind {
        "sticky" => ContactKind::Sticky,
        "slip" => ContactKind::Slip,
        "separating" => ContactKind::Separating,
        other => {
            return Err(config_error(format!(
                "contact must be \"sticky\", \"slip\" or \"separating\", got {other:?}"
            )));
        }
    };
    Ok(Contact { kind, friction })
}
