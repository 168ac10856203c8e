//! Edges as arguments of functions.

use numpy::Ix1;
use pyo3::prelude::*;

use crate::convert::{array, slice_of};
use crate::error::config_error;

/// Edges ordered by receiver: those into point i come from `senders[starts[i]..starts[i + 1]]`.
pub struct Edges {
    pub starts: Vec<u32>,
    pub senders: Vec<u32>,
}

impl Edges {
    /// Checks arrays of edges between `count` points.
    pub fn of(
        starts: &Bound<'_, PyAny>,
        senders: &Bound<'_, PyAny>,
        count: usize,
    ) -> PyResult<Self> {
        let starts = array::<u32, Ix1>("starts", "uint32 of shape (N + 1,)", starts)?;
        let senders = array::<u32, Ix1>("senders", "uint32 of shape (E,)", senders)?;
        let edges = Self {
            starts: slice_of(&starts).to_vec(),
            senders: slice_of(&senders).to_vec(),
        };
        check_length("starts", edges.starts.len(), count + 1, count)?;
        let ascending = edges.starts.is_sorted() && edges.starts[0] == 0;
        if !ascending || edges.starts[count] as usize != edges.senders.len() {
            return Err(config_error(format!(
                "starts must ascend from 0 to the number of senders, {}",
                edges.senders.len()
            )));
        }
        match edges.senders.iter().find(|&&id| id as usize >= count) {
            Some(id) => Err(config_error(format!(
                "senders must be below {count}, the number of points, got {id}"
            ))),
            None => Ok(edges),
        }
    }
}

/// Raises an error unless an array has the length that `count` points need.
pub fn check_length(name: &str, got: usize, needed: usize, count: usize) -> PyResult<()> {
    if got == needed {
        return Ok(());
    }
    Err(config_error(format!(
        "{name} must have {needed} entries for {count} points, got {got}"
    )))
}

/// Raises an error unless `value` is finite and above 0.
pub fn check_positive(name: &str, value: f32) -> PyResult<()> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(config_error(format!(
        "{name} must be finite and > 0, got {value}"
    )))
}

/// The corners of a box.
pub fn corners<const D: usize>(lower: &[f32], upper: &[f32]) -> PyResult<[[f32; D]; 2]> {
    let (lower, upper) = (components("lower", lower)?, components("upper", upper)?);
    if (0..D).all(|axis| lower[axis] <= upper[axis]) {
        return Ok([lower, upper]);
    }
    Err(config_error(format!(
        "lower must be at or below upper, got {lower:?} and {upper:?}"
    )))
}

/// D numbers.
pub fn components<const D: usize>(name: &str, values: &[f32]) -> PyResult<[f32; D]> {
    values.try_into().map_err(|_| {
        config_error(format!(
            "{name} must have {D} components, got {}",
            values.len()
        ))
    })
}
