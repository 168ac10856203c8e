//! The two constants of isotropic elasticity.

use serde::{Deserialize, Serialize};

/// Lame parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Lame {
    /// Shear modulus [Pa].
    pub mu: f32,
    /// First parameter [Pa].
    pub lambda: f32,
}

impl Lame {
    /// From Young's modulus [Pa] and Poisson's ratio [-].
    pub fn new(youngs_modulus: f32, poisson_ratio: f32) -> Self {
        let (e, nu) = (youngs_modulus, poisson_ratio);
        Self {
            mu: e / (2.0 * (1.0 + nu)),
            lambda: e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
        }
    }
}
