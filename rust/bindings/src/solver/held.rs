//! Contents of a Python class behind a lock.

use std::sync::{Mutex, MutexGuard};

use pyo3::exceptions::PyRuntimeError;
use pyo3::{PyResult, Python};

use crate::signals::{in_handler, interruptible};

pub struct Held<T>(Mutex<T>);

impl<T: Send> Held<T> {
    pub fn new(inner: T) -> Self {
        Self(Mutex::new(inner))
    }

    /// Waits for the lock. A handler of a signal must not: it may run within the call that has the lock.
    pub fn locked(&self) -> PyResult<MutexGuard<'_, T>> {
        if !in_handler() {
            return Ok(self.0.lock().expect("no panic under the lock"));
        }
        self.0.try_lock().map_err(|_| {
            PyRuntimeError::new_err(
                "the simulator is in a call that a signal has interrupted: a signal handler may use it after the \
                 call, or end the call by raising an exception",
            )
        })
    }

    /// Takes the lock with the GIL released, so that a thread that waits for it stops no other.
    pub fn detached<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut T) -> R + Send,
    ) -> PyResult<R> {
        py.detach(|| Ok(work(&mut *self.locked()?)))
    }

    /// The same for work that a signal or a flag may end early.
    pub fn interruptible<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut T) -> PyResult<R> + Send,
    ) -> PyResult<R> {
        interruptible(py, || work(&mut *self.locked()?))
    }

    /// Returns `size` numbers, written by `write`.
    pub fn read<N: Clone + Default + Send>(
        &self,
        py: Python<'_>,
        size: impl Fn(&T) -> usize + Sync,
        write: impl Fn(&T, &mut [N]) + Sync,
    ) -> PyResult<Vec<N>> {
        self.detached(py, |inner| {
            let mut out = vec![N::default(); size(inner)];
            write(inner, &mut out);
            out
        })
    }
}
