//! Dry sand.

use super::constitutive::{Constitutive, Correction, State, Volumes};
use super::lame::Lame;
use crate::linalg::{
    LANES, Lanes, Spectrum, Split, Symmetric, Symmetrics, Vector, exp, exponential, ln, logarithm,
};
use serde::{Deserialize, Serialize};

/// Dry sand: StVK-Hencky elasticity with a Drucker-Prager yield surface (Klar et al. 2016).
///
/// Both depend on the stretches alone, so a particle carries b = F F^T of the elastic part of F: its eigenvalues
/// are their squares, its eigenvectors the axes of the stress, and no rotation has to be found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sand {
    pub lame: Lame,
    /// Slope of the yield cone, sqrt(2/3) 2 sin(phi) / (3 - sin(phi)). In 2D the plane-strain friction
    /// angle is asin(sqrt(2) alpha): 45 degrees stay 45.4.
    pub alpha: f32,
    /// Take volume gained in separation back before stress builds up (Tampubolon et al. 2017), and lead the volume
    /// back to the room that the particle takes.
    pub volume_correction: bool,
}

/// Squared stretches below this are taken for it, so that the logarithm stays finite: far below any that sand
/// survives.
const SMALLEST_SQUARE: f32 = 1.0e-8;

/// Log of the largest volume gain that is remembered, 22 000 times the volume: a grain that flies alone would else gain
/// more in each substep, until its volume overflows.
const LARGEST_GAIN: f32 = 10.0;

/// Compression that sand gives up besides, as it expands faster than slow flow, over the expansion beyond: a blow presses
/// grains together for good. What is pressed as a spring returns 1 / (1 + LOSS) of its energy.
const LOSS: f32 = 5.0;

impl Sand {
    /// `friction_angle` in degrees.
    pub fn new(lame: Lame, friction_angle: f32, volume_correction: bool) -> Self {
        // In double precision: rounding removes the differences of sines between platforms.
        let sin = f64::from(friction_angle).to_radians().sin();
        Self {
            lame,
            alpha: ((2.0f64 / 3.0).sqrt() * 2.0 * sin / (3.0 - sin)) as f32,
            volume_correction,
        }
    }

    /// Takes the Hencky strains to or into the yield surface, less the compression `given_up`, and sets the log of the
    /// volume gained. Without branches.
    #[inline(always)]
    fn return_mapping<const D: usize>(
        &self,
        strain: &mut Split<D>,
        gained: &mut Lanes,
        given_up: &Lanes,
    ) {
        let Lame { mu, lambda } = self.lame;
        let slope = self.alpha * (D as f32 * lambda + 2.0 * mu) / (2.0 * mu);
        let half_norm_squared = strain.deviator.half_norm_squared();
        for i in 0..LANES {
            let trace = D as f32 * strain.mean[i] + gained[i];
            // Grains apart: no stress. Only the volume is remembered.
            let apart = trace >= 0.0;
            let norm = (2.0 * half_norm_squared[i]).sqrt();
            let excess = norm + slope * trace;
            let beyond = excess > 0.0;
            let back = if beyond { excess } else { 0.0 } / if beyond { norm } else { 1.0 };
            let left = trace + given_up[i];
            let left = if left < 0.0 { left } else { 0.0 };
            // Of all strains, so that the stress stays on its side of the cone.
            let part = left / if apart { 1.0 } else { trace };
            let kept = if apart { 0.0 } else { (1.0 - back) * part };
            for k in 0..D {
                strain.deviator.diagonal[k][i] *= kept;
                strain.deviator.shear[k][i] *= kept;
            }
            strain.mean[i] = if apart { 0.0 } else { left / D as f32 };
            let remembered = apart & self.volume_correction;
            let gain = if trace < LARGEST_GAIN {
                trace
            } else {
                LARGEST_GAIN
            };
            gained[i] = if remembered { gain } else { 0.0 };
        }
    }

