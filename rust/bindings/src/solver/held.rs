//! Contents of a Python class behind a lock.

use std::sync::{Mutex, MutexGuard};

use pyo3::Python;

pub struct Held<T>(Mutex<T>);

impl<T: Send> Held<T> {
    pub fn new(inner: T) -> Self {
        Self(Mutex::new(inner))
    }

    pub fn locked(&self) -> MutexGuard<'_, T> {
        self.0.lock().expect("no panic under the lock")
    }

    /// Takes the lock with the GIL released, so that a thread that waits for it stops no other.
    pub fn detached<R: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut T) -> R + Send) -> R {
        py.detach(|| work(&mut self.locked()))
    }

    /// Returns `size` numbers, written by `write`.
    pub fn read<N: Clone + Default + Send>(
        &self,
        py: Python<'_>,
        size: impl Fn(&T) -> usize + Sync,
        write: impl Fn(&T, &mut [N]) + Sync,
    ) -> Vec<N> {
        self.detached(py, |inner| {
            let mut out = vec![N::default(); size(inner)];
            write(inner, &mut out);
            out
        })
    }
}
