//! The dimension of this build.

/// Dimension of the simulations of this module.
pub const D: usize = if cfg!(feature = "space") { 3 } else { 2 };
