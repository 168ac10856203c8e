//! The external force of an array.

use mpm::Force;
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::slice_of;
use crate::error::config_error;

/// Reads the force of an array, for `frames` frames of `count` particles.
pub fn checked_force<'a>(
    name: &str,
    [frames, count, dim]: [usize; 3],
    array: Option<&'a PyReadonlyArrayDyn<'_, f32>>,
) -> PyResult<Force<'a>> {
    let Some(array) = array else {
        return Ok(Force::None);
    };
    let (held, per_frame) = ([count, dim], [frames, count, dim]);
    match array.shape() {
        shape if shape == [dim] => Ok(Force::Uniform(slice_of(array))),
        shape if shape == held => Ok(Force::Held(slice_of(array))),
        shape if shape == per_frame => Ok(Force::PerFrame(slice_of(array))),
        shape => Err(config_error(format!(
            "{name} must be of shape {held:?} or {per_frame:?}, or [{dim}] for all particles alike, got {shape:?}"
        ))),
    }
}
