//! `VerletList`: graphs of one simulation, frame by frame.

use std::sync::{Arc, Mutex, MutexGuard};

use neighbors::GraphSettings;
use pyo3::prelude::*;
use threads::Pool;

use super::finder::Candidates;
use super::record::PyRadiusGraph;
use super::{Points, in_use, raised};
use crate::pools::shared_pool;

/// Graphs of points that move little from one to the next.
#[pyclass(frozen, name = "VerletList", module = "hybridmpm._native")]
pub struct PyVerletList {
    settings: GraphSettings,
    #[pyo3(get)]
    skin: f32,
    pool: Arc<Pool>,
    // Only tried, never waited for: whoever holds it may be waiting for the interpreter.
    held: Mutex<Held>,
}

struct Held {
    /// Candidates in the dimension of the latest call.
    candidates: Candidates,
    /// Rebuilds of candidates in other dimensions, before.
    before: u64,
}

impl PyVerletList {
    fn held(&self) -> PyResult<MutexGuard<'_, Held>> {
        self.held.try_lock().map_err(|_| in_use())
    }
}

#[pymethods]
impl PyVerletList {
    #[new]
    #[pyo3(signature = (radius, skin, *, inclusive=true, self_edges=false, max_edges=None, threads=1))]
    fn new(
        radius: f32,
        skin: f32,
        inclusive: bool,
        self_edges: bool,
        max_edges: Option<u32>,
        threads: usize,
    ) -> PyResult<Self> {
        let settings = GraphSettings {
            radius,
            inclusive,
            self_edges,
            max_edges: max_edges.unwrap_or(u32::MAX),
        };
        let candidates = Candidates::new(2, settings, skin).map_err(raised)?;
        Ok(Self {
            settings,
            skin,
            pool: shared_pool(threads)?,
            held: Mutex::new(Held {
                candidates,
                before: 0,
            }),
        })
    }

    #[getter]
    fn radius(&self) -> f32 {
        self.settings.radius
    }

    #[getter]
    fn rebuilds(&self) -> PyResult<u64> {
        let held = self.held()?;
        Ok(held.before + held.candidates.rebuilds())
    }

    #[pyo3(signature = (x, types=None, *, kinematic=3, out=None))]
    fn graph<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        types: Option<&Bound<'py, PyAny>>,
        kinematic: i64,
        out: Option<Bound<'py, PyRadiusGraph>>,
    ) -> PyResult<Bound<'py, PyRadiusGraph>> {
        let points = Points::new(x, types, kinematic)?;
        let mut held = self.held()?;
        if held.candidates.dim() != points.dim() {
            held.before += held.candidates.rebuilds();
            held.candidates =
                Candidates::new(points.dim(), self.settings, self.skin).map_err(raised)?;
        }
        let Some(out) = out else {
            return PyRadiusGraph::found(py, &points, &mut held.candidates, &self.pool);
        };
        out.get()
            .take_from(py, &points, &mut held.candidates, &self.pool)?;
        Ok(out)
    }
}
