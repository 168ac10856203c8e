//! `Outlines`: what closed lines enclose, and the region of it that a fluid fills.

use ::guidance::{Filled, Outlines, Silhouette};
use numpy::{
    IntoPyArray, Ix1, Ix2, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::arrays::{dim_of, fixed, points, rows};
use crate::convert::{array, slice_of};
use crate::error::config_error;

/// Closed lines in the plane; what they enclose an odd number of times is inside.
#[pyclass(frozen, name = "Outlines", module = "hybridmpm._native")]
pub struct PyOutlines {
    inner: Outlines,
}

/// Cells (M, D), their side, and the factor on the size.
type Cells<'py> = (Bound<'py, PyArray2<f64>>, f64, f64);

impl PyOutlines {
    fn fill<'py, const D: usize>(
        &self,
        py: Python<'py>,
        [lower, upper]: [&[f64]; 2],
        (volume, particles, shrinks): (f64, usize, bool),
        depth: Option<[f64; 2]>,
        free: &Bound<'py, PyAny>,
    ) -> PyResult<Cells<'py>> {
        let silhouette = Silhouette {
            outlines: &self.inner,
            depth,
        };
        let is_free = |cells: &[[f64; D]]| -> PyResult<Vec<bool>> {
            let given = cells.concat().into_pyarray(py).reshape([cells.len(), D])?;
            let answer = free.call1((given,))?;
            let answer: PyReadonlyArray1<'_, bool> = answer.extract()?;
            if answer.len() == cells.len() {
                return Ok(answer.as_array().to_vec());
            }
            Err(config_error(format!(
                "free must return {} booleans, got {}",
                cells.len(),
                answer.len()
            )))
        };
        let walls = [fixed("lower", lower)?, fixed("upper", upper)?];
        let found: Filled<D> = silhouette.filled(walls, volume, particles, shrinks, is_free)?;
        let count = found.cells.len();
        let cells = found.cells.into_flattened().into_pyarray(py);
        Ok((cells.reshape([count, D])?, found.side, found.scale))
    }
}

#[pymethods]
impl PyOutlines {
    #[new]
    fn new(py: Python<'_>, lines: &Bound<'_, PyAny>, starts: &Bound<'_, PyAny>) -> PyResult<Self> {
        let lines = array::<f64, Ix2>("lines", "float64 of shape (K, 2)", lines)?;
        let starts = array::<u32, Ix1>("starts", "uint32 of shape (L + 1,)", starts)?;
        let (shape, ends) = (lines.shape(), slice_of(&starts));
        let fit =
            ends.first() == Some(&0) && ends.last() == Some(&(shape[0] as u32)) && ends.is_sorted();
        if shape[1] != 2 || !fit {
            return Err(config_error(format!(
                "lines must be of shape (K, 2) and starts ascending from 0 to K, got {shape:?} and {ends:?}"
            )));
        }
        let corners = rows::<2, f64>(slice_of(&lines));
        let split = |pair: &[u32]| corners[pair[0] as usize..pair[1] as usize].to_vec();
        let lines: Vec<_> = ends.windows(2).map(split).collect();
        let inner = py.detach(|| Outlines::new(&lines));
        Ok(Self { inner })
    }

    #[getter]
    fn area(&self) -> f64 {
        self.inner.area
    }

    #[getter]
    fn center(&self) -> [f64; 2] {
        self.inner.center
    }

    fn covers<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let x = points("x", x, 2)?;
        let x = rows(slice_of(&x));
        let inside = py.detach(|| self.inner.covers(&x));
        Ok(inside.into_pyarray(py))
    }

    #[pyo3(signature = (lower, upper, *, volume, particles, shrinks, free, depth=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of a Python method"
    )]
    fn filled<'py>(
        &self,
        py: Python<'py>,
        lower: Vec<f64>,
        upper: Vec<f64>,
        volume: f64,
        particles: usize,
        shrinks: bool,
        free: &Bound<'py, PyAny>,
        depth: Option<[f64; 2]>,
    ) -> PyResult<Cells<'py>> {
        let walls = [&lower[..], &upper[..]];
        let fluid = (volume, particles, shrinks);
        match dim_of("lower", lower.len())? {
            2 => self.fill::<2>(py, walls, fluid, depth, free),
            _ => self.fill::<3>(py, walls, fluid, depth, free),
        }
    }
}
