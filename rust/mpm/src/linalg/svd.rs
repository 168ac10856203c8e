//! Singular value decomposition of small matrices by one-sided Jacobi rotations (Hestenes 1958).
//!
//! The columns of A V are rotated in pairs until they are orthogonal. A^T A is never formed, so small
//! singular values keep their relative accuracy. nalgebra's own SVD returns wrong singular values for
//! some full-rank 3 x 3 matrices (its issue 1172); the tests hold one of them.

use super::math::{Matrix, Vector};

/// A = U diag(sigma) V^T.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Svd<const D: usize> {
    /// Orthogonal.
    pub u: Matrix<D>,
    /// Descending, none negative.
    pub sigma: Vector<D>,
    /// Orthogonal.
    pub v: Matrix<D>,
}

/// Three columns converge quadratically, in at most six sweeps. Two need one rotation.
const MAX_SWEEPS: usize = 8;
/// Columns count as orthogonal when |a . b| <= this |a| |b|.
const ORTHOGONAL: f32 = 1.0e-7;

/// Decomposes a finite matrix of any rank and scale; zeros come out for a matrix that is not finite.
#[inline]
pub fn svd<const D: usize>(a: &Matrix<D>) -> Svd<D> {
    let scale = a.amax();
    if !(scale > 0.0 && scale.is_finite()) {
        return Svd {
            u: Matrix::identity(),
            sigma: Vector::zeros(),
            v: Matrix::identity(),
        };
    }
    // Scaled to entries of at most one, squares neither overflow nor vanish beside each other.
    let mut columns = a.map(|entry| entry / scale);
    let mut v = Matrix::<D>::identity();
    if D == 2 {
        to_principal_axes(&mut columns, &mut v);
    } else {
        for _ in 0..MAX_SWEEPS {
            if !sweep(&mut columns, &mut v) {
                break;
            }
        }
        sort_columns(&mut columns, &mut v);
    }
    let (u, sigma) = normalise(&columns);
    Svd {
        u,
        sigma: sigma * scale,
        v,
    }
}

/// Makes two columns orthogonal, the longer one first. Without branches: nothing predicts which stretch
/// of a nearly undeformed particle is the larger.
#[inline(always)]
fn to_principal_axes<const D: usize>(columns: &mut Matrix<D>, v: &mut Matrix<D>) {
    let (a, b) = (columns.column(0), columns.column(1));
    let (difference, gamma) = (a.norm_squared() - b.norm_squared(), a.dot(&b));
    let root = (difference * difference + 4.0 * gamma * gamma)
        .sqrt()
        .max(f32::MIN_POSITIVE);
    // Cosine and sine of half the angle whose tangent is 2 gamma / difference, the larger one first. Columns
    // are of order one here: with a root this small they are equally long and orthogonal already.
    let ratio = if root > 1.0e-15 {
        difference.abs() / root
    } else {
        1.0
    };
    let larger = (0.5 + 0.5 * ratio).sqrt();
    let smaller = if root > 1.0e-15 {
        gamma.abs() / (root * larger)
    } else {
        0.0
    };
    let (c, s) = if difference >= 0.0 {
        (larger, smaller)
    } else {
        (smaller, larger)
    };
    let s = -s.copysign(gamma);
    rotate(columns, 0, 1, c, s);
    rotate(v, 0, 1, c, s);
}

/// Rotates each pair of columns once; false when all were orthogonal already.
#[inline]
fn sweep<const D: usize>(columns: &mut Matrix<D>, v: &mut Matrix<D>) -> bool {
    let mut rotated = false;
    for p in 0..D {
        for q in p + 1..D {
            rotated |= orthogonalise(columns, v, p, q);
        }
    }
    rotated
}

