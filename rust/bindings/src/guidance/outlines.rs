//! `Outlines`: what closed lines enclose, and the region of it that a fluid fills.

use ::guidance::{Extent, Filled, Filling, Outlines, Silhouette};
use numpy::{
    IntoPyArray, Ix1, Ix2, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
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

/// What a fluid that fills something takes: the walls, its volume, its particles, and whether the whole is shrunk to it.
fn filling<const D: usize>(
    [lower, upper]: [&[f64]; 2],
    (volume, particles, shrinks): (f64, usize, bool),
) -> PyResult<Filling<D>> {
    Ok(Filling {
        walls: [fixed("lower", lower)?, fixed("upper", upper)?],
        volume,
        particles,
        shrinks,
    })
}

/// The answer of a function of Python about some points.
fn answered(name: &str, answer: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<bool>> {
    let answer: PyReadonlyArray1<'_, bool> = answer.extract()?;
    if answer.len() == count {
        return Ok(answer.as_array().to_vec());
    }
    Err(config_error(format!(
        "{name} must return {count} booleans, got {}",
        answer.len()
    )))
}

fn is_free<const D: usize>(free: &Bound<'_, PyAny>, points: &[[f64; D]]) -> PyResult<Vec<bool>> {
    let given = (points.concat().into_pyarray(free.py())).reshape([points.len(), D])?;
    answered("free", &free.call1((given,))?, points.len())
}

fn cells_of<const D: usize>(py: Python<'_>, found: Filled<D>) -> PyResult<Cells<'_>> {
    let count = found.cells.len();
    let cells = found.cells.into_flattened().into_pyarray(py);
    Ok((cells.reshape([count, D])?, found.side, found.scale))
}

/// Cells (M, D) of a region, moved inwards from its edges so that they press a fluid together.
#[pyfunction]
#[pyo3(signature = (cells, side, *, lower, upper, volume, particles, free))]
pub fn pressed<'py>(
    cells: &Bound<'py, PyAny>,
    side: f64,
    lower: Vec<f64>,
    upper: Vec<f64>,
    volume: f64,
    particles: usize,
    free: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    fn all<'py, const D: usize>(
        cells: &PyReadonlyArray2<'py, f64>,
        side: f64,
        filling: Filling<D>,
        free: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let cells = rows::<D, f64>(slice_of(cells));
        let moved = filling.pressed(&cells, side, |points| is_free(free, points))?;
        let count = moved.len();
        let moved = moved.into_flattened().into_pyarray(free.py());
        moved.reshape([count, D])
    }
    let dim = dim_of("lower", lower.len())?;
    let cells = points("cells", cells, dim)?;
    let (walls, fluid) = ([&lower[..], &upper[..]], (volume, particles, false));
    match dim {
        2 => all::<2>(&cells, side, filling(walls, fluid)?, free),
        _ => all::<3>(&cells, side, filling(walls, fluid)?, free),
    }
}

/// Cells of a solid in 3D that a fluid fills; see `Outlines.filled`.
#[pyfunction]
#[pyo3(signature = (lower, upper, *, center, low, high, solid, volume, particles, shrinks, covers, free))]
#[expect(
    clippy::too_many_arguments,
    reason = "keyword arguments of a Python function"
)]
pub fn filled_solid<'py>(
    py: Python<'py>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    center: [f64; 3],
    low: [f64; 3],
    high: [f64; 3],
    solid: f64,
    volume: f64,
    particles: usize,
    shrinks: bool,
    covers: &Bound<'py, PyAny>,
    free: &Bound<'py, PyAny>,
) -> PyResult<Cells<'py>> {
    let extent = Extent {
        center,
        bounds: [low, high],
        volume: solid,
    };
    let found = extent.filled(
        filling([&lower, &upper], (volume, particles, shrinks))?,
        |cells, scale| {
            let answer = covers.call1((cells.lower, cells.side, cells.counts, scale))?;
            answered("covers", &answer, cells.centers.len())
        },
        |points| is_free(free, points),
    )?;
    cells_of(py, found)
}

impl PyOutlines {
    fn fill<'py, const D: usize>(
        &self,
        py: Python<'py>,
        walls: [&[f64]; 2],
        fluid: (f64, usize, bool),
        depth: Option<[f64; 2]>,
        free: &Bound<'py, PyAny>,
    ) -> PyResult<Cells<'py>> {
        let silhouette = Silhouette {
            outlines: &self.inner,
            depth,
        };
        let fluid: Filling<D> = filling(walls, fluid)?;
        cells_of(
            py,
            silhouette.filled(fluid, |points| is_free(free, points))?,
        )
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
