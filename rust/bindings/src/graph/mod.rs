//! `radius_graph` and its record.

mod finder;
mod record;

use neighbors::{GraphError, GraphSettings};
use numpy::{Ix1, Ix2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::{array, describe, refuse_mask, slice_of};
use crate::error::{FrameCancelledError, GraphSizeError, config_error};
use crate::pools::shared_pool;
use finder::Finder;
pub use record::PyRadiusGraph;

#[expect(
    clippy::too_many_arguments,
    reason = "they are the keyword arguments of the Python function"
)]
#[pyfunction(name = "radius_graph")]
#[pyo3(signature = (
    x, radius, types=None, *, kinematic=3, inclusive=true, self_edges=false, max_edges=None, threads=1, out=None
))]
pub fn py_radius_graph<'py>(
    py: Python<'py>,
    x: &Bound<'py, PyAny>,
    radius: f32,
    types: Option<&Bound<'py, PyAny>>,
    kinematic: i64,
    inclusive: bool,
    self_edges: bool,
    max_edges: Option<u32>,
    threads: usize,
    out: Option<Bound<'py, PyRadiusGraph>>,
) -> PyResult<Bound<'py, PyRadiusGraph>> {
    let points = Points::new(x, types, kinematic)?;
    let settings = GraphSettings {
        radius,
        inclusive,
        self_edges,
        max_edges: max_edges.unwrap_or(u32::MAX),
    };
    let pool = shared_pool(threads)?;
    let Some(out) = out else {
        let mut finder = Finder::borrowed(points.dim());
        finder.set(settings);
        let graph = PyRadiusGraph::found(py, &points, &mut finder, &pool);
        finder.give_back();
        return graph;
    };
    out.get().find_again(py, &points, settings, &pool)?;
    Ok(out)
}

/// Checked positions and flags of points.
struct Points<'py> {
    x: PyReadonlyArray2<'py, f32>,
    fixed: Option<Vec<bool>>,
}

impl<'py> Points<'py> {
    fn new(
        x: &Bound<'py, PyAny>,
        types: Option<&Bound<'py, PyAny>>,
        kinematic: i64,
    ) -> PyResult<Self> {
        let expected = "float32 of shape (N, 2) or (N, 3)";
        let x = array::<f32, Ix2>("x", expected, x)?;
        if !(2..=3).contains(&x.shape()[1]) {
            return Err(config_error(format!(
                "x must be {expected}, got shape {:?}",
                x.shape()
            )));
        }
        let fixed = types.map(|types| fixed(types, kinematic)).transpose()?;
        Ok(Self { x, fixed })
    }

    fn dim(&self) -> usize {
        self.x.shape()[1]
    }

    fn count(&self) -> usize {
        self.x.shape()[0]
    }

    fn coordinates(&self) -> &[f32] {
        slice_of(&self.x)
    }
}

/// Which points are kinematic; `types` are integers of any width.
fn fixed(types: &Bound<'_, PyAny>, kinematic: i64) -> PyResult<Vec<bool>> {
    refuse_mask("types", types)?;
    let safe = PyDict::new(types.py());
    safe.set_item("casting", "safe")?;
    let wide = types.call_method("astype", ("int64",), Some(&safe));
    let wide: PyReadonlyArray1<'_, i64> = wide
        .and_then(|wide| array::<i64, Ix1>("types", "integers", &wide))
        .map_err(|_| {
            let got = describe(types);
            config_error(format!("types must be integers of shape (N,), got {got}"))
        })?;
    Ok(wide
        .as_array()
        .iter()
        .map(|&kind| kind == kinematic)
        .collect())
}

/// The Python exception of each failure.
fn raised(error: GraphError) -> PyErr {
    let message = error.to_string();
    // No `_` arm: a new variant must choose its exception to compile.
    match error {
        GraphError::Length { .. }
        | GraphError::Position { .. }
        | GraphError::Flags { .. }
        | GraphError::Points { .. } => config_error(message),
        GraphError::Interrupted => FrameCancelledError::new_err(message),
        GraphError::Edges { .. } => GraphSizeError::new_err(message),
    }
}

/// Error of a call that needs a graph which another thread is writing.
fn in_use() -> PyErr {
    config_error("the graph is being written by another thread: give each thread one of its own")
}