/// Rotates columns p and q into each other until they are orthogonal; false when they were.
#[inline(always)]
fn orthogonalise<const D: usize>(
    columns: &mut Matrix<D>,
    v: &mut Matrix<D>,
    p: usize,
    q: usize,
) -> bool {
    let (a, b) = (columns.column(p), columns.column(q));
    let (alpha, beta, gamma) = (a.norm_squared(), b.norm_squared(), a.dot(&b));
    if gamma.abs() <= ORTHOGONAL * (alpha * beta).sqrt() {
        return false;
    }
    // The smaller root of gamma t^2 + (beta - alpha) t - gamma = 0, without cancellation.
    let difference = beta - alpha;
    let root = (difference * difference + 4.0 * gamma * gamma).sqrt();
    let t = 2.0 * gamma / (difference + root.copysign(difference));
    let c = 1.0 / (1.0 + t * t).sqrt();
    rotate(columns, p, q, c, c * t);
    rotate(v, p, q, c, c * t);
    true
}

#[inline]
fn rotate<const D: usize>(m: &mut Matrix<D>, p: usize, q: usize, c: f32, s: f32) {
    for row in 0..D {
        let (a, b) = (m[(row, p)], m[(row, q)]);
        m[(row, p)] = c * a - s * b;
        m[(row, q)] = s * a + c * b;
    }
}

#[inline]
fn sort_columns<const D: usize>(columns: &mut Matrix<D>, v: &mut Matrix<D>) {
    for end in (1..D).rev() {
        for p in 0..end {
            if columns.column(p).norm_squared() < columns.column(p + 1).norm_squared() {
                columns.swap_columns(p, p + 1);
                v.swap_columns(p, p + 1);
            }
        }
    }
}

/// Column norms, and an orthogonal matrix of their directions; columns of no length are completed.
#[inline]
fn normalise<const D: usize>(columns: &Matrix<D>) -> (Matrix<D>, Vector<D>) {
    let mut u = Matrix::<D>::zeros();
    let mut sigma = Vector::<D>::zeros();
    for j in 0..D - 1 {
        let norm = columns.column(j).norm();
        // Below this the direction is rounding noise of the larger columns.
        let direction = if norm > 1.0e-6 * columns.column(0).norm() {
            let mut direction = columns.column(j) / norm;
            for k in 0..j {
                // Orthogonalised again to the larger ones, because the error of rotations is relative to those.
                direction -= u.column(k) * u.column(k).dot(&direction);
            }
            if j > 0 {
                direction.normalize()
            } else {
                direction
            }
        } else {
            completion(&u, j)
        };
        sigma[j] = norm;
        u.set_column(j, &direction);
    }
    // Only the sign of the last direction is open.
    let last = complement(&u);
    let along = columns.column(D - 1).dot(&last);
    // Rounding must not put two equal values out of order.
    sigma[D - 1] = along.abs().min(sigma[D - 2]);
    u.set_column(D - 1, &(last * 1.0f32.copysign(along)));
    (u, sigma)
}

/// The unit vector orthogonal to all columns of u but the last.
#[inline(always)]
fn complement<const D: usize>(u: &Matrix<D>) -> Vector<D> {
    Vector::from_fn(|axis, _| match (D, axis) {
        (2, 0) => -u[(1, 0)],
        (2, _) => u[(0, 0)],
        _ => {
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            u[(i, 0)] * u[(j, 1)] - u[(j, 0)] * u[(i, 1)]
        }
    })
}

