//! Elastic solids.

use super::constitutive::{Constitutive, State, Volumes};
use super::lame::Lame;
use crate::linalg::{LANES, Lanes, Matrix, Symmetric, Symmetrics, Vector, determinant, ln, svd};
use serde::{Deserialize, Serialize};

/// Fixed-corotated solid (Stomakhin et al. 2012) with a barrier against collapse. Its state is F.
///
/// The energy mu |F - R|^2 + lambda / 2 (J - 1)^2 stays finite as J vanishes: what has been pressed so far never
/// comes back. Below J_b it therefore gains (lambda + 2 mu) / 4 ln^2(J / J_b), which no pressure exhausts. Its share
/// of tau, (lambda + 2 mu) / 2 ln(J / J_b), is as stiff in ln J everywhere, so the substep need not shrink.
///
/// For lambda < 0 the second term has no lower bound. There lambda / 2 tr(S - I)^2 replaces it, with the stretches S: equal
/// at small strains, and positive together with the first at all.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Elastic {
    pub lame: Lame,
}

/// F of a block, by row and column.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub struct GradientBlock<const D: usize>([[Lanes; D]; D]);

impl Elastic {
    /// J_b: above it nothing changes.
    const BARRIER: f32 = 0.5;

    /// Squared norm of dt C above which a substep follows the flow through its own duration: I + dt C may turn matter
    /// inside out.
    const LARGE_CHANGE: f32 = 0.25;

    fn barrier_modulus(&self) -> f32 {
        0.25 * (self.lame.lambda + 2.0 * self.lame.mu)
    }

    /// ln(J / J_b) below J_b, else 0. NaN and what is inverted have to stay visible: they give NaN.
    fn collapse(j: f32) -> f32 {
        if j >= Self::BARRIER {
            0.0
        } else if j > 0.0 {
            ln(j / Self::BARRIER)
        } else {
            f32::NAN
        }
    }

    /// The stress for lambda < 0; apart, for it would slow the other down.
    #[inline(never)]
    fn auxetic_stress<const D: usize>(&self, states: &GradientBlock<D>) -> Symmetrics<D> {
        let Lame { mu, lambda } = self.lame;
        let mut stress = Symmetrics::ZERO;
        for i in 0..LANES {
            let f = Matrix::load(states, i);
            let parts = svd(&f);
            let rotation = parts.u * parts.v.transpose();
            let barrier = 2.0 * self.barrier_modulus() * Self::collapse(determinant(&f));
            let tau = (f - rotation) * f.transpose() * (2.0 * mu)
                + rotation * f.transpose() * (lambda * strain(&parts.sigma).sum())
                + Matrix::from_diagonal_element(barrier);
            stress.set(i, &Symmetric::from_fn(|row, column| tau[(row, column)]));
        }
        stress
    }
}

impl<const D: usize> Constitutive<D> for Elastic {
    type State = Matrix<D>;

    fn initial_state(&self, volume_ratio: f32) -> Matrix<D> {
        Matrix::from_diagonal_element(volume_ratio.powf(1.0 / D as f32))
    }

    // The decomposition has branches, so particles go one by one; apart, that the transfer stays wide.
    #[inline(never)]
    fn kirchhoff_stress(&self, states: &GradientBlock<D>) -> Symmetrics<D> {
        if self.lame.lambda < 0.0 {
            return self.auxetic_stress(states);
        }
        let Lame { mu, lambda } = self.lame;
        let mut stress = Symmetrics::ZERO;
        for i in 0..LANES {
            let f = Matrix::load(states, i);
            let parts = svd(&f);
            let rotation = parts.u * parts.v.transpose();
            let j = determinant(&f);
            let tau = (f - rotation) * f.transpose() * (2.0 * mu)
                + Matrix::from_diagonal_element(
                    lambda * j * (j - 1.0) + 2.0 * self.barrier_modulus() * Self::collapse(j),
                );
            stress.set(i, &Symmetric::from_fn(|row, column| tau[(row, column)]));
        }
        stress
    }

