//! Coarse particles, and their displacements between updates.

use super::field::Sample;
use crate::error::MpmError;
use crate::linalg::{Matrix, Vector};

/// Coarse particles at one instant; N of each, vectors as N x D numbers.
#[derive(Debug, Clone, Copy)]
pub struct CoarseParticles<'a> {
    /// Permanent ids, ascending.
    pub ids: &'a [u64],
    /// Positions [m].
    pub x: &'a [f32],
    /// Velocity gradients, APIC's matrices, N x D x D by rows [1/s]; None if unknown.
    pub affine: Option<&'a [f32]>,
    /// Masses [kg].
    pub mass: &'a [f32],
    /// Numbers of the rigid bodies, as `Solver::rigid` has them.
    pub rigid: &'a [[f64; 13]],
}

impl CoarseParticles<'_> {
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
        if let Some(bad) = self.rigid.iter().flatten().find(|s| !s.is_finite()) {
            return Err(MpmError::parameter("rigid", "finite", bad));
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

/// Coarse particles at the latest update.
#[derive(Debug, Clone, PartialEq)]
pub struct Previous<const D: usize> {
    pub ids: Vec<u64>,
    pub x: Vec<Vector<D>>,
    pub affine: Vec<Matrix<D>>,
}

impl<const D: usize> Previous<D> {
    /// Copies particles that have been checked.
    pub fn of(coarse: &CoarseParticles<'_>) -> Self {
        let all = 0..coarse.ids.len();
        Self {
            ids: coarse.ids.to_vec(),
            x: all.clone().map(|index| coarse.position(index)).collect(),
            affine: all.map(|index| coarse.gradient(index)).collect(),
        }
    }

    /// Displacements [m] in `dt` [s] of the particles that still exist, with a part of their affine motion.
    pub fn samples(&self, now: &CoarseParticles<'_>, dt: f32, affine_share: f32) -> Vec<Sample<D>> {
        let mut samples = Vec::with_capacity(self.ids.len());
        let mut index = 0;
        for (then, id) in self.ids.iter().enumerate() {
            while index < now.ids.len() && now.ids[index] < *id {
                index += 1;
            }
            if now.ids.get(index) == Some(id) {
                let mean = (self.affine[then] + now.gradient(index)) * 0.5;
                samples.push(Sample {
                    x: self.x[then],
                    shift: now.position::<D>(index) - self.x[then],
                    gradient: mean * (affine_share * dt),
                    mass: now.mass[index],
                });
            }
        }
        samples
    }

    /// Present velocities `v`, N x D [m/s], with a part of the affine motion.
    pub fn velocities(now: &CoarseParticles<'_>, v: &[f32], affine_share: f32) -> Vec<Sample<D>> {
        (0..now.ids.len())
            .map(|index| Sample {
                x: now.position(index),
                shift: Vector::from_column_slice(&v[index * D..][..D]),
                gradient: now.gradient(index) * affine_share,
                mass: now.mass[index],
            })
            .collect()
    }
}
