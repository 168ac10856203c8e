//! `least_acceleration`: when a way passes its points.

use numpy::{IntoPyArray, Ix2, PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays::{dim_of, fixed, raised, rows};
use crate::convert::{array, slice_of};

/// Times and velocities of the points of a way.
#[pyclass(frozen, get_all, name = "Timing", module = "hybridmpm._native")]
pub struct PyTiming {
    times: Py<PyArray1<f64>>,
    velocities: Py<PyArray2<f64>>,
}

/// Times a way through points.
#[pyfunction]
pub fn least_acceleration(
    py: Python<'_>,
    points: &Bound<'_, PyAny>,
    start_velocity: Vec<f64>,
    end_velocity: Vec<f64>,
    seconds: f64,
) -> PyResult<PyTiming> {
    fn timed<const D: usize>(
        numbers: &[f64],
        ends: [&[f64]; 2],
        seconds: f64,
    ) -> PyResult<(Vec<f64>, Vec<f64>)> {
        let (start, end) = (
            fixed("start_velocity", ends[0])?,
            fixed("end_velocity", ends[1])?,
        );
        let timing = ::guidance::least_acceleration::<D>(&rows(numbers), start, end, seconds);
        let timing = timing.map_err(raised)?;
        Ok((timing.times, timing.velocities.concat()))
    }
    let points = array::<f64, Ix2>("points", "float64 of shape (K, D)", points)?;
    let shape = [points.shape()[0], dim_of("points", points.shape()[1])?];
    let numbers = slice_of(&points);
    let ends = [start_velocity.as_slice(), end_velocity.as_slice()];
    let (times, velocities) = py.detach(|| match shape[1] {
        2 => timed::<2>(numbers, ends, seconds),
        _ => timed::<3>(numbers, ends, seconds),
    })?;
    Ok(PyTiming {
        times: times.into_pyarray(py).unbind(),
        velocities: velocities.into_pyarray(py).reshape(shape)?.unbind(),
    })
}
