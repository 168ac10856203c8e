//! `answer_weights`: weights of a network's answer.

use ::neural::AnswerGate;
use numpy::{IntoPyArray, Ix2, Ix3, PyArray1, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::edges::{Edges, check_length, check_positive, components, corners};
use crate::convert::{array, slice_of};
use crate::error::config_error;

#[expect(
    clippy::too_many_arguments,
    reason = "they are the arguments of the Python function"
)]
#[pyfunction]
#[pyo3(signature = (
    history, known_acceleration, starts, senders, *, radius, scale, hops, quiet, unnoticed, most, lower, upper
))]
pub fn answer_weights<'py>(
    py: Python<'py>,
    history: &Bound<'py, PyAny>,
    known_acceleration: &Bound<'py, PyAny>,
    starts: &Bound<'py, PyAny>,
    senders: &Bound<'py, PyAny>,
    radius: f32,
    scale: Vec<f32>,
    hops: usize,
    quiet: f32,
    unnoticed: f32,
    most: f32,
    lower: Vec<f32>,
    upper: Vec<f32>,
) -> PyResult<Bound<'py, PyArray1<f32>>> {
    let expected = "float32 of shape (S, N, 2) or (S, N, 3) with S >= 2";
    let history = array::<f32, Ix3>("history", expected, history)?;
    let known = array::<f32, Ix2>(
        "known_acceleration",
        "float32 of shape (N, D)",
        known_acceleration,
    )?;
    let &[states, count, dim] = history.shape() else {
        unreachable!("three axes were asked for")
    };
    let edges = Edges::of(starts, senders, count)?;
    check_positive("radius", radius)?;
    check_positive("quiet", quiet)?;
    for &one in &scale {
        check_positive("scale", one)?;
    }
    check_length("known_acceleration", known.shape()[0], count, count)?;
    if known.shape()[1] != dim || states < 2 || !matches!(dim, 2 | 3) {
        return Err(config_error(format!(
            "history must be {expected} and known_acceleration (N, D) like it, got shapes {:?} and {:?}",
            history.shape(),
            known.shape()
        )));
    }
    let history = slice_of(&history);
    let known = slice_of(&known);
    let numbers = Numbers {
        radius,
        scale: &scale,
        hops,
        limits: [quiet, unnoticed, most],
        lower: &lower,
        upper: &upper,
    };
    let weights = if dim == 2 {
        numbers.weights::<2>(py, history, known, &edges)
    } else {
        numbers.weights::<3>(py, history, known, &edges)
    };
    Ok(weights?.into_pyarray(py))
}

struct Numbers<'a> {
    radius: f32,
    scale: &'a [f32],
    hops: usize,
    limits: [f32; 3],
    lower: &'a [f32],
    upper: &'a [f32],
}

impl Numbers<'_> {
    fn weights<const D: usize>(
        &self,
        py: Python<'_>,
        history: &[f32],
        known: &[f32],
        edges: &Edges,
    ) -> PyResult<Vec<f32>> {
        let [lower, upper] = corners::<D>(self.lower, self.upper)?;
        let [quiet, unnoticed, most] = self.limits;
        let settings = AnswerGate::<D> {
            radius: self.radius,
            scale: components("scale", self.scale)?,
            hops: self.hops,
            quiet,
            unnoticed,
            most,
            lower,
            upper,
        };
        let known = known.as_chunks().0;
        if known.is_empty() {
            return Ok(Vec::new());
        }
        let states: Vec<&[[f32; D]]> = history.as_chunks().0.chunks(known.len()).collect();
        Ok(py.detach(|| settings.weights(&states, known, &edges.starts, &edges.senders)))
    }
}