    /// Flows back to the yield surface from the squared stretches in `states`, less the compression `given_up`, and
    /// updates the stress.
    #[inline(always)]
    fn flow<const D: usize>(&self, states: &mut SandBlock<D>, given_up: &Lanes) {
        let mut strain = logarithm(&states.stretch_squared, SMALLEST_SQUARE).scaled(0.5);
        self.return_mapping(&mut strain, &mut states.volume_gain, given_up);
        let Lame { mu, lambda } = self.lame;
        let bulk = D as f32 * lambda + 2.0 * mu;
        for i in 0..LANES {
            let pressure = bulk * strain.mean[i];
            for k in 0..D {
                states.kirchhoff_stress.diagonal[k][i] =
                    2.0 * mu * strain.deviator.diagonal[k][i] + pressure;
                states.kirchhoff_stress.shear[k][i] = 2.0 * mu * strain.deviator.shear[k][i];
            }
        }
        states.stretch_squared = exponential(&strain.scaled(2.0));
    }
}

impl<const D: usize> Constitutive<D> for Sand {
    type State = SandState<D>;

    fn initial_state(&self, volume_ratio: f32) -> SandState<D> {
        let mut states = SandState {
            stretch_squared: Symmetric::diagonal(volume_ratio.powf(2.0 / D as f32)),
            kirchhoff_stress: Symmetric::diagonal(0.0),
            volume_gain: 0.0,
        }
        .splat();
        self.flow(&mut states, &[0.0; LANES]);
        SandState::load(&states, 0)
    }

    #[inline(always)]
    fn kirchhoff_stress(&self, states: &SandBlock<D>) -> Symmetrics<D> {
        states.kirchhoff_stress
    }

    #[inline(always)]
    fn deform(&self, states: &mut SandBlock<D>, affine: &[[Lanes; D]; D], dt: f32, slow: f32) {
        states.stretch_squared = states.stretch_squared.deformed(affine, dt);
        let mut given_up = [0.0; LANES];
        for i in 0..LANES {
            let mut beyond = -slow;
            for axis in 0..D {
                beyond += affine[axis][axis][i];
            }
            given_up[i] = if beyond > 0.0 {
                LOSS * dt * beyond
            } else {
                0.0
            };
        }
        self.flow(states, &given_up);
    }

    fn corrects_volume(&self) -> bool {
        self.volume_correction
    }

    fn crowds_within_cells(&self) -> bool {
        true
    }

    /// lambda + 2 mu / D.
    fn bulk_modulus(&self) -> f32 {
        self.lame.lambda + 2.0 * self.lame.mu / D as f32
    }

    #[inline(always)]
    fn volumes(&self, states: &SandBlock<D>) -> Volumes {
        let modulus = Constitutive::<D>::bulk_modulus(self);
        let mut volumes = Volumes {
            ratio: [0.0; LANES],
            pressure: [0.0; LANES],
        };
        for i in 0..LANES {
            let strain = states.log_volume(i);
            volumes.ratio[i] = exp(strain);
            volumes.pressure[i] = -modulus * strain;
        }
        volumes
    }

    /// The next flow takes what is added to the volume gained as strain: more of it is less pressure.
    #[inline(always)]
    fn correct_volume(&self, states: &mut SandBlock<D>, correction: &Correction) {
        if !self.volume_correction {
            return;
        }
        let modulus = Constitutive::<D>::bulk_modulus(self);
        for i in 0..LANES {
            let deviation = -correction.pressure[i] / modulus - states.log_volume(i);
            states.volume_gain[i] += correction.sharing[i] * deviation + correction.expansion[i];
        }
    }

    #[inline(always)]
    fn volume_ratios(&self, states: &SandBlock<D>) -> Lanes {
        states.stretch_squared.determinant().map(f32::sqrt)
    }

    fn energy_density(&self, state: &SandState<D>) -> f32 {
        let mut block = Symmetrics::ZERO;
        block.set(0, &state.stretch_squared);
        let values = Spectrum::of(&block).values;
        let strain = Vector::<D>::from_fn(|k, _| 0.5 * values[k][0].max(SMALLEST_SQUARE).ln());
        self.lame.mu * strain.norm_squared() + 0.5 * self.lame.lambda * strain.sum().powi(2)
    }
}

/// Deformation of a sand particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SandState<const D: usize> {
    /// b = F F^T of the elastic part of F.
    pub stretch_squared: Symmetric<D>,
    /// tau of that b, kept because plastic flow needs the same axes.
    pub kirchhoff_stress: Symmetric<D>,
    /// Log of the volume gained while the grains were apart; below 0 where they have come too close.
    pub volume_gain: f32,
}

