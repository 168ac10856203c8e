//! `AccelerationHistory`: the signal of the safeguard.

use std::sync::{Mutex, MutexGuard};

use ::neural::{AccelerationHistory, HistorySettings, SafeguardError, Signal};
use numpy::{Ix2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::convert::{array, slice_of};
use crate::error::{config_error, snapshot_error};

/// Accelerations of the last two windows of time.
#[pyclass(frozen, name = "AccelerationHistory", module = "hybridmpm._native")]
pub struct PyAccelerationHistory {
    inner: Mutex<AccelerationHistory>,
}

/// Signal of the latest accelerations.
#[pyclass(frozen, name = "AccelerationSignal", module = "hybridmpm._native")]
pub struct PyAccelerationSignal(Signal);

fn raised(error: SafeguardError) -> PyErr {
    match error {
        SafeguardError::Snapshot(message) => snapshot_error(message),
        _ => config_error(error.to_string()),
    }
}

impl PyAccelerationHistory {
    fn locked(&self) -> MutexGuard<'_, AccelerationHistory> {
        self.inner.lock().expect("no panic under the lock")
    }
}

#[pymethods]
impl PyAccelerationHistory {
    #[new]
    #[pyo3(signature = (particles, dim, *, window, dt, calm_acceleration, min_active_share))]
    fn new(
        particles: usize,
        dim: usize,
        window: usize,
        dt: f32,
        calm_acceleration: f32,
        min_active_share: f32,
    ) -> PyResult<Self> {
        let settings = HistorySettings {
            particles,
            dim,
            window,
            dt,
            calm_acceleration,
            min_active_share,
        };
        let inner = AccelerationHistory::new(settings).map_err(raised)?;
        Ok(Self {
            inner: Mutex::new(inner),
        })
    }

    fn push(&self, py: Python<'_>, x: &Bound<'_, PyAny>) -> PyResult<PyAccelerationSignal> {
        let settings = py.detach(|| *self.locked().settings());
        let expected = format!(
            "float32 of shape ({}, {})",
            settings.particles, settings.dim
        );
        let x = array::<f32, Ix2>("x", &expected, x)?;
        if x.shape() != [settings.particles, settings.dim] {
            let got = x.shape();
            return Err(config_error(format!(
                "x must be {expected}, got shape {got:?}"
            )));
        }
        let x = slice_of(&x);
        let signal = py.detach(|| self.locked().push(x)).map_err(raised)?;
        Ok(PyAccelerationSignal(signal))
    }

    fn undo(&self, py: Python<'_>) -> PyResult<()> {
        if py.detach(|| self.locked().undo()) {
            Ok(())
        } else {
            Err(config_error(
                "only the latest push can be undone, and only once",
            ))
        }
    }

    fn snapshot<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &py.detach(|| self.locked().snapshot()))
    }

    fn restore(&self, py: Python<'_>, data: &[u8]) -> PyResult<()> {
        py.detach(|| self.locked().restore(data)).map_err(raised)
    }

    fn __copy__(&self, py: Python<'_>) -> Self {
        self.copy(py)
    }

    fn __deepcopy__(&self, py: Python<'_>, _memo: &Bound<'_, PyAny>) -> Self {
        self.copy(py)
    }

    fn copy(&self, py: Python<'_>) -> Self {
        Self {
            inner: Mutex::new(py.detach(|| self.locked().clone())),
        }
    }
}

#[pymethods]
impl PyAccelerationSignal {
    #[new]
    fn new(cosine: Option<f32>, plain: Option<f32>, active: f32, largest: f32) -> Self {
        Self(Signal {
            cosine,
            plain,
            active,
            largest,
        })
    }

    /// Arguments of `new`, by which copies and pickles are made.
    fn __getnewargs__(&self) -> (Option<f32>, Option<f32>, f32, f32) {
        (self.0.cosine, self.0.plain, self.0.active, self.0.largest)
    }

    #[getter]
    fn cosine(&self) -> Option<f32> {
        self.0.cosine
    }
    #[getter]
    fn plain(&self) -> Option<f32> {
        self.0.plain
    }
    #[getter]
    fn active(&self) -> f32 {
        self.0.active
    }
    #[getter]
    fn largest(&self) -> f32 {
        self.0.largest
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}