    #[inline(always)]
    fn deform(&self, states: &mut GradientBlock<D>, affine: &[[Lanes; D]; D], dt: f32, _slow: f32) {
        let mut change_squared = [0.0; LANES];
        for row in affine {
            for entry in row {
                for i in 0..LANES {
                    change_squared[i] += (dt * entry[i]).powi(2);
                }
            }
        }
        let large = change_squared.map(|square| square > Self::LARGE_CHANGE);
        // Apart, that the loop over all lanes stays wide.
        if large.contains(&true) {
            deform_each(states, affine, dt, &large);
            return;
        }
        for i in 0..LANES {
            let f = Matrix::load(states, i);
            let change = Matrix::from_fn(|row, column| dt * affine[row][column][i]) * f;
            // Not (I + dt C) F: 1 + dt C_ii keeps few digits of a small dt C_ii, always the same ones in a steady
            // rotation, and a ball that spins would gain energy from that.
            (f + change).store(states, i);
        }
    }

    fn volumes(&self, states: &GradientBlock<D>) -> Volumes {
        Volumes {
            ratio: Constitutive::<D>::volume_ratios(self, states),
            pressure: [0.0; LANES],
        }
    }

    #[inline(always)]
    fn volume_ratios(&self, states: &GradientBlock<D>) -> Lanes {
        std::array::from_fn(|i| determinant(&Matrix::load(states, i)))
    }

    fn energy_density(&self, f: &Matrix<D>) -> f32 {
        let strain = strain(&svd(f).sigma);
        let j = determinant(f);
        let volumetric = if self.lame.lambda < 0.0 {
            strain.sum()
        } else {
            j - 1.0
        };
        self.lame.mu * strain.norm_squared()
            + 0.5 * self.lame.lambda * volumetric.powi(2)
            + self.barrier_modulus() * Self::collapse(j).powi(2)
    }
}

/// Stretches less 1, from singular values.
#[inline(always)]
fn strain<const D: usize>(sigma: &Vector<D>) -> Vector<D> {
    sigma.add_scalar(-1.0)
}

/// Deforms a block with `large` changes in some lanes, which follow the velocity gradient through the substep: exp(dt C) by
/// (I + dt C / 8)^8 is positive for any gradient of a substep.
#[cold]
#[inline(never)]
fn deform_each<const D: usize>(
    states: &mut GradientBlock<D>,
    affine: &[[Lanes; D]; D],
    dt: f32,
    large: &[bool; LANES],
) {
    for i in 0..LANES {
        let f = Matrix::<D>::load(states, i);
        let gradient = Matrix::<D>::from_fn(|row, column| dt * affine[row][column][i]);
        if !large[i] {
            (f + gradient * f).store(states, i);
            continue;
        }
        let mut flow = Matrix::identity() + gradient * 0.125;
        for _ in 0..3 {
            flow *= flow;
        }
        (flow * f).store(states, i);
    }
}

impl<const D: usize> State for Matrix<D> {
    type Block = GradientBlock<D>;

    fn splat(self) -> GradientBlock<D> {
        let mut block = GradientBlock([[[0.0; LANES]; D]; D]);
        (0..LANES).for_each(|lane| self.store(&mut block, lane));
        block
    }

    #[inline(always)]
    fn load(block: &GradientBlock<D>, lane: usize) -> Self {
        Matrix::from_fn(|row, column| block.0[row][column][lane])
    }

    #[inline(always)]
    fn store(self, block: &mut GradientBlock<D>, lane: usize) {
        for row in 0..D {
            for column in 0..D {
                block.0[row][column][lane] = self[(row, column)];
            }
        }
    }

    fn write(&self, put: &mut impl FnMut(f32)) {
        self.iter().for_each(|&word| put(word));
    }

    fn read(take: &mut impl FnMut() -> f32) -> Self {
        Matrix::from_fn(|_, _| take())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_rotation_changes_the_volume_by_no_more_than_rounding_at_random() {
        // A body that spins once a second: what (I + dt C) stretches, the contraction takes back.
        let (turn, steps) = (1.3e-3_f32, 20_000);
        let contraction = -0.5 * turn * turn;
        let affine: [[Lanes; 2]; 2] = [
            [[contraction; LANES], [-turn; LANES]],
            [[turn; LANES], [contraction; LANES]],
        ];
        let lame = Lame::new(1.0e6, 0.3);
        let mut block = Matrix::<2>::identity().splat();
        for _ in 0..steps {
            Elastic { lame }.deform(&mut block, &affine, 1.0, 0.0);
        }
        let each = (1.0 + f64::from(contraction)).powi(2) + f64::from(turn).powi(2);
        let error = f64::from(determinant(&Matrix::load(&block, 0))) - each.powi(steps);
        assert!(error.abs() < 5.0e-5, "{error}");
    }
}