/// `SandState` of a block.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub struct SandBlock<const D: usize> {
    stretch_squared: Symmetrics<D>,
    kirchhoff_stress: Symmetrics<D>,
    volume_gain: Lanes,
}

impl<const D: usize> SandBlock<D> {
    /// Log of the volume over the rest volume, with the volume gained while grains were apart.
    #[inline(always)]
    fn log_volume(&self, lane: usize) -> f32 {
        let square = self.stretch_squared.get(lane).determinant();
        0.5 * ln(square.max(SMALLEST_SQUARE)) + self.volume_gain[lane]
    }
}

impl<const D: usize> State for SandState<D> {
    type Block = SandBlock<D>;

    fn splat(self) -> SandBlock<D> {
        let mut block = SandBlock {
            stretch_squared: Symmetrics::ZERO,
            kirchhoff_stress: Symmetrics::ZERO,
            volume_gain: [0.0; LANES],
        };
        (0..LANES).for_each(|lane| self.store(&mut block, lane));
        block
    }

    #[inline(always)]
    fn load(block: &SandBlock<D>, lane: usize) -> Self {
        Self {
            stretch_squared: block.stretch_squared.get(lane),
            kirchhoff_stress: block.kirchhoff_stress.get(lane),
            volume_gain: block.volume_gain[lane],
        }
    }

    #[inline(always)]
    fn store(self, block: &mut SandBlock<D>, lane: usize) {
        block.stretch_squared.set(lane, &self.stretch_squared);
        block.kirchhoff_stress.set(lane, &self.kirchhoff_stress);
        block.volume_gain[lane] = self.volume_gain;
    }

    fn write(&self, put: &mut impl FnMut(f32)) {
        for part in [&self.stretch_squared, &self.kirchhoff_stress] {
            part.diagonal
                .iter()
                .chain(&part.shear)
                .for_each(|&word| put(word));
        }
        put(self.volume_gain);
    }

    fn read(take: &mut impl FnMut() -> f32) -> Self {
        let mut symmetric = || Symmetric {
            diagonal: Vector::from_fn(|_, _| take()),
            shear: Vector::from_fn(|_, _| take()),
        };
        let (stretch_squared, kirchhoff_stress) = (symmetric(), symmetric());
        Self {
            stretch_squared,
            kirchhoff_stress,
            volume_gain: take(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE: f32 = 8.0;
    const DT: f32 = 1.0e-4;

    /// Mean strain, and squared norm of the deviator over its square, of sand that is pressed and sheared, and then
    /// expands by a thousandth at `RATE`.
    fn after_expansion(slow: f32) -> (f32, f32) {
        let sand = Sand::new(Lame::new(1.6e6, 0.2), 40.0, true);
        let mut states = Constitutive::<2>::initial_state(&sand, 1.0).splat();
        let mut deform = |xx: f32, yy: f32, steps: usize| {
            let affine = [[[xx; LANES], [0.0; LANES]], [[0.0; LANES], [yy; LANES]]];
            for _ in 0..steps {
                sand.deform(&mut states, &affine, DT, slow);
            }
        };
        deform(-60.0, -40.0, 10);
        deform(0.5 * RATE, 0.5 * RATE, 12);
        let strain = logarithm(&states.stretch_squared, SMALLEST_SQUARE).scaled(0.5);
        let deviator = strain.deviator.half_norm_squared()[0];
        (strain.mean[0], deviator / strain.mean[0].powi(2))
    }

    #[test]
    fn slow_expansion_is_elastic() {
        let (mean, _) = after_expansion(RATE);
        assert!((mean - (-0.05 + 0.0048)).abs() < 3.0e-4, "{mean}");
    }

    #[test]
    fn fast_expansion_gives_up_more_and_stays_on_its_side_of_the_cone() {
        let (slow, slope) = after_expansion(RATE);
        let (fast, steeper) = after_expansion(0.875 * RATE);
        let given_up = LOSS * 0.125 * RATE * DT * 12.0 / 2.0;
        assert!((fast - slow - given_up).abs() < 1.0e-4, "{slow} {fast}");
        assert!(steeper <= slope * 1.2, "{slope} {steeper}");
        // All of it at most: no tension.
        assert!(after_expansion(-10.0 * RATE).0 == 0.0);
    }
}
