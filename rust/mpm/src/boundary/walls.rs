//! Where the six (four) sides of the box are.

use super::contact::Contact;
use crate::error::MpmError;
use crate::linalg::Vector;

/// Positions of the walls [m] and their surfaces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Walls<const D: usize> {
    pub lower: Vector<D>,
    pub upper: Vector<D>,
    /// Surfaces of the lower and the upper wall across each axis.
    pub contacts: [[Contact; 2]; D],
}

impl<const D: usize> Walls<D> {
    /// Walls that all have the same surface.
    pub fn uniform(lower: Vector<D>, upper: Vector<D>, contact: Contact) -> Self {
        let contacts = [[contact; 2]; D];
        Self {
            lower,
            upper,
            contacts,
        }
    }

    /// Whether a point lies between the walls; false also for NaN.
    #[inline(always)]
    pub fn contains(&self, x: &Vector<D>) -> bool {
        (0..D).all(|axis| x[axis] >= self.lower[axis] && x[axis] <= self.upper[axis])
    }

    /// Refuses walls outside [0, 1] or closer to each other than four cells.
    pub fn check(&self, dx: f32) -> Result<(), MpmError> {
        for axis in 0..D {
            let (lower, upper) = (self.lower[axis], self.upper[axis]);
            // A thousandth of a cell is more than the difference of two rounded positions can lack.
            if !(lower >= 0.0 && upper <= 1.0 && upper - lower >= 3.999 * dx) {
                return Err(MpmError::parameter(
                    format!("walls along axis {axis}"),
                    "in [0, 1] and at least four cells apart",
                    (lower, upper),
                ));
            }
        }
        let mut frictions = self.contacts.iter().flatten().filter_map(|c| c.friction);
        if let Some(mu) = frictions.find(|mu| !(*mu >= 0.0 && mu.is_finite())) {
            return Err(MpmError::parameter("wall_friction", "finite and >= 0", mu));
        }
        Ok(())
    }
}
