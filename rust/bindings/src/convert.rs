//! Checks of arrays and names, done once for all entry points.

use mpm::{Contact, ContactKind, Vector};
use numpy::ndarray::Dimension;
use numpy::{
    Element, IntoPyArray, PyArray, PyArray2, PyArrayMethods, PyReadonlyArray, PyReadwriteArray,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::error::config_error;

/// The numbers of an array that `array` has returned, the last axis changing fastest.
pub fn slice_of<'a, T: Element, D: Dimension>(array: &'a PyReadonlyArray<'_, T, D>) -> &'a [T] {
    assert!(is_plain(array), "`array` returns plain memory");
    array.as_slice().expect("contiguous")
}

/// Whether the elements lie one after the other, the last axis changing fastest, each where the processor expects it.
fn is_plain<T: Element, D: Dimension>(array: &Bound<'_, PyArray<T, D>>) -> bool {
    array.is_c_contiguous() && array.data().is_aligned()
}

/// An array of the expected type and number of axes; `expected` names both, as "float32 of shape (N,)".
///
/// Elements in another order in memory, with gaps between them or with swapped bytes are read in the order of the
/// array's indices. All arrays that Python passes come by this way.
pub fn array<'py, T: Element, D: Dimension>(
    name: &str,
    expected: &str,
    value: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArray<'py, T, D>> {
    refuse_mask(name, value)?;
    let refused = || {
        let got = describe(value);
        config_error(format!("{name} must be {expected}, got {got}"))
    };
    if let Ok(array) = value.extract::<PyReadonlyArray<'py, T, D>>()
        && is_plain(&array)
    {
        return Ok(array);
    }
    let untyped = value.cast::<PyUntypedArray>().map_err(|_| refused())?;
    let native = untyped.dtype().call_method1("newbyteorder", ("=",))?;
    let copy = value.call_method1("astype", (native, "C"))?;
    copy.extract().map_err(|_| refused())
}

/// An array to write to, of the expected shape.
pub fn writable<'py, T: Element, D: Dimension>(
    name: &str,
    expected: &str,
    shape: &[usize],
    value: &Bound<'py, PyAny>,
) -> PyResult<PyReadwriteArray<'py, T, D>> {
    refuse_mask(name, value)?;
    let array = value.extract::<PyReadwriteArray<'py, T, D>>().ok();
    array
        .filter(|array| array.shape() == shape && is_plain(array))
        .ok_or_else(|| {
            let got = describe(value);
            config_error(format!(
                "{name} must be {expected} of shape {shape:?}, C-contiguous and writable, got {got}"
            ))
        })
}

/// Refuses NumPy's masked arrays: their masks would be lost.
pub fn refuse_mask(name: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
    let py = value.py();
    if value.get_type().is(py.get_type::<PyUntypedArray>())
        || !value.is_instance_of::<PyUntypedArray>()
    {
        return Ok(());
    }
    let masked = py.import("numpy.ma")?.getattr("MaskedArray")?;
    if value.is_instance(&masked)? {
        return Err(config_error(format!(
            "{name} must be an array without a mask, which would be lost, got a masked array: fill it by \
             .filled(value), or leave masked rows out"
        )));
    }
    Ok(())
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

/// Most letters of an object in an error message; of a longer one the type is named.
const LONGEST: usize = 200;

/// Description of an object for error messages.
pub fn describe(value: &Bound<'_, PyAny>) -> String {
    match value.cast::<PyUntypedArray>() {
        Ok(array) => format!("{} of shape {:?}", array.dtype(), array.shape()),
        Err(_) => match value.repr() {
            Ok(text) if text.len().is_ok_and(|length| length <= LONGEST) => text.to_string(),
            _ => format!("a {}", value.get_type()),
        },
    }
}

/// Numbers of cells along each axis; as many as a metre has where none are given.
pub fn cells_or_unit(
    cells: Option<Vec<usize>>,
    resolution: usize,
    dim: usize,
) -> PyResult<Vec<usize>> {
    let cells = cells.unwrap_or_else(|| vec![resolution; dim]);
    if cells.len() == dim {
        return Ok(cells);
    }
    Err(config_error(format!(
        "cells must have {dim} numbers, got {cells:?}"
    )))
}

/// The same for a const dimension, after a check of their number.
pub fn along_axes<const D: usize>(numbers: &[usize]) -> [usize; D] {
    std::array::from_fn(|axis| numbers[axis])
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
