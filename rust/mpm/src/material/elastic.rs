//! Elastic solids.

use super::constitutive::{Constitutive, State, Volumes};
use super::lame::Lame;
use crate::linalg::{LANES, Lanes, Matrix, Symmetrics, determinant, ln, rotations, shear_index};
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
    #[inline(always)]
    fn collapse(j: f32) -> f32 {
        // Computed in any case, which makes it a selection and no branch.
        let logarithm = ln(if j > 0.0 { j / Self::BARRIER } else { f32::NAN });
        if j >= Self::BARRIER { 0.0 } else { logarithm }
    }
}

impl<const D: usize> Constitutive<D> for Elastic {
    type State = Matrix<D>;

    const HAS_OWN_FIELD: bool = true;

    fn initial_state(&self, volume_ratio: f32) -> Matrix<D> {
        Matrix::from_diagonal_element(volume_ratio.powf(1.0 / D as f32))
    }

    #[inline(always)]
    fn kirchhoff_stress(&self, states: &GradientBlock<D>) -> Symmetrics<D> {
        let Lame { mu, lambda } = self.lame;
        let (f, barrier) = (&states.0, 2.0 * self.barrier_modulus());
        let rotations = rotations(f);
        let ratios = Constitutive::<D>::volume_ratios(self, states);
        let mut stress = Symmetrics::ZERO;
        for i in 0..LANES {
            let j = ratios[i];
            let (mut pressure, mut of_rotation) = (lambda * j * (j - 1.0), 0.0);
            if lambda < 0.0 {
                let mut trace = 0.0;
                for row in 0..D {
                    for column in 0..D {
                        trace += rotations[row][column][i] * f[row][column][i];
                    }
                }
                (pressure, of_rotation) = (0.0, lambda * (trace - D as f32));
            }
            pressure += barrier * Self::collapse(j);
            let entry = |row: usize, column: usize| {
                let mut sum = 0.0;
                for k in 0..D {
                    let rotation = rotations[row][k][i];
                    let part = 2.0 * mu * (f[row][k][i] - rotation) + of_rotation * rotation;
                    sum += part * f[column][k][i];
                }
                sum
            };
            for row in 0..D {
                stress.diagonal[row][i] = entry(row, row) + pressure;
                for column in row + 1..D {
                    stress.shear[shear_index::<D>(row, column)][i] = entry(row, column);
                }
            }
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
        let rotation = Matrix::load(&GradientBlock(rotations(&f.splat().0)), 0);
        let j = determinant(f);
        let volumetric = if self.lame.lambda < 0.0 {
            rotation.dot(f) - D as f32
        } else {
            j - 1.0
        };
        self.lame.mu * (f - rotation).norm_squared()
            + 0.5 * self.lame.lambda * volumetric.powi(2)
            + self.barrier_modulus() * Self::collapse(j).powi(2)
    }
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
