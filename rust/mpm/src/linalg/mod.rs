//! Small vectors and matrices, of one particle and of a block of particles.

pub mod each_axis;
mod eigen;
mod instructions;
mod isotropic;
mod lanes;
mod math;
mod polar;
mod quad;
#[cfg(target_arch = "wasm32")]
mod wasm;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use eigen::{Spectrum, Symmetrics};
pub use instructions::{Instructions, Kernel, products_are_fused, run_wide};
pub use isotropic::{Split, exponential, logarithm};
pub use lanes::{LANES, Lanes, exp, ln};
pub use math::{Matrix, Symmetric, Vector, determinant, lanes, norm, shear_index};
pub use polar::rotations;
pub use quad::Quad;
