//! Small vectors and matrices, of one particle and of a block of particles.

mod eigen;
mod isotropic;
mod lanes;
mod math;
mod svd;

pub use eigen::{Spectrum, Symmetrics};
pub use isotropic::{Split, exponential, logarithm};
pub use lanes::{Kernel, LANES, Lanes, exp, ln, run_wide};
pub use math::{Matrix, Symmetric, Vector, determinant, lanes, norm, shear_index};
pub use svd::{Svd, svd};
