//! Weakly compressible water.

use super::constitutive::{Constitutive, Correction, State, Volumes};
use crate::linalg::{LANES, Lanes, Symmetrics};
use serde::{Deserialize, Serialize};

/// Water: tau = lambda J (J - 1) I. Its state is J only.
///
/// J follows the divergence at the particle, and `volume` corrects it towards the space that the particle occupies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Water {
    /// lambda [Pa].
    pub bulk_modulus: f32,
    /// Factor on the stress where J > 1. With 1 spray clumps, with 0 J drifts at the free surface.
    pub tension: f32,
    /// Without it only the divergence changes J.
    pub volume_correction: bool,
}

impl Water {
    /// Smallest J: tau = lambda J (J - 1) weakens below J = 1/2 and vanishes with J, so matter that an impact has compressed
    /// so far would not expand again.
    const SMALLEST_RATIO: f32 = 0.1;
    /// Smallest factor on J of a substep. Impacts faster than sound may ask for less than nothing; the pressure of half of
    /// the volume stops them in the next substeps.
    const SMALLEST_CHANGE: f32 = 0.5;

    #[inline(always)]
    fn stiffness(&self, volume_ratio: f32) -> f32 {
        if volume_ratio > 1.0 {
            self.tension * self.bulk_modulus
        } else {
            self.bulk_modulus
        }
    }
}

impl<const D: usize> Constitutive<D> for Water {
    type State = f32;

    fn initial_state(&self, volume_ratio: f32) -> f32 {
        volume_ratio
    }

    #[inline(always)]
    fn kirchhoff_stress(&self, volume_ratios: &Lanes) -> Symmetrics<D> {
        let mut stress = Symmetrics::ZERO;
        for i in 0..LANES {
            let j = volume_ratios[i];
            let pressure = self.stiffness(j) * j * (j - 1.0);
            for axis in 0..D {
                stress.diagonal[axis][i] = pressure;
            }
        }
        stress
    }

    #[inline(always)]
    fn deform(&self, volume_ratios: &mut Lanes, affine: &[[Lanes; D]; D], dt: f32, _slow: f32) {
        for i in 0..LANES {
            let divergence: f32 = (0..D).map(|axis| affine[axis][axis][i]).sum();
            let change = 1.0 + dt * divergence;
            // Not `max`, which would hide a NaN.
            let bounded = if change < Self::SMALLEST_CHANGE {
                Self::SMALLEST_CHANGE
            } else {
                change
            };
            let ratio = volume_ratios[i] * bounded;
            // An inversion is an error that has to be seen.
            let floored = ratio > 0.0 && ratio < Self::SMALLEST_RATIO;
            volume_ratios[i] = if floored { Self::SMALLEST_RATIO } else { ratio };
        }
    }

    fn corrects_volume(&self) -> bool {
        self.volume_correction
    }

    #[inline(always)]
    fn volumes(&self, volume_ratios: &Lanes) -> Volumes {
        Volumes {
            ratio: *volume_ratios,
            pressure: volume_ratios.map(|ratio| self.bulk_modulus * (1.0 - ratio)),
        }
    }

    /// Room takes pressure away, but makes no tension: water does not pull at what is not there.
    #[inline(always)]
    fn correct_volume(&self, volume_ratios: &mut Lanes, correction: &Correction) {
        if !self.volume_correction {
            return;
        }
        for i in 0..LANES {
            let mean = 1.0 - correction.pressure[i] / self.bulk_modulus;
            let shared = volume_ratios[i] + correction.sharing[i] * (mean - volume_ratios[i]);
            let expanded = shared * (1.0 + correction.expansion[i]);
            let most = if shared > 1.0 { shared } else { 1.0 };
            let ratio = if expanded > most { most } else { expanded };
            volume_ratios[i] = if ratio < Self::SMALLEST_RATIO {
                Self::SMALLEST_RATIO
            } else {
                ratio
            };
        }
    }

    #[inline(always)]
    fn volume_ratios(&self, volume_ratios: &Lanes) -> Lanes {
        *volume_ratios
    }

    fn energy_density(&self, &volume_ratio: &f32) -> f32 {
        // d psi / dJ = tau / J.
        0.5 * self.stiffness(volume_ratio) * (volume_ratio - 1.0).powi(2)
    }
}

impl State for f32 {
    type Block = Lanes;

    fn splat(self) -> Lanes {
        [self; LANES]
    }
    #[inline(always)]
    fn load(block: &Lanes, lane: usize) -> Self {
        block[lane]
    }
    #[inline(always)]
    fn store(self, block: &mut Lanes, lane: usize) {
        block[lane] = self;
    }
    fn write(&self, put: &mut impl FnMut(f32)) {
        put(*self);
    }
    fn read(take: &mut impl FnMut() -> f32) -> Self {
        take()
    }
}
