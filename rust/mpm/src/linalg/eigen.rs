//! Eigenvalues of symmetric matrices and the projections onto their eigenvectors, for a block at once.

use super::lanes::{LANES, Lanes};
use super::math::{Symmetric, shear_index};

/// Symmetric matrices of a block, laid out like `Symmetric`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Symmetrics<const D: usize> {
    pub diagonal: [Lanes; D],
    pub shear: [Lanes; D],
}

impl<const D: usize> Symmetrics<D> {
    pub const ZERO: Self = Self {
        diagonal: [[0.0; LANES]; D],
        shear: [[0.0; LANES]; D],
    };

    #[inline(always)]
    pub fn get(&self, lane: usize) -> Symmetric<D> {
        Symmetric {
            diagonal: super::math::Vector::from_fn(|k, _| self.diagonal[k][lane]),
            shear: super::math::Vector::from_fn(|k, _| self.shear[k][lane]),
        }
    }

    #[inline(always)]
    pub fn set(&mut self, lane: usize, value: &Symmetric<D>) {
        for k in 0..D {
            self.diagonal[k][lane] = value.diagonal[k];
            self.shear[k][lane] = value.shear[k];
        }
    }

    /// F A F^T with F = I + dt C, C by row and column.
    #[inline(always)]
    pub fn deformed(&self, gradient: &[[Lanes; D]; D], dt: f32) -> Self {
        let mut result = Self::ZERO;
        for i in 0..LANES {
            let a = self.get(i);
            let (mut f, mut product) = ([[0.0; D]; D], [[0.0; D]; D]);
            for row in 0..D {
                for column in 0..D {
                    let identity = if row == column { 1.0 } else { 0.0 };
                    f[row][column] = identity + dt * gradient[row][column][i];
                }
            }
            for row in 0..D {
                for column in 0..D {
                    for k in 0..D {
                        product[row][column] += f[row][k] * a.at(k, column);
                    }
                }
            }
            for row in 0..D {
                for k in 0..D {
                    result.diagonal[row][i] += product[row][k] * f[row][k];
                }
                for column in row + 1..D {
                    for k in 0..D {
                        let entry = product[row][k] * f[column][k];
                        result.shear[shear_index::<D>(row, column)][i] += entry;
                    }
                }
            }
        }
        result
    }

    /// A A.
    #[inline(always)]
    pub fn squared(&self) -> Self {
        let mut result = Self::ZERO;
        for i in 0..LANES {
            let a = self.get(i);
            for row in 0..D {
                for k in 0..D {
                    result.diagonal[row][i] += a.at(row, k) * a.at(row, k);
                }
                for column in row + 1..D {
                    for k in 0..D {
                        let entry = a.at(row, k) * a.at(k, column);
                        result.shear[shear_index::<D>(row, column)][i] += entry;
                    }
                }
            }
        }
        result
    }

    /// tr(A A) / 2.
    #[inline(always)]
    pub fn half_norm_squared(&self) -> Lanes {
        let mut sum = [0.0; LANES];
        for i in 0..LANES {
            let (mut diagonal, mut shear) = (0.0, 0.0);
            for k in 0..D {
                diagonal += self.diagonal[k][i] * self.diagonal[k][i];
                shear += self.shear[k][i] * self.shear[k][i];
            }
            sum[i] = 0.5 * diagonal + shear;
        }
        sum
    }

    #[inline(always)]
    pub fn determinant(&self) -> Lanes {
        let mut determinants = [0.0; LANES];
        for i in 0..LANES {
            determinants[i] = self.get(i).determinant();
        }
        determinants
    }
}

/// Eigenvalues in no order, and the projection that belongs to each.
pub struct Spectrum<const D: usize> {
    pub values: [Lanes; D],
    pub projections: [Symmetrics<D>; D],
}

/// More sweeps of three rotations than any matrix of float32 needs.
const MAX_SWEEPS: usize = 8;

impl<const D: usize> Spectrum<D> {
    #[inline(always)]
    pub fn of(a: &Symmetrics<D>) -> Self {
        let mut spectrum = Self {
            values: [[0.0; LANES]; D],
            projections: [Symmetrics::ZERO; D],
        };
        if D == 2 {
            spectrum.solve_plane(a);
        } else {
            spectrum.solve_space(a);
        }
        spectrum
    }

    /// f(A) = sum_k f(lambda_k) P_k.
    #[inline(always)]
    pub fn map(&self, f: impl Fn(f32) -> f32) -> Symmetrics<D> {
        let mut sum = Symmetrics::ZERO;
        for (values, projection) in self.values.iter().zip(&self.projections) {
            for i in 0..LANES {
                let value = f(values[i]);
                for k in 0..D {
                    sum.diagonal[k][i] += projection.diagonal[k][i] * value;
                    sum.shear[k][i] += projection.shear[k][i] * value;
                }
            }
        }
        sum
    }