/// A unit vector orthogonal to the first `count` columns of u: the axis that they cover least.
#[cold]
fn completion<const D: usize>(u: &Matrix<D>, count: usize) -> Vector<D> {
    let mut best = Vector::<D>::zeros();
    for axis in 0..D {
        let mut candidate = Vector::<D>::zeros();
        candidate[axis] = 1.0;
        for k in 0..count {
            candidate -= u.column(k) * u[(axis, k)];
        }
        if candidate.norm_squared() > best.norm_squared() {
            best = candidate;
        }
    }
    for k in 0..count {
        best -= u.column(k) * u.column(k).dot(&best);
    }
    best.normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn check<const D: usize>(a: &Matrix<D>) {
        let Svd { u, sigma, v } = svd(a);
        let scale = a.amax().max(f32::MIN_POSITIVE);
        for (name, q) in [("U", u), ("V", v)] {
            let defect = (q.transpose() * q - Matrix::identity()).amax();
            assert!(
                defect < 2.0e-6,
                "{name} is not orthogonal by {defect:e} for {a}"
            );
        }
        for j in 0..D {
            assert!(sigma[j] >= 0.0);
            assert!(
                j == 0 || sigma[j] <= sigma[j - 1],
                "{sigma} is not sorted for {a}"
            );
        }
        let unit = a / scale;
        let scaled = sigma / scale;
        let defect = (u * Matrix::from_diagonal(&scaled) * v.transpose() - unit).amax();
        assert!(
            defect < 4.0e-6,
            "U S V^T misses A by {defect:e} of its size for {a}"
        );
        let (sum, norm) = (scaled.norm_squared(), unit.norm_squared());
        assert!(
            (sum - norm).abs() <= 4.0e-6 * norm,
            "sum sigma^2 = {sum}, |A|^2 = {norm}"
        );
    }

    #[test]
    fn matrices_within_rounding_of_a_rotation_come_apart_into_rotations() {
        for exponent in -20..-5 {
            let small = 10.0f32.powi(exponent);
            for sign in [1.0, -1.0] {
                check(&Matrix::<2>::new(1.0, small, sign * small, 1.0));
                check(&Matrix::<2>::new(1.0, small, 0.0, 1.0 - 6.0e-8));
                check(&Matrix::<3>::new(
                    1.0,
                    small,
                    0.0,
                    sign * small,
                    1.0,
                    small,
                    0.0,
                    0.0,
                    1.0,
                ));
            }
        }
    }

    #[test]
    fn the_matrix_that_nalgebra_gets_wrong() {
        let a = Matrix::<3>::new(1.0, 2.0, 2.0, 2.0, -1.0, -1.0, 2.0, 1.0, -1.0);
        check(&a);
        let sum = svd(&a).sigma.norm_squared();
        assert!((sum - 21.0).abs() < 1.0e-4, "sum sigma^2 = {sum}, not 21");
    }

    #[test]
    fn equal_values_and_special_matrices() {
        check(&Matrix::<2>::identity());
        check(&Matrix::<3>::identity());
        check(&(-Matrix::<3>::identity()));
        check(&Matrix::<3>::zeros());
        check(&Matrix::<3>::from_element(1.0));
        check(&Matrix::<3>::from_diagonal(&Vector::<3>::new(
            2.0, 2.0, 1.0e-5,
        )));
        check(&Matrix::<3>::from_diagonal(&Vector::<3>::new(
            0.0, 3.0, 3.0,
        )));
    }

    fn entries<const D: usize>() -> impl Strategy<Value = Matrix<D>> {
        prop::collection::vec(-1.0f32..1.0, D * D).prop_map(|v| Matrix::from_row_slice(&v))
    }

    fn of_rank<const D: usize>(rank: usize) -> impl Strategy<Value = Matrix<D>> {
        prop::collection::vec((-1.0f32..1.0, -1.0f32..1.0), D * rank).prop_map(move |pairs| {
            pairs.chunks(D).fold(Matrix::zeros(), |sum, column| {
                let a = Vector::<D>::from_fn(|i, _| column[i].0);
                let b = Vector::<D>::from_fn(|i, _| column[i].1);
                sum + a * b.transpose()
            })
        })
    }

    proptest! {
        #[test]
        fn decomposes_2x2(a in entries::<2>()) { check(&a); }

        #[test]
        fn decomposes_3x3(a in entries::<3>()) { check(&a); }

        #[test]
        fn decomposes_low_rank(a in of_rank::<3>(1), b in of_rank::<3>(2), c in of_rank::<2>(1)) {
            check(&a);
            check(&b);
            check(&c);
        }

        #[test]
        fn decomposes_any_scale(a in entries::<3>(), b in entries::<2>(), exponent in -30i32..=30) {
            check(&(a * 10.0f32.powi(exponent)));
            check(&(b * 10.0f32.powi(exponent)));
        }

        #[test]
        fn near_rotations_keep_small_strains(a in entries::<3>(), size in -7.0f32..-2.0) {
            check(&(Matrix::identity() + a * 10.0f32.powf(size)));
        }
    }
}
