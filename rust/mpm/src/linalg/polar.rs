//! Rotations of deformation gradients, for a block at once.
//!
//! F = R S has the rotation R nearest to F. In the plane it is (F + cof F) over its length. In space Newton's iteration finds
//! it (Higham 1986, doi:10.1137/0907079): X' = (X + X^-T) / 2 takes each singular value s to (s + 1 / s) / 2, and so to 1.

use super::lanes::{LANES, Lanes};

/// Squared length of the last step below which rounding is all that is left: the error of X' is half the square of that of X.
const CONVERGED: f32 = 4.0e-8;
/// Most steps. Strains of a percent need two, and each halves what is far from 1.
const MOST_STEPS: usize = 48;

/// Rotations of matrices by row and column, whose determinants are positive; of others NaN.
#[inline(always)]
pub fn rotations<const D: usize>(f: &[[Lanes; D]; D]) -> [[Lanes; D]; D] {
    let mut rotations = *f;
    if D == 2 {
        for i in 0..LANES {
            let (a, b) = (f[0][0][i] + f[1][1][i], f[1][0][i] - f[0][1][i]);
            let determinant = f[0][0][i] * f[1][1][i] - f[0][1][i] * f[1][0][i];
            let length = if determinant > 0.0 {
                (a * a + b * b).sqrt()
            } else {
                f32::NAN
            };
            let (cosine, sine) = (a / length, b / length);
            rotations[0][0][i] = cosine;
            rotations[0][1][i] = -sine;
            rotations[1][0][i] = sine;
            rotations[1][1][i] = cosine;
        }
        return rotations;
    }
    let mut last_step = [f32::INFINITY; LANES];
    for _ in 0..MOST_STEPS {
        step(&mut rotations, &mut last_step);
        let mut moves = false;
        for length_squared in &last_step {
            moves |= *length_squared > CONVERGED;
        }
        if !moves {
            break;
        }
    }
    rotations
}

/// One step of Newton's iteration in lanes that have not converged, so that none depends on its neighbours.
#[inline(always)]
fn step<const D: usize>(x: &mut [[Lanes; D]; D], last_step: &mut Lanes) {
    for i in 0..LANES {
        let entry = |row: usize, column: usize| x[row % 3][column % 3][i];
        let mut cofactors = [[0.0; 3]; 3];
        for row in 0..3 {
            for column in 0..3 {
                let (down, across) = (row + 1, column + 1);
                cofactors[row][column] = entry(down, across) * entry(down + 1, across + 1)
                    - entry(down, across + 1) * entry(down + 1, across);
            }
        }
        let determinant = entry(0, 0) * cofactors[0][0]
            + entry(0, 1) * cofactors[0][1]
            + entry(0, 2) * cofactors[0][2];
        let inverse = 1.0
            / if determinant > 0.0 {
                determinant
            } else {
                f32::NAN
            };
        // False for NaN.
        let moves = last_step[i] > CONVERGED;
        let mut length_squared = 0.0;
        for row in 0..D {
            for column in 0..D {
                let before = x[row][column][i];
                let change = 0.5 * (cofactors[row][column] * inverse - before);
                length_squared += change * change;
                x[row][column][i] = if moves { before + change } else { before };
            }
        }
        last_step[i] = if moves { length_squared } else { 0.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::{Matrix, determinant};
    use proptest::prelude::*;

    /// The matrix is in one lane, others beside it.
    fn rotation<const D: usize>(f: &Matrix<D>) -> Matrix<D> {
        let lanes: [[Lanes; D]; D] = std::array::from_fn(|row| {
            std::array::from_fn(|column| {
                let mut lanes = [if row == column { 1.0 } else { 0.0 }; LANES];
                lanes[3] = f[(row, column)];
                lanes[7] = f32::NAN;
                lanes
            })
        });
        let found = rotations(&lanes);
        assert!(found[0][0][7].is_nan() && found[0][0][0] == 1.0);
        Matrix::from_fn(|row, column| found[row][column][3])
    }

    /// For matrices whose singular values are at least a share of the largest.
    fn check<const D: usize>(f: &Matrix<D>, share: f32) {
        let r = rotation(f);
        if determinant(f) <= 0.0 {
            assert!(r.iter().all(|entry| entry.is_nan()), "{f}");
            return;
        }
        let defect = (r.transpose() * r - Matrix::identity()).amax();
        assert!(defect < 1.0e-6, "R is not orthogonal by {defect:e} for {f}");
        assert!(determinant(&r) > 0.0);
        let stretch = r.transpose() * f;
        let defect = (stretch - stretch.transpose()).amax() / f.amax();
        assert!(
            defect < 1.0e-6 / share,
            "S is not symmetric by {defect:e} for {f}"
        );
        // Positive, and so R is no other rotation with a symmetric S.
        assert!(
            stretch.trace() > 0.0 && stretch.trace() >= 0.99 * f.norm(),
            "{f}"
        );
    }

    fn entries<const D: usize>() -> impl Strategy<Value = Matrix<D>> {
        prop::collection::vec(-1.0f32..1.0, D * D).prop_map(|v| Matrix::from_row_slice(&v))
    }

    fn is_regular<const D: usize>(f: &Matrix<D>) -> bool {
        determinant(f).abs() > 0.05 * f.amax().powi(D as i32)
    }

    proptest! {
        #[test]
        fn rotates_what_is_far_from_the_identity(a in entries::<2>(), b in entries::<3>(), exponent in -8i32..=8) {
            prop_assume!(is_regular(&a) && is_regular(&b));
            check(&(a * 10.0f32.powi(exponent)), 0.02);
            check(&(b * 10.0f32.powi(exponent)), 0.02);
        }

        #[test]
        fn near_rotations_keep_small_strains(a in entries::<3>(), b in entries::<3>(), size in -7.0f32..-1.0) {
            prop_assume!(is_regular(&a) && determinant(&a) > 0.0);
            let (strain, turn) = (b * 10.0f32.powf(size), rotation(&a));
            let strain = (strain + strain.transpose()) * 0.5;
            let found = rotation(&(turn * (Matrix::identity() + strain)));
            prop_assert!((found - turn).amax() < 8.0e-7, "{}", (found - turn).amax());
        }
    }

    #[test]
    fn special_matrices() {
        // The second is one whose singular values nalgebra gets wrong.
        for f in [
            Matrix::<3>::identity(),
            Matrix::<3>::new(1.0, 2.0, 2.0, 2.0, -1.0, -1.0, 2.0, 1.0, -1.0),
            Matrix::<3>::from_diagonal(&[1.0, 1.0, 1.0e-3].into()),
            Matrix::<3>::from_diagonal(&[30.0, 2.0, 0.1].into()),
            Matrix::<3>::zeros(),
            -Matrix::<3>::identity(),
        ] {
            check(&f, 1.0e-3);
        }
        check(&Matrix::<2>::new(0.0, -1.0, 1.0, 0.0), 1.0);
        check(&(-Matrix::<2>::identity()), 1.0);
        check(&Matrix::<2>::new(1.0, 0.0, 0.0, -1.0), 1.0);
    }
}
