//! The few particles that carry.

use super::field::Mover;
use crate::error::MpmError;
use crate::linalg::{Matrix, Vector};

/// The few particles at one instant; N of each, vectors as N x D numbers.
#[derive(Debug, Clone, Copy)]
pub struct Few<'a> {
    /// Numbers that they keep for good, ascending.
    pub ids: &'a [u64],
    /// Positions [m].
    pub x: &'a [f32],
    /// Gradients of the velocity around them, as APIC's matrices, N x D x D by rows [1/s]; None where unknown.
    pub affine: Option<&'a [f32]>,
    /// Masses [kg].
    pub mass: &'a [f32],
}

impl Few<'_> {
    /// Refuses arrays of different lengths and numbers that are not finite.
    pub(super) fn check<const D: usize>(&self) -> Result<(), MpmError> {
        let n = self.ids.len();
        let affine = self.affine.unwrap_or_default();
        let squares = if self.affine.is_some() { n * D * D } else { 0 };
        for (name, expected, got) in [
            ("x", n * D, self.x.len()),
            ("affine", squares, affine.len()),
            ("mass", n, self.mass.len()),
        ] {
            if got != expected {
                return Err(MpmError::Length {
                    name,
                    expected,
                    got,
                });
            }
        }
        let numbers = [("x", self.x), ("affine", affine), ("mass", self.mass)];
        for (name, numbers) in numbers {
            if let Some(bad) = numbers.iter().find(|s| !s.is_finite()) {
                return Err(MpmError::parameter(name, "finite", bad));
            }
        }
        if !self.ids.is_sorted() {
            return Err(MpmError::parameter("ids", "ascending", self.ids));
        }
        Ok(())
    }

    fn position<const D: usize>(&self, index: usize) -> Vector<D> {
        Vector::from_column_slice(&self.x[index * D..][..D])
    }

    fn gradient<const D: usize>(&self, index: usize) -> Matrix<D> {
        self.affine.map_or_else(Matrix::zeros, |all| {
            Matrix::from_row_slice(&all[index * D * D..][..D * D])
        })
    }
}

/// What a carrier remembers of the few: where they were at the latest carry.
#[derive(Debug, Clone, PartialEq)]
pub struct Past<const D: usize> {
    pub ids: Vec<u64>,
    pub x: Vec<Vector<D>>,
    pub affine: Vec<Matrix<D>>,
}

impl<const D: usize> Past<D> {
    /// Of few that have been checked.
    pub fn of(few: &Few<'_>) -> Self {
        let all = 0..few.ids.len();
        Self {
            ids: few.ids.to_vec(),
            x: all.clone().map(|index| few.position(index)).collect(),
            affine: all.map(|index| few.gradient(index)).collect(),
        }
    }

    /// By what those that are still there have moved since, in `dt` [s], with a part of their affine motion.
    pub fn movers(&self, now: &Few<'_>, dt: f32, affine_share: f32) -> Vec<Mover<D>> {
        let mut movers = Vec::with_capacity(self.ids.len());
        let mut index = 0;
        for (then, id) in self.ids.iter().enumerate() {
            while index < now.ids.len() && now.ids[index] < *id {
                index += 1;
            }
            if now.ids.get(index) == Some(id) {
                let mean = (self.affine[then] + now.gradient(index)) * 0.5;
                movers.push(Mover {
                    x: self.x[then],
                    shift: now.position::<D>(index) - self.x[then],
                    gradient: mean * (affine_share * dt),
                    mass: now.mass[index],
                });
            }
        }
        movers
    }

    /// The present velocities `v`, N x D [m/s], as motion, with a part of the affine motion.
    pub fn velocities(now: &Few<'_>, v: &[f32], affine_share: f32) -> Vec<Mover<D>> {
        (0..now.ids.len())
            .map(|index| Mover {
                x: now.position(index),
                shift: Vector::from_column_slice(&v[index * D..][..D]),
                gradient: now.gradient(index) * affine_share,
                mass: now.mass[index],
            })
            .collect()
    }
}
