//! What can go wrong when threads are started.

use thiserror::Error;

/// The system grants fewer threads than were asked for.
#[derive(Debug, Error)]
#[error("the system does not grant {threads} threads: {source}")]
pub struct ThreadError {
    /// Threads that were asked for.
    pub threads: usize,
    pub source: std::io::Error,
}
