//! Thread pools for coarse-grained work, such as batches and large graphs.

use std::sync::{Arc, Mutex};

use pyo3::prelude::*;
use threads::Pool;

use crate::error::config_error;

/// Pool of the latest call with several threads: starting new ones takes as long as finding a small graph.
static LATEST: Mutex<Option<Arc<Pool>>> = Mutex::new(None);

/// Starts a pool of `threads` threads.
pub fn pool(threads: usize) -> PyResult<Pool> {
    if threads == 0 {
        return Err(config_error("threads must be at least 1, got 0"));
    }
    Pool::new(threads).map_err(|error| {
        config_error(format!(
            "threads must be a number that the system grants: {error}"
        ))
    })
}

/// The same, kept for later calls. Calls at the same time share it: one has its help, the others work alone.
pub fn shared_pool(threads: usize) -> PyResult<Arc<Pool>> {
    let new = || pool(threads).map(Arc::new);
    if threads < 2 {
        return new();
    }
    // The lock is only tried: a fork may have left it locked.
    let Ok(mut latest) = LATEST.try_lock() else {
        return new();
    };
    let fits = |pool: &&Arc<Pool>| pool.size() == threads && pool.is_ours();
    match latest.as_ref().filter(fits) {
        Some(pool) => Ok(Arc::clone(pool)),
        None => Ok(Arc::clone(latest.insert(new()?))),
    }
}
