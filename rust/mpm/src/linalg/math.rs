//! Fixed-size types, and the few operations whose formula depends on the dimension.

use nalgebra::{SMatrix, SVector};
use wide::f32x4;

/// A point or vector of D components.
pub type Vector<const D: usize> = SVector<f32, D>;
/// A D x D matrix.
pub type Matrix<const D: usize> = SMatrix<f32, D, D>;

/// A vector in the first D lanes, zeros behind, and `last` in the last.
#[inline(always)]
pub fn lanes<const D: usize>(v: &Vector<D>, last: f32) -> f32x4 {
    let mut lanes = [0.0; 4];
    lanes[..D].copy_from_slice(v.as_slice());
    lanes[3] = last;
    f32x4::from(lanes)
}

/// Length of the vector with these components.
#[inline(always)]
pub fn norm(components: &[f32]) -> f32 {
    components.iter().map(|s| s * s).sum::<f32>().sqrt()
}

/// det M. nalgebra's needs concrete sizes.
#[inline(always)]
pub fn determinant<const D: usize>(m: &Matrix<D>) -> f32 {
    match D {
        2 => m[(0, 0)] * m[(1, 1)] - m[(0, 1)] * m[(1, 0)],
        3 => {
            m[(0, 0)] * (m[(1, 1)] * m[(2, 2)] - m[(1, 2)] * m[(2, 1)])
                - m[(0, 1)] * (m[(1, 0)] * m[(2, 2)] - m[(1, 2)] * m[(2, 0)])
                + m[(0, 2)] * (m[(1, 0)] * m[(2, 1)] - m[(1, 1)] * m[(2, 0)])
        }
        _ => unreachable!("only 2 and 3 dimensions are built"),
    }
}

/// A symmetric matrix without its lower half.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Symmetric<const D: usize> {
    pub diagonal: Vector<D>,
    /// yz, zx, xy in three dimensions; xy and an unused zero in two.
    pub shear: Vector<D>,
}

impl<const D: usize> Symmetric<D> {
    #[inline(always)]
    pub fn diagonal(value: f32) -> Self {
        Self {
            diagonal: Vector::from_element(value),
            shear: Vector::zeros(),
        }
    }

    #[inline(always)]
    pub fn at(&self, row: usize, column: usize) -> f32 {
        if row == column {
            self.diagonal[row]
        } else {
            self.shear[shear_index::<D>(row, column)]
        }
    }

    #[inline(always)]
    pub fn determinant(&self) -> f32 {
        let (d, s) = (&self.diagonal, &self.shear);
        match D {
            2 => d[0] * d[1] - s[0] * s[0],
            _ => {
                d[0] * (d[1] * d[2] - s[0] * s[0]) - d[1] * s[1] * s[1] - d[2] * s[2] * s[2]
                    + 2.0 * s[0] * s[1] * s[2]
            }
        }
    }
}

/// Index in `Symmetric::shear` of an entry off the diagonal.
#[inline(always)]
pub fn shear_index<const D: usize>(row: usize, column: usize) -> usize {
    if D == 3 { 3 - row - column } else { 0 }
}
