//! `push_force`: the local force of a hand.

use ::guidance::Push;
use numpy::{IntoPyArray, Ix2, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::arrays::{dim_of, fixed, raised};
use crate::convert::{array, slice_of};
use crate::error::config_error;

/// Accelerations of particles near a hand.
#[pyfunction]
#[pyo3(signature = (x, v, *, point, velocity, radius, cap, frame_dt))]
#[expect(
    clippy::too_many_arguments,
    reason = "keyword arguments of a Python function"
)]
pub fn push_force<'py>(
    py: Python<'py>,
    x: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    point: Vec<f64>,
    velocity: Vec<f64>,
    radius: f64,
    cap: f64,
    frame_dt: f32,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    fn pushed<const D: usize>(hand: &Push<D>, x: &[f32], v: &[f32], frame_dt: f32) -> Vec<f32> {
        let (x, v) = (x.as_chunks().0, v.as_chunks().0);
        let mut force = vec![[0.0; D]; x.len()];
        hand.add_to(&mut force, x, v, frame_dt);
        force.into_flattened()
    }
    let x = array::<f32, Ix2>("x", "float32 of shape (N, D)", x)?;
    let v = array::<f32, Ix2>("v", "float32 of shape (N, D)", v)?;
    let shape = [x.shape()[0], dim_of("x", x.shape()[1])?];
    if v.shape() != shape {
        return Err(config_error(format!(
            "v must be float32 of the shape of x, {shape:?}, got {:?}",
            v.shape()
        )));
    }
    let (x, v) = (slice_of(&x), slice_of(&v));
    let (point, velocity) = (point.as_slice(), velocity.as_slice());
    let force = if shape[1] == 2 {
        let (point, velocity) = (fixed("point", point)?, fixed("velocity", velocity)?);
        let hand = Push::<2>::new(point, velocity, radius, cap).map_err(raised)?;
        py.detach(|| pushed(&hand, x, v, frame_dt))
    } else {
        let (point, velocity) = (fixed("point", point)?, fixed("velocity", velocity)?);
        let hand = Push::<3>::new(point, velocity, radius, cap).map_err(raised)?;
        py.detach(|| pushed(&hand, x, v, frame_dt))
    };
    force.into_pyarray(py).reshape(shape)
}
