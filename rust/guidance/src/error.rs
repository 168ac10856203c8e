//! Errors in the arguments.

use thiserror::Error;

/// A number or an array that does not fit the others.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("{name} must be {allowed}, got {got}")]
pub struct GuidanceError {
    pub name: &'static str,
    pub allowed: String,
    pub got: String,
}

impl GuidanceError {
    pub(crate) fn new(name: &'static str, allowed: impl Into<String>, got: &impl ToString) -> Self {
        Self {
            name,
            allowed: allowed.into(),
            got: got.to_string(),
        }
    }
}

/// Refuses numbers that are not finite.
pub(crate) fn finite(name: &'static str, numbers: &[f64]) -> Result<(), GuidanceError> {
    match numbers.iter().find(|number| !number.is_finite()) {
        None => Ok(()),
        Some(number) => Err(GuidanceError::new(name, "finite", number)),
    }
}
