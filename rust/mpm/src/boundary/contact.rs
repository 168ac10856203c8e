//! Change of a velocity at a surface, and the six (four) sides of the box with theirs.

use crate::error::MpmError;
use crate::linalg::Vector;
use crate::linalg::each_axis;
use serde::{Deserialize, Serialize};

/// How material meets a wall or an obstacle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ContactKind {
    /// No relative motion.
    Sticky,
    /// No motion through or away from the surface, free motion along it.
    Slip,
    /// Free to leave; Coulomb friction while pressed on.
    Separating,
}

/// A kind of contact with its friction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    pub kind: ContactKind,
    /// Coulomb coefficient of separating contact; None takes the material's own.
    pub friction: Option<f32>,
}

impl Contact {
    /// Velocity after contact with a surface at rest whose unit normal points out of the solid.
    #[inline]
    pub fn resolve<const D: usize>(
        &self,
        v: &Vector<D>,
        normal: &Vector<D>,
        material_friction: f32,
    ) -> Vector<D> {
        let normal_speed = v.dot(normal);
        match self.kind {
            ContactKind::Sticky => Vector::zeros(),
            ContactKind::Slip => v - normal * normal_speed,
            ContactKind::Separating if normal_speed >= 0.0 => *v,
            ContactKind::Separating => {
                let tangential = v - normal * normal_speed;
                let friction = self.friction.unwrap_or(material_friction);
                tangential * remaining_slip(tangential.norm(), friction * -normal_speed)
            }
        }
    }
}

/// Positions of the walls [m] and their surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Walls<const D: usize> {
    pub lower: Vector<D>,
    pub upper: Vector<D>,
    /// Surfaces of the lower and the upper wall across each axis.
    #[serde(with = "each_axis")]
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

    /// Refuses walls outside of a world of `cells` of size `dx` [m], or closer to each other than four cells.
    pub fn check(&self, dx: f32, cells: [usize; D]) -> Result<(), MpmError> {
        for axis in 0..D {
            let end = (cells[axis] as f32 + 1.0e-3) * dx;
            let (lower, upper) = (self.lower[axis], self.upper[axis]);
            // A thousandth of a cell is more than the difference of two rounded positions can lack.
            if !(lower >= 0.0 && upper <= end && upper - lower >= 3.999 * dx) {
                return Err(MpmError::parameter(
                    format!("walls along axis {axis}"),
                    "inside the world and at least four cells apart",
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

/// Factor on a slip speed after Coulomb friction that can take away at most `capacity` of it.
#[inline(always)]
pub fn remaining_slip(slip: f32, capacity: f32) -> f32 {
    let stops = slip <= capacity || slip == 0.0;
    // Computed in either case, which makes it a selection and no branch.
    let remaining = 1.0 - capacity / if stops { 1.0 } else { slip };
    if stops { 0.0 } else { remaining }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: Vector<2> = Vector::<2>::new(0.0, 1.0);

    fn contact(kind: ContactKind, friction: Option<f32>) -> Contact {
        Contact { kind, friction }
    }

    #[test]
    fn each_kind_keeps_what_it_should() {
        let (into, away) = (Vector::<2>::new(3.0, -1.0), Vector::<2>::new(3.0, 1.0));
        let after = |kind, friction, v| contact(kind, friction).resolve(&v, &UP, 0.25);
        assert_eq!(after(ContactKind::Sticky, None, away), Vector::<2>::zeros());
        assert_eq!(
            after(ContactKind::Slip, None, away),
            Vector::<2>::new(3.0, 0.0)
        );
        assert_eq!(after(ContactKind::Separating, None, away), away);
        assert_eq!(
            after(ContactKind::Separating, Some(0.0), into),
            Vector::<2>::new(3.0, 0.0)
        );
        // Coulomb: the normal impulse of 1 takes mu of the slip; the material's mu where none is named.
        assert_eq!(
            after(ContactKind::Separating, Some(0.5), into),
            Vector::<2>::new(2.5, 0.0)
        );
        assert_eq!(
            after(ContactKind::Separating, None, into),
            Vector::<2>::new(2.75, 0.0)
        );
        assert_eq!(
            after(ContactKind::Separating, Some(4.0), into),
            Vector::<2>::zeros()
        );
    }
}
