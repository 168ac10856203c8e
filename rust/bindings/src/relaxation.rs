//! `relaxed`: densities after a network step.

use neighbors::Relaxation;
use numpy::{IntoPyArray, Ix1, Ix2, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::{array, slice_of};
use crate::error::config_error;

#[expect(
    clippy::too_many_arguments,
    reason = "they are the arguments of the Python function"
)]
#[pyfunction]
#[pyo3(signature = (x, share, starts, senders, *, radius, rest_density, strength, rounds, lower, upper))]
pub fn relaxed<'py>(
    py: Python<'py>,
    x: &Bound<'py, PyAny>,
    share: &Bound<'py, PyAny>,
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
    let share = array::<f32, Ix1>("share", "float32 of shape (N,)", share)?;
    let starts = array::<u32, Ix1>("starts", "uint32 of shape (N + 1,)", starts)?;
    let senders = array::<u32, Ix1>("senders", "uint32 of shape (E,)", senders)?;
    let (count, dim) = (x.shape()[0], x.shape()[1]);
    let graph = Graph {
        share: slice_of("share", &share)?,
        starts: slice_of("starts", &starts)?,
        senders: slice_of("senders", &senders)?,
    };
    graph.check(count)?;
    for (name, value) in [("radius", radius), ("rest_density", rest_density)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(config_error(format!(
                "{name} must be finite and > 0, got {value}"
            )));
        }
    }
    let mut moved = slice_of("x", &x)?.to_vec();
    let settings = (radius, rest_density, strength, rounds);
    match dim {
        2 => py.detach(|| graph.relax::<2>(&mut moved, settings, &lower, &upper))?,
        3 => py.detach(|| graph.relax::<3>(&mut moved, settings, &lower, &upper))?,
        _ => {
            return Err(config_error(format!(
                "x must be {expected}, got shape {:?}",
                x.shape()
            )));
        }
    }
    moved.into_pyarray(py).reshape([count, dim])
}

struct Graph<'a> {
    share: &'a [f32],
    starts: &'a [u32],
    senders: &'a [u32],
}

impl Graph<'_> {
    fn check(&self, count: usize) -> PyResult<()> {
        let lengths = [
            ("share", self.share.len(), count),
            ("starts", self.starts.len(), count + 1),
        ];
        for (name, got, needed) in lengths {
            if got != needed {
                return Err(config_error(format!(
                    "{name} must have {needed} entries for {count} points, got {got}"
                )));
            }
        }
        let ascending = self.starts.is_sorted() && self.starts[0] == 0;
        if !ascending || self.starts[count] as usize != self.senders.len() {
            return Err(config_error(format!(
                "starts must ascend from 0 to the number of senders, {}",
                self.senders.len()
            )));
        }
        match self.senders.iter().find(|&&id| id as usize >= count) {
            Some(id) => Err(config_error(format!(
                "senders must be below {count}, the number of points, got {id}"
            ))),
            None => Ok(()),
        }
    }

    fn relax<const D: usize>(
        &self,
        x: &mut [f32],
        (radius, rest_density, strength, rounds): (f32, f32, f32, usize),
        lower: &[f32],
        upper: &[f32],
    ) -> PyResult<()> {
        let corner = |name: &str, values: &[f32]| {
            values.try_into().map_err(|_| {
                config_error(format!(
                    "{name} must have {D} components, got {}",
                    values.len()
                ))
            })
        };
        let settings = Relaxation::<D> {
            radius,
            rest_density,
            strength,
            rounds,
            lower: corner("lower", lower)?,
            upper: corner("upper", upper)?,
        };
        if !(0..D).all(|axis| settings.lower[axis] <= settings.upper[axis]) {
            return Err(config_error(format!(
                "lower must be at or below upper, got {lower:?} and {upper:?}"
            )));
        }
        settings.apply(x.as_chunks_mut().0, self.share, self.starts, self.senders);
        Ok(())
    }
}
