//! Fixed-size types, and the few operations whose formula depends on the dimension.

use nalgebra::{SMatrix, SVector};
use wide::f32x4;

/// A point or vector of D components.
pub type Vector<const D: usize> = SVector<f32, D>;
/// A D x D matrix.
pub type Matrix<const D: usize> = SMatrix<f32, D, D>;

/// A vector in the first D lanes; what the others hold is said where it is stored.
#[inline(always)]
pub fn lanes<const D: usize>(v: &Vector<D>, last: f32) -> f32x4 {
    let mut lanes = [0.0; 4];
    lanes[..D].copy_from_slice(v.as_slice());
    lanes[3] = last;
    f32x4::from(lanes)
}

/// The first D lanes.
#[inline(always)]
pub fn vector<const D: usize>(lanes: f32x4) -> Vector<D> {
    let lanes = lanes.to_array();
    Vector::from_fn(|axis, _| lanes[axis])
}

/// The columns of a matrix, each in the first D lanes with zeros behind: the form in which the transfers
/// use it, so that they need not take it apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Columns<const D: usize>(pub [f32x4; D]);

impl<const D: usize> Columns<D> {
    pub const ZERO: Self = Self([f32x4::ZERO; D]);

    #[inline(always)]
    pub fn from_matrix(m: &Matrix<D>) -> Self {
        Self(std::array::from_fn(|k| {
            lanes(&m.column(k).into_owned(), 0.0)
        }))
    }

    /// A multiple of the identity.
    #[inline(always)]
    pub fn diagonal(value: f32) -> Self {
        Self(std::array::from_fn(|k| {
            f32x4::from(std::array::from_fn(
                |lane| if lane == k { value } else { 0.0 },
            ))
        }))
    }

    #[inline(always)]
    pub fn matrix(&self) -> Matrix<D> {
        Matrix::from_columns(&self.0.map(vector))
    }

    #[inline(always)]
    pub fn trace(&self) -> f32 {
        (0..D).map(|k| self.0[k].to_array()[k]).sum()
    }
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