    /// lambda = m +- r with P = (1 +- (A - m) / r) / 2.
    #[inline(always)]
    fn solve_plane(&mut self, a: &Symmetrics<D>) {
        for i in 0..LANES {
            let (p, q, s) = (a.diagonal[0][i], a.diagonal[D - 1][i], a.shear[0][i]);
            let (mean, half) = (0.5 * (p + q), 0.5 * (p - q));
            let radius = (half * half + s * s).sqrt();
            // Equal values: any direction will do.
            let equal = radius < 1.0e-18;
            let inverse = 0.5 / if equal { 1.0 } else { radius };
            let (cosine, sine) = (if equal { 0.5 } else { half * inverse }, s * inverse);
            self.values[0][i] = mean + radius;
            self.values[D - 1][i] = mean - radius;
            self.projections[0].diagonal[0][i] = 0.5 + cosine;
            self.projections[0].diagonal[D - 1][i] = 0.5 - cosine;
            self.projections[0].shear[0][i] = sine;
            self.projections[D - 1].diagonal[0][i] = 0.5 - cosine;
            self.projections[D - 1].diagonal[D - 1][i] = 0.5 + cosine;
            self.projections[D - 1].shear[0][i] = -sine;
        }
    }

    /// Cyclic Jacobi rotations. A lane that has converged is turned no further, whatever its neighbours do.
    #[inline(always)]
    fn solve_space(&mut self, a: &Symmetrics<D>) {
        let mut a = *a;
        let mut vectors = [[[0.0; LANES]; D]; D];
        for (k, column) in vectors.iter_mut().enumerate() {
            column[k] = [1.0; LANES];
        }
        for _ in 0..MAX_SWEEPS {
            let mut turned = [0u32; LANES];
            rotate(&mut a, &mut vectors, [0, 1, 2], &mut turned);
            rotate(&mut a, &mut vectors, [0, 2, 1], &mut turned);
            rotate(&mut a, &mut vectors, [1, 2, 0], &mut turned);
            if turned.iter().all(|&turned| turned == 0) {
                break;
            }
        }
        self.values = a.diagonal;
        for k in 0..D {
            let (u, projection) = (&vectors[k], &mut self.projections[k]);
            for i in 0..LANES {
                for axis in 0..D {
                    projection.diagonal[axis][i] = u[axis][i] * u[axis][i];
                    let (row, column) = ((axis + 1) % 3, (axis + 2) % 3);
                    projection.shear[axis][i] = u[row % D][i] * u[column % D][i];
                }
            }
        }
    }
}

/// Turns axes p and q until their shear vanishes; `vectors[k]` is the k-th eigenvector so far.
#[inline(always)]
fn rotate<const D: usize>(
    a: &mut Symmetrics<D>,
    vectors: &mut [[Lanes; D]; D],
    [p, q, other]: [usize; 3],
    turned: &mut [u32; LANES],
) {
    // Of three dimensions; the modulo keeps the compiler of the plane's code content.
    let (p, q, other) = (p % D, q % D, other % D);
    for i in 0..LANES {
        let (app, aqq, apq) = (a.diagonal[p][i], a.diagonal[q][i], a.shear[other][i]);
        let (apr, aqr) = (a.shear[q][i], a.shear[p][i]);
        let small = apq.abs() <= 3.0e-8 * (app.abs() + aqq.abs());
        // The smaller root of t^2 + 2 theta t - 1 = 0 with theta = (aqq - app) / (2 apq), without cancellation.
        let difference = aqq - app;
        let root = (difference * difference + 4.0 * apq * apq).sqrt();
        let t = 2.0 * apq
            / if small {
                1.0
            } else {
                difference + root.copysign(difference)
            };
        let t = if small { 0.0 } else { t };
        let c = 1.0 / (1.0 + t * t).sqrt();
        let s = c * t;
        turned[i] |= u32::from(!small);
        a.diagonal[p][i] = app - t * apq;
        a.diagonal[q][i] = aqq + t * apq;
        a.shear[other][i] = if small { apq } else { 0.0 };
        a.shear[q][i] = c * apr - s * aqr;
        a.shear[p][i] = s * apr + c * aqr;
        for axis in 0..D {
            let (u, w) = (vectors[p][axis][i], vectors[q][axis][i]);
            vectors[p][axis][i] = c * u - s * w;
            vectors[q][axis][i] = s * u + c * w;
        }
    }
}
