//! `relaxed`: densities after a network step.

use ::neural::Relaxation;
use numpy::{IntoPyArray, Ix1, Ix2, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::edges::{Edges, check_length, check_positive, corners};
use crate::convert::{array, slice_of};
use crate::error::config_error;

#[expect(
    clippy::too_many_arguments,
    reason = "they are the arguments of the Python function"
)]
#[pyfunction]
#[pyo3(signature = (x, answer_weight, starts, senders, *, radius, rest_density, strength, rounds, lower, upper))]
pub fn relaxed<'py>(
    py: Python<'py>,
    x: &Bound<'py, PyAny>,
    answer_weight: &Bound<'py, PyAny>,
    starts: &Bound<'py, PyAny>,
    senders: &Bound<'py, PyAny>,
    radius: f32,
    rest_density: f32,
    strength: f32,
    rounds: usize,
    lower: Vec<f32>,
    upper: Vec<f32>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let expected = "float32 of shape (N, 2) or (N, 3)";
    let x = array::<f32, Ix2>("x", expected, x)?;
    let answer_weight = array::<f32, Ix1>("answer_weight", "float32 of shape (N,)", answer_weight)?;
    let (count, dim) = (x.shape()[0], x.shape()[1]);
    let answer_weight = slice_of("answer_weight", &answer_weight)?;
    check_length("answer_weight", answer_weight.len(), count, count)?;
    let edges = Edges::of(starts, senders, count)?;
    check_positive("radius", radius)?;
    check_positive("rest_density", rest_density)?;
    let mut moved = slice_of("x", &x)?.to_vec();
    let settings = (radius, rest_density, strength, rounds);
    match dim {
        2 => relax::<2>(
            py,
            &mut moved,
            answer_weight,
            &edges,
            settings,
            &lower,
            &upper,
        )?,
        3 => relax::<3>(
            py,
            &mut moved,
            answer_weight,
            &edges,
            settings,
            &lower,
            &upper,
        )?,
        _ => {
            return Err(config_error(format!(
                "x must be {expected}, got shape {:?}",
                x.shape()
            )));
        }
    }
    moved.into_pyarray(py).reshape([count, dim])
}

fn relax<const D: usize>(
    py: Python<'_>,
    x: &mut [f32],
    answer_weight: &[f32],
    edges: &Edges,
    (radius, rest_density, strength, rounds): (f32, f32, f32, usize),
    lower: &[f32],
    upper: &[f32],
) -> PyResult<()> {
    let [lower, upper] = corners::<D>(lower, upper)?;
    let settings = Relaxation::<D> {
        radius,
        rest_density,
        strength,
        rounds,
        lower,
        upper,
    };
    let x = x.as_chunks_mut().0;
    py.detach(|| settings.apply(x, answer_weight, &edges.starts, &edges.senders));
    Ok(())
}
