//! Checks of arrays and names, done once for all entry points.

use mpm::{Contact, ContactKind, Vector};
use numpy::ndarray::Dimension;
use numpy::{
    Element, IntoPyArray, PyArray, PyArray2, PyArrayMethods, PyReadonlyArray, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::error::config_error;

/// The numbers of a C-contiguous array.
pub fn slice_of<'a, T: Element, D: Dimension>(
    name: &str,
    array: &'a PyReadonlyArray<'_, T, D>,
) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|_| {
        config_error(format!(
            "{name} must be C-contiguous, got strides {:?}",
            array.strides()
        ))
    })
}

/// An array of the expected type and number of axes; `expected` names both, as "float32 of shape (N,)".
pub fn array<'py, T: Element, D: Dimension>(
    name: &str,
    expected: &str,
    value: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArray<'py, T, D>> {
    value.extract().map_err(|_| {
        config_error(format!(
            "{name} must be {expected}, got {}",
            describe(value)
        ))
    })
}

/// Makes an array read-only: it is a copy of the state, and changes to it would be lost.
pub fn read_only<T: Element, D: Dimension>(
    array: Bound<'_, PyArray<T, D>>,
) -> Bound<'_, PyArray<T, D>> {
    array.readwrite().make_nonwriteable();
    array
}

/// Numbers of vectors of D components as an array (N, D).
pub fn vectors(
    py: Python<'_>,
    dim: usize,
    numbers: Vec<f32>,
) -> PyResult<Bound<'_, PyArray2<f32>>> {
    let count = numbers.len() / dim;
    numbers.into_pyarray(py).reshape([count, dim])
}

/// Description of an object for error messages.
pub fn describe(value: &Bound<'_, PyAny>) -> String {
    match value.cast::<PyUntypedArray>() {
        Ok(array) => format!("{} of shape {:?}", array.dtype(), array.shape()),
        Err(_) => match value.repr() {
            Ok(text) => text.to_string(),
            Err(_) => value.get_type().to_string(),
        },
    }
}

/// D floats.
pub fn vector<const D: usize>(name: &str, values: &[f64]) -> PyResult<Vector<D>> {
    if values.len() != D {
        return Err(config_error(format!(
            "{name} must have {D} components, got {}",
            values.len()
        )));
    }
    Ok(Vector::from_fn(|axis, _| values[axis] as f32))
}

/// One value for all walls, or one for each: of the first axis the lower and the upper wall, then of the second.
#[derive(FromPyObject)]
pub enum ForWalls<T> {
    All(T),
    Each(Vec<T>),
}

impl<T: Clone> ForWalls<T> {
    fn at(&self, wall: usize) -> T {
        match self {
            Self::All(value) => value.clone(),
            Self::Each(values) => values[wall].clone(),
        }
    }

    fn check(&self, name: &str, dim: usize) -> PyResult<()> {
        match self {
            Self::Each(values) if values.len() != 2 * dim => Err(config_error(format!(
                "{name} must be one value, or one for each of the {} walls, got {}",
                2 * dim,
                values.len()
            ))),
            _ => Ok(()),
        }
    }
}

/// Contacts of the lower and the upper wall across each of `dim` axes.
pub fn wall_contacts(
    dim: usize,
    kinds: &ForWalls<String>,
    frictions: &ForWalls<Option<f32>>,
) -> PyResult<Vec<[Contact; 2]>> {
    kinds.check("wall_contact", dim)?;
    frictions.check("wall_friction", dim)?;
    let wall = |number: usize| contact(&kinds.at(number), frictions.at(number));
    (0..dim)
        .map(|axis| Ok([wall(2 * axis)?, wall(2 * axis + 1)?]))
        .collect()
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
