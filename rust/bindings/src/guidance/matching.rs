//! `match_to_region`: a place for each particle.

use ::guidance::{FreeSpace, Matching, in_cells};
use numpy::{IntoPyArray, Ix2, PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays::{dim_of, other_dimension, points, raised, rows};
use super::free_space::{AnySpace, PyFreeSpace};
use crate::convert::{array, slice_of};
use crate::signals::interruptible;

/// Result of `match_to_region`.
#[pyclass(frozen, get_all, name = "Matching", module = "hybridmpm._native")]
pub struct PyMatching {
    places: Py<PyArray2<f64>>,
    group: Py<PyArray1<u32>>,
    way_starts: Py<PyArray1<u32>>,
    ways: Py<PyArray2<f64>>,
    cut_off: Py<PyArray1<bool>>,
}

impl PyMatching {
    fn of<const D: usize>(py: Python<'_>, found: Matching<D>) -> PyResult<Self> {
        let mut starts = vec![0];
        starts.extend(found.ways.iter().scan(0, |end, way| {
            *end += way.len() as u32;
            Some(*end)
        }));
        let (places, ways) = (found.places.concat(), found.ways.concat().concat());
        let (place_count, corner_count) = (places.len() / D, ways.len() / D);
        Ok(Self {
            places: places.into_pyarray(py).reshape([place_count, D])?.unbind(),
            group: found.group.into_pyarray(py).unbind(),
            way_starts: starts.into_pyarray(py).unbind(),
            ways: ways.into_pyarray(py).reshape([corner_count, D])?.unbind(),
            cut_off: found.cut_off.into_pyarray(py).unbind(),
        })
    }
}

/// Gives each particle a place in a region.
#[pyfunction]
#[pyo3(signature = (x, cells, space=None, side=None))]
pub fn match_to_region(
    py: Python<'_>,
    x: &Bound<'_, PyAny>,
    cells: &Bound<'_, PyAny>,
    space: Option<PyRef<'_, PyFreeSpace>>,
    side: Option<f64>,
) -> PyResult<PyMatching> {
    fn matched<const D: usize>(
        [x, cells]: [&[f64]; 2],
        space: Option<&FreeSpace<D>>,
        side: Option<f64>,
    ) -> PyResult<Matching<D>> {
        let cells = rows(cells);
        let mut found = ::guidance::match_to_region(&rows(x), &cells, space).map_err(raised)?;
        if let Some(side) = side {
            in_cells(&mut found.places, &cells, side);
        }
        Ok(found)
    }
    let x = array::<f64, Ix2>("x", "float64 of shape (N, D)", x)?;
    let dim = dim_of("x", x.shape()[1])?;
    let cells = points("cells", cells, dim)?;
    let (x, cells) = (slice_of(&x), slice_of(&cells));
    let space = space.as_ref().map(|space| &space.inner);
    match (dim, space) {
        (2, None | Some(AnySpace::Plane(_))) => {
            let room = match space {
                Some(AnySpace::Plane(room)) => Some(room),
                _ => None,
            };
            let found = interruptible(py, || matched::<2>([x, cells], room, side))?;
            PyMatching::of(py, found)
        }
        (3, None | Some(AnySpace::Space(_))) => {
            let room = match space {
                Some(AnySpace::Space(room)) => Some(room),
                _ => None,
            };
            let found = interruptible(py, || matched::<3>([x, cells], room, side))?;
            PyMatching::of(py, found)
        }
        _ => Err(other_dimension(dim)),
    }
}
