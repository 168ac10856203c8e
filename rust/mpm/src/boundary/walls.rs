//! Where the six (four) sides of the box are.

use super::contact::Contact;
use crate::error::MpmError;
use crate::linalg::Vector;

/// Positions of the walls [m] and their surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Walls<const D: usize> {
    pub lower: Vector<D>,
    pub upper: Vector<D>,
    pub contact: Contact,
}

impl<const D: usize> Walls<D> {
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
        if self
            .contact
            .friction
            .is_some_and(|mu| !(mu >= 0.0 && mu.is_finite()))
        {
            return Err(MpmError::parameter(
                "wall_friction",
                "finite and >= 0",
                self.contact.friction,
            ));
        }
        Ok(())
    }
}
