//! `RadiusGraph`: the arrays of a graph.

use std::sync::{Mutex, MutexGuard};

use neighbors::GraphSettings;
use numpy::{Ix1, PyArray1, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PySlice;
use threads::Pool;

use super::finder::Finder;
use super::{Points, in_use, raised};
use crate::convert::{array, slice_of};
use crate::error::config_error;
use crate::signals::interruptible;

/// Edges between points at most a radius apart.
#[pyclass(frozen, name = "RadiusGraph", module = "hybridmpm._native")]
pub struct PyRadiusGraph {
    // The lock is only tried: the thread that has it may be waiting for the interpreter.
    held: Mutex<Held>,
}

struct Held {
    starts: Py<PyArray1<u32>>,
    /// The first `edges` entries count; there may be room for more.
    senders: Py<PyArray1<u32>>,
    edges: usize,
    receivers: Option<Py<PyArray1<u32>>>,
    radius: f32,
    /// Search that found this graph; the next one reuses its memory.
    search: Option<Finder>,
}

impl PyRadiusGraph {
    /// A new graph.
    pub(super) fn found<'py>(
        py: Python<'py>,
        points: &Points<'_>,
        finder: &mut Finder,
        pool: &Pool,
    ) -> PyResult<Bound<'py, Self>> {
        let mut held = Held {
            starts: PyArray1::zeros(py, 0, false).unbind(),
            senders: PyArray1::zeros(py, 0, false).unbind(),
            edges: 0,
            receivers: None,
            radius: 0.0,
            search: None,
        };
        held.find(py, points, finder, pool, 0)?;
        let held = Mutex::new(held);
        Bound::new(py, Self { held })
    }

    /// Overwrites this graph with a new one, found with the memory of the last.
    pub(super) fn find_again(
        &self,
        py: Python<'_>,
        points: &Points<'_>,
        settings: GraphSettings,
        pool: &Pool,
    ) -> PyResult<()> {
        let mut held = self.held()?;
        let mut search = match held.search.take() {
            Some(search) if search.dim() == points.dim() => search,
            _ => Finder::new(points.dim()),
        };
        search.set(settings);
        let done = held.overwrite(py, points, &mut search, pool);
        held.search = Some(search);
        done
    }

    fn held(&self) -> PyResult<MutexGuard<'_, Held>> {
        self.held.try_lock().map_err(|_| in_use())
    }
}

impl Held {
    fn overwrite(
        &mut self,
        py: Python<'_>,
        points: &Points<'_>,
        finder: &mut Finder,
        pool: &Pool,
    ) -> PyResult<()> {
        // Some room to spare, as the next graph may be a little larger.
        self.find(py, points, finder, pool, 8)
    }

    /// Finds a graph into these arrays, or into new ones with room for an `eighth`-th more edges (0: none) where it
    /// does not fit.
    fn find(
        &mut self,
        py: Python<'_>,
        points: &Points<'_>,
        finder: &mut Finder,
        pool: &Pool,
        spare: usize,
    ) -> PyResult<()> {
        let (x, fixed) = (points.coordinates(), points.fixed.as_deref());
        let edges = interruptible(py, || finder.find(x, fixed, pool).map_err(raised))?;
        if self.starts.bind(py).len() != points.count() + 1 {
            self.starts = uninit(py, points.count() + 1);
        }
        if self.senders.bind(py).len() < edges {
            self.senders = uninit(py, edges + edges.checked_div(spare).unwrap_or(0));
        }
        let (starts, senders) = (self.starts.bind(py), self.senders.bind(py));
        // SAFETY: nothing else writes them while `held` is locked; the stub says that older views change, too.
        let (starts, senders) = unsafe { (starts.as_slice_mut()?, senders.as_slice_mut()?) };
        py.detach(|| {
            starts.copy_from_slice(finder.starts());
            finder.write_senders(&mut senders[..edges], pool);
        });
        self.edges = edges;
        self.receivers = None;
        self.radius = finder.radius();
        Ok(())
    }
}

/// An array without initial values; callers write the part of it that is exposed.
fn uninit(py: Python<'_>, count: usize) -> Py<PyArray1<u32>> {
    // SAFETY: any bits are a u32; callers write the part that is exposed.
    unsafe { PyArray1::new(py, count, false) }.unbind()
}

#[pymethods]
impl PyRadiusGraph {
    #[new]
    fn new(
        py: Python<'_>,
        starts: &Bound<'_, PyAny>,
        senders: &Bound<'_, PyAny>,
        radius: f32,
    ) -> PyResult<Self> {
        let starts = array::<u32, Ix1>("starts", "uint32 of shape (N + 1,)", starts)?;
        let senders = array::<u32, Ix1>("senders", "uint32 of shape (E,)", senders)?;
        let (bounds, found) = (slice_of(&starts), slice_of(&senders));
        let fits = bounds.first() == Some(&0) && bounds.last() == Some(&(found.len() as u32));
        if !fits || !bounds.is_sorted() {
            return Err(config_error(
                "starts must ascend from 0 to the number of senders",
            ));
        }
        let held = Mutex::new(Held {
            starts: PyArray1::from_slice(py, bounds).unbind(),
            senders: PyArray1::from_slice(py, found).unbind(),
            edges: found.len(),
            receivers: None,
            radius,
            search: None,
        });
        Ok(Self { held })
    }

    /// Arguments of `new`, by which copies and pickles are made.
    fn __getnewargs__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Py<PyArray1<u32>>, Bound<'py, PyAny>, f32)> {
        Ok((self.starts(py)?, self.senders(py)?, self.radius()?))
    }

    #[getter]
    fn senders<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let held = self.held()?;
        let senders = held.senders.bind(py);
        if senders.len() == held.edges {
            return Ok(senders.clone().into_any());
        }
        senders.get_item(PySlice::new(py, 0, held.edges as isize, 1))
    }

    #[getter]
    fn receivers(&self, py: Python<'_>) -> PyResult<Py<PyArray1<u32>>> {
        let mut held = self.held()?;
        if let Some(receivers) = &held.receivers {
            return Ok(receivers.clone_ref(py));
        }
        let receivers = uninit(py, held.edges);
        // SAFETY: `receivers` is new, and `starts` is not written while `held` is locked.
        let (mut rest, starts) = unsafe {
            let starts = held.starts.bind(py).as_slice()?;
            (receivers.bind(py).as_slice_mut()?, starts)
        };
        for (receiver, range) in (0u32..).zip(starts.windows(2)) {
            let (mine, others) = rest.split_at_mut((range[1] - range[0]) as usize);
            mine.fill(receiver);
            rest = others;
        }
        held.receivers = Some(receivers.clone_ref(py));
        Ok(receivers)
    }

    #[getter]
    fn starts(&self, py: Python<'_>) -> PyResult<Py<PyArray1<u32>>> {
        Ok(self.held()?.starts.clone_ref(py))
    }

    #[getter]
    fn radius(&self) -> PyResult<f32> {
        Ok(self.held()?.radius)
    }
}
