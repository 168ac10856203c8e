//! `PaddedGraph`: the graph as a table.

use std::sync::Mutex;

use neighbors::{most_neighbors, write_padded};
use numpy::{PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::{in_use, raised};
use crate::error::config_error;

/// The neighbours of each point, as many columns as the most have.
#[pyclass(frozen, name = "PaddedGraph", module = "hybridmpm._native")]
pub struct PyPaddedGraph {
    // Only tried, never waited for: whoever holds it may be waiting for the interpreter.
    held: Mutex<Held>,
}

struct Held {
    neighbors: Py<PyArray2<i32>>,
    mask: Py<PyArray2<bool>>,
}

impl Held {
    fn new(py: Python<'_>, shape: [usize; 2]) -> Self {
        Self {
            neighbors: PyArray2::zeros(py, shape, false).unbind(),
            mask: PyArray2::zeros(py, shape, false).unbind(),
        }
    }
}

impl PyPaddedGraph {
    /// Writes the edges to `out`, or to a new table, of `width` columns, or of as many as it takes.
    pub(super) fn write<'py>(
        py: Python<'py>,
        starts: &[u32],
        senders: &[u32],
        width: Option<usize>,
        limit: usize,
        out: Option<Bound<'py, Self>>,
    ) -> PyResult<Bound<'py, Self>> {
        if width.is_some_and(|width| width > limit) {
            return Err(config_error(format!(
                "width must be at most limit = {limit}, got {}: raise limit",
                width.unwrap_or_default()
            )));
        }
        let (most, argument) = width.map_or((limit, "limit"), |width| (width, "width"));
        let found = most_neighbors(starts, most, argument).map_err(raised)?;
        let shape = [starts.len() - 1, width.unwrap_or(found)];
        let out = if let Some(out) = out {
            out
        } else {
            let held = Mutex::new(Held::new(py, shape));
            Bound::new(py, Self { held })?
        };
        let mut held = out.get().held.try_lock().map_err(|_| in_use())?;
        if held.neighbors.bind(py).shape() != shape {
            *held = Held::new(py, shape);
        }
        let (neighbors, mask) = (held.neighbors.bind(py), held.mask.bind(py));
        // SAFETY: nothing else writes them while `held` is locked; that readers of old views see new numbers is documented.
        let (neighbors, mask) = unsafe { (neighbors.as_slice_mut()?, mask.as_slice_mut()?) };
        py.detach(|| write_padded(starts, senders, shape[1], neighbors, mask));
        drop(held);
        Ok(out)
    }
}

#[pymethods]
impl PyPaddedGraph {
    #[getter]
    fn neighbors(&self, py: Python<'_>) -> PyResult<Py<PyArray2<i32>>> {
        let held = self.held.try_lock().map_err(|_| in_use())?;
        Ok(held.neighbors.clone_ref(py))
    }

    #[getter]
    fn mask(&self, py: Python<'_>) -> PyResult<Py<PyArray2<bool>>> {
        let held = self.held.try_lock().map_err(|_| in_use())?;
        Ok(held.mask.clone_ref(py))
    }
}
