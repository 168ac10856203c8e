//! Fixed-size types, and the few operations whose formula depends on the dimension.

use nalgebra::{SMatrix, SVector};

/// A point or vector of D components.
pub type Vector<const D: usize> = SVector<f32, D>;
/// A D x D matrix.
pub type Matrix<const D: usize> = SMatrix<f32, D, D>;

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
