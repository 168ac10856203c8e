//! Errors of starting threads.

use thiserror::Error;

/// The system grants fewer threads than requested.
#[derive(Debug, Error)]
#[error("the system does not grant {threads} threads: {source}")]
pub struct ThreadError {
    /// Number of threads requested.
    pub threads: usize,
    pub source: std::io::Error,
}
