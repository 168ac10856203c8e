//! Logarithm and exponential of symmetric matrices, for a block at once.
//!
//! A matrix A without trace obeys A^3 = q A + det(A) I with q = tr(A^2) / 2 (Cayley and Hamilton). A power series in A
//! therefore is c_0 I + c_1 A + c_2 A^2, and Horner's scheme for these three numbers needs no eigenvalues. Two
//! dimensions are three with a row and a column of zeros: det(A) = 0. Where a matrix is too large for few terms,
//! `Spectrum` takes over in its lane.

use super::eigen::{Spectrum, Symmetrics};
use super::lanes::{LANES, Lanes, exp, ln};

/// Symmetric matrices of a block, each as mean I + deviator.
#[derive(Debug, Clone, Copy)]
pub struct Split<const D: usize> {
    pub mean: Lanes,
    /// Without trace.
    pub deviator: Symmetrics<D>,
}

/// ln(1 + x) = x - x^2 / 2 + x^3 / 3 ...
const LOGARITHM: [f32; 13] = {
    let mut terms = [0.0; 13];
    let mut k = 1;
    while k < terms.len() {
        terms[k] = if k % 2 == 1 { 1.0 } else { -1.0 } / k as f32;
        k += 1;
    }
    terms
};
/// Up to this q eigenvalues are at most 0.26, and the next term of the logarithm is less than 2e-9.
const LARGEST_OF_LOGARITHM: f32 = 0.05;

/// e^x = 1 + x + x^2 / 2 + x^3 / 6 ...
const EXPONENTIAL: [f32; 8] = {
    let mut terms = [1.0; 8];
    let mut k = 1;
    while k < terms.len() {
        terms[k] = terms[k - 1] / k as f32;
        k += 1;
    }
    terms
};
/// Up to this q eigenvalues are at most 0.33, and the next term of the exponential is less than 4e-9.
const LARGEST_OF_EXPONENTIAL: f32 = 0.08;

/// Logarithms of matrices whose eigenvalues are positive; smaller ones than `smallest` are taken for it.
#[inline(always)]
pub fn logarithm<const D: usize>(a: &Symmetrics<D>, smallest: f32) -> Split<D> {
    // a = m (I + A) has the logarithm ln(m) I + ln(I + A).
    let split = Split::of(a);
    let mut relative = split.deviator;
    for i in 0..LANES {
        let inverse = 1.0 / split.mean[i];
        for k in 0..D {
            relative.diagonal[k][i] *= inverse;
            relative.shear[k][i] *= inverse;
        }
    }
    // Not `max`, which would hide a NaN.
    let floored = |x: f32| if x < smallest { smallest } else { x };
    let invariants = Invariants::of(&relative);
    let mut result = relative.series(&LOGARITHM, &invariants);
    for i in 0..LANES {
        result.mean[i] += ln(floored(split.mean[i]));
    }
    let near = invariants.within(LARGEST_OF_LOGARITHM);
    if all(&near) {
        return result;
    }
    let exact = Split::of(&Spectrum::of(a).map(|x| ln(floored(x))));
    exact.replace_by(&result, &near)
}

/// Exponentials.
#[inline(always)]
pub fn exponential<const D: usize>(a: &Split<D>) -> Symmetrics<D> {
    let invariants = Invariants::of(&a.deviator);
    let mut result = a.deviator.series(&EXPONENTIAL, &invariants);
    let near = invariants.within(LARGEST_OF_EXPONENTIAL);
    if !all(&near) {
        let exact = Split::of(&Spectrum::of(&a.deviator).map(exp));
        result = exact.replace_by(&result, &near);
    }
    let mut sum = result.deviator;
    for i in 0..LANES {
        let factor = exp(a.mean[i]);
        for k in 0..D {
            sum.diagonal[k][i] = (sum.diagonal[k][i] + result.mean[i]) * factor;
            sum.shear[k][i] *= factor;
        }
    }
    sum
}

impl<const D: usize> Split<D> {
    #[inline(always)]
    pub fn of(a: &Symmetrics<D>) -> Self {
        let mut split = Self {
            mean: [0.0; LANES],
            deviator: *a,
        };
        for i in 0..LANES {
            let mut trace = 0.0;
            for k in 0..D {
                trace += a.diagonal[k][i];
            }
            split.mean[i] = trace / D as f32;
            for k in 0..D {
                split.deviator.diagonal[k][i] -= split.mean[i];
            }
        }
        split
    }

    #[inline(always)]
    pub fn scaled(mut self, factor: f32) -> Self {
        for i in 0..LANES {
            self.mean[i] *= factor;
            for k in 0..D {
                self.deviator.diagonal[k][i] *= factor;
                self.deviator.shear[k][i] *= factor;
            }
        }
        self
    }

    /// Takes the lanes of `other` that are marked.
    #[inline(always)]
    fn replace_by(mut self, other: &Self, marked: &[bool; LANES]) -> Self {
        for i in 0..LANES {
            let pick = |mine: &mut f32, other: f32| *mine = if marked[i] { other } else { *mine };
            pick(&mut self.mean[i], other.mean[i]);
            for k in 0..D {
                pick(
                    &mut self.deviator.diagonal[k][i],
                    other.deviator.diagonal[k][i],
                );
                pick(&mut self.deviator.shear[k][i], other.deviator.shear[k][i]);
            }
        }
        self
    }
}

/// Operations of Horner's scheme on matrices without trace.
struct Invariants {
    /// tr(A^2) / 2.
    q: Lanes,
    /// det(A); 0 in two dimensions.
    determinant: Lanes,
}

