//! `CancelFlag`: ends the work of another thread.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use pyo3::prelude::*;

use crate::error::FrameCancelledError;

type Flag = Arc<AtomicBool>;

thread_local! {
    /// Flags of the blocks that this thread is in.
    static ENTERED: RefCell<Vec<Flag>> = const { RefCell::new(Vec::new()) };
}

/// A flag that work reads between its pieces, in a block of the thread that does it.
#[pyclass(frozen, name = "CancelFlag", module = "hybridmpm._native")]
#[derive(Default)]
pub struct PyCancelFlag(Flag);

#[pymethods]
impl PyCancelFlag {
    #[new]
    #[pyo3(signature = (is_set=false))]
    fn new(is_set: bool) -> Self {
        Self(Arc::new(AtomicBool::new(is_set)))
    }

    /// Arguments of `new`: a copy is a flag of its own, in the same state.
    fn __getnewargs__(&self) -> (bool,) {
        (self.is_set(),)
    }

    fn set(&self) {
        // The flag guards no other memory, so its order among other accesses does not matter.
        self.0.store(true, Ordering::Relaxed);
    }

    #[getter]
    fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    fn __enter__<'py>(slf: &Bound<'py, Self>) -> Bound<'py, Self> {
        ENTERED.with_borrow_mut(|flags| flags.push(Arc::clone(&slf.get().0)));
        slf.clone()
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, _exception: &Bound<'_, PyAny>) {
        ENTERED.with_borrow_mut(|flags| {
            if let Some(place) = flags.iter().rposition(|flag| Arc::ptr_eq(flag, &self.0)) {
                flags.remove(place);
            }
        });
    }
}

/// Whether this thread is in the block of any flag.
pub fn may_be_cancelled() -> bool {
    ENTERED.with_borrow(|flags| !flags.is_empty())
}

/// Whether a flag of this thread's blocks is set.
pub fn is_cancelled() -> bool {
    ENTERED.with_borrow(|flags| flags.iter().any(|flag| flag.load(Ordering::Relaxed)))
}

/// Raises where a flag of this thread's blocks is set.
#[pyfunction]
pub fn raise_if_cancelled() -> PyResult<()> {
    if is_cancelled() {
        return Err(cancelled());
    }
    Ok(())
}

pub fn cancelled() -> PyErr {
    FrameCancelledError::new_err("the work was cancelled before it was done")
}