impl Invariants {
    #[inline(always)]
    fn of<const D: usize>(a: &Symmetrics<D>) -> Self {
        let mut invariants = Self {
            q: a.half_norm_squared(),
            determinant: [0.0; LANES],
        };
        if D == 3 {
            invariants.determinant = a.determinant();
        }
        invariants
    }

    /// Of NaN it is false.
    #[inline(always)]
    fn within(&self, largest: f32) -> [bool; LANES] {
        self.q.map(|q| q <= largest)
    }
}

#[inline(always)]
fn all(marked: &[bool; LANES]) -> bool {
    marked.iter().fold(true, |all, &mark| all & mark)
}

impl<const D: usize> Symmetrics<D> {
    /// sum_k terms[k] A^k for matrices without trace.
    #[inline(always)]
    fn series<const N: usize>(&self, terms: &[f32; N], invariants: &Invariants) -> Split<D> {
        let square = Split::of(&self.squared());
        let mut result = Split {
            mean: [0.0; LANES],
            deviator: *self,
        };
        for i in 0..LANES {
            let (q, determinant) = (invariants.q[i], invariants.determinant[i]);
            let [mut c0, mut c1, mut c2] = [0.0; 3];
            for term in terms.iter().rev() {
                let above = if D == 3 {
                    term + c2 * determinant
                } else {
                    *term
                };
                (c0, c1, c2) = (above, c0 + c2 * q, c1);
            }
            result.mean[i] = c0 + c2 * square.mean[i];
            for k in 0..D {
                let (diagonal, shear) = (self.diagonal[k][i], self.shear[k][i]);
                result.deviator.diagonal[k][i] =
                    c1 * diagonal + c2 * square.deviator.diagonal[k][i];
                result.deviator.shear[k][i] = c1 * shear + c2 * square.deviator.shear[k][i];
            }
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, SymmetricEigen};
    use proptest::prelude::*;

    /// f(A) in double precision.
    fn exact<const D: usize>(
        a: impl Fn(usize, usize) -> f64,
        f: impl Fn(f64) -> f64,
    ) -> DMatrix<f64> {
        let spectrum = SymmetricEigen::new(DMatrix::from_fn(D, D, a));
        let values = spectrum.eigenvalues.map(f);
        &spectrum.eigenvectors * DMatrix::from_diagonal(&values) * spectrum.eigenvectors.transpose()
    }

    /// The logarithm of I + size * entries, and the exponential of size * entries, in the same lane.
    fn check<const D: usize>(entries: &[f32], size: f32) {
        let mut a = Symmetrics::<D>::ZERO;
        let mut b = Symmetrics::<D>::ZERO;
        for i in 0..LANES {
            // Other lanes contain other matrices, near and far ones.
            let size = size * (0.2 + 0.1 * i as f32);
            for k in 0..D {
                b.diagonal[k][i] = size * entries[k];
                a.diagonal[k][i] = 1.0 + b.diagonal[k][i];
                b.shear[k][i] = if D == 2 && k == 1 {
                    0.0
                } else {
                    0.5 * size * entries[D + k]
                };
                a.shear[k][i] = b.shear[k][i];
            }
        }
        let log = logarithm(&a, 1.0e-8);
        let power = exponential(&Split::of(&b));
        for i in 0..LANES {
            let (a, b, power) = (a.get(i), b.get(i), power.get(i));
            let at =
                |m: &super::super::math::Symmetric<D>, row, column| f64::from(m.at(row, column));
            let exact_log = exact::<D>(|row, column| at(&a, row, column), f64::ln);
            let exact_power = exact::<D>(|row, column| at(&b, row, column), f64::exp);
            // Rounding of a matrix near the identity is relative to the identity, not to the strain.
            let (of_log, of_power) = (1.0 + exact_log.amax().exp(), exact_power.amax());
            for (row, column) in (0..D).flat_map(|row| (0..D).map(move |column| (row, column))) {
                let mean = if row == column { log.mean[i] } else { 0.0 };
                let found = f64::from(mean) + at(&log.deviator.get(i), row, column);
                let missed = (found - exact_log[(row, column)]).abs();
                assert!(
                    missed <= 4.0e-7 * of_log,
                    "log misses by {missed:e} for {a:?}"
                );
                let missed = (at(&power, row, column) - exact_power[(row, column)]).abs();
                assert!(
                    missed <= 1.0e-6 * of_power,
                    "exp misses by {missed:e} for {b:?}"
                );
            }
        }
    }

    proptest! {
        #[test]
        fn agree_with_double_precision(entries in prop::collection::vec(-1.0f32..1.0, 6), size in -6.0f32..-0.5) {
            let size = 10.0f32.powf(size);
            check::<2>(&entries, size);
            check::<3>(&entries, size);
        }
    }

    #[test]
    fn special_matrices() {
        for size in [0.0, 1.0e-7, 0.1, 0.3] {
            check::<2>(&[1.0; 6], size);
            check::<3>(&[1.0, 1.0, 1.0, 0.0, 0.0, 0.0], size);
            check::<3>(&[1.0, -0.5, -0.5, 0.0, 0.0, 0.0], size);
            check::<3>(&[0.0, 0.0, 0.0, 1.0, 1.0, 1.0], size);
        }
    }

    #[test]
    fn what_is_no_number_stays_none() {
        let mut a = Symmetrics::<3>::ZERO;
        a.diagonal = [[1.0; LANES]; 3];
        a.shear[1][4] = f32::NAN;
        let log = logarithm(&a, 1.0e-8);
        assert!(log.deviator.shear[1][4].is_nan() && log.mean[3] == 0.0);
        assert!(exponential(&log).shear[1][4].is_nan());
    }
}
