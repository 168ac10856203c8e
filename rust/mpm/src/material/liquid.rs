//! Viscous liquids and pastes.

use super::constitutive::{Constitutive, Correction, State, Volumes};
use super::water::Water;
use crate::linalg::{LANES, Lanes, Symmetric, Symmetrics, Vector, exp, ln, shear_index};
use serde::{Deserialize, Serialize};

/// Weakly compressible liquid that flows by the law of Herschel and Bulkley (1926): at a shear rate g its shear stress is
/// tau_y + K g^n, and up to tau_y it does not flow.
///
/// Its volume behaves as that of water. The deviator s of tau is that of an elastic liquid (Saramito 2007):
/// s' = 2 G (D - D_p) + W s - s W, with D and W the symmetric and the antisymmetric part of the velocity gradient and D_p along
/// s. W s - s W does no work, so what s has received beyond s : s / (4 G) is lost, never gained. Solved at the end of each
/// substep for s and D_p together, a viscous stress is never stiffer than G, however short the time K / G in which it
/// builds up: no viscosity needs shorter substeps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Liquid {
    /// Pressure, and how the volume follows.
    pub volume: Water,
    /// K [Pa s^n].
    pub viscosity: f32,
    /// tau_y [Pa].
    pub yield_stress: f32,
    /// n [-].
    pub flow_index: f32,
}

/// Logarithms beyond are taken for it: one of the two parts of the stress then is all of it to the last bit.
const LARGEST_LOG: f32 = 80.0;
/// Stresses below are taken for it [Pa].
const SMALLEST_STRESS: f32 = 1.0e-30;
/// Newton's iterations for the power law; fewer leave errors above rounding.
const ITERATIONS: usize = 5;

impl Liquid {
    /// G over the bulk modulus. With it no deviatoric motion is stiffer than the volume of a single particle.
    const SHEAR_SHARE: f32 = 0.5;

    /// G [Pa].
    pub fn shear_modulus(&self) -> f32 {
        Self::SHEAR_SHARE * self.volume.bulk_modulus
    }

    /// Shear stresses after a substep in which those would be `trial` without flow, over `trial`: the solution tau of
    /// tau + G dt g = `trial` with tau = tau_y + K g^n.
    #[inline(always)]
    fn kept(&self, trial: &Lanes, dt: f32) -> Lanes {
        let elastic = dt * self.shear_modulus();
        let mut excess = [0.0; LANES];
        for i in 0..LANES {
            let beyond = trial[i] - self.yield_stress;
            excess[i] = if beyond > SMALLEST_STRESS {
                beyond
            } else {
                SMALLEST_STRESS
            };
        }
        let viscous = if self.flow_index == 1.0 {
            [self.viscosity / (self.viscosity + elastic); LANES]
        } else {
            self.viscous_share(&excess, elastic)
        };
        let mut kept = [1.0; LANES];
        for i in 0..LANES {
            let flows = trial[i] > self.yield_stress;
            let stress = self.yield_stress + viscous[i] * excess[i];
            kept[i] = if flows { stress } else { 1.0 } / if flows { trial[i] } else { 1.0 };
        }
        kept
    }

    /// y = K g^n over the excess b, where K g^n + `elastic` g = b: y + A y^(1/n) = 1 with A = `elastic` / b (b / K)^(1/n).
    ///
    /// For n > 1 the other part z = 1 - y is sought: z + A^-n z^n = 1. So powers are at least 1, the left side is convex, and
    /// Newton's iterations come down from an upper bound without fail.
    #[inline(always)]
    fn viscous_share(&self, excess: &Lanes, elastic: f32) -> Lanes {
        let inverse = 1.0 / self.flow_index;
        let thickens = self.flow_index > 1.0;
        let constant = ln(elastic) - inverse * ln(self.viscosity);
        let power = if thickens { self.flow_index } else { inverse };
        let (mut factor, mut part) = ([0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let of_power = constant + (inverse - 1.0) * ln(excess[i]);
            let of_power = if thickens {
                -self.flow_index * of_power
            } else {
                of_power
            };
            factor[i] = of_power.clamp(-LARGEST_LOG, LARGEST_LOG);
            let first = -factor[i] / power;
            part[i] = exp(if first < 0.0 { first } else { 0.0 });
        }
        // Lane after lane in the inner loop, or they would not be computed together.
        for _ in 0..ITERATIONS {
            for i in 0..LANES {
                let other = exp(factor[i] + power * ln(part[i]));
                part[i] -= (part[i] + other - 1.0) / (1.0 + power * other / part[i]);
            }
        }
        if thickens {
            part = part.map(|part| 1.0 - part);
        }
        part
    }
}

impl<const D: usize> Constitutive<D> for Liquid {
    type State = LiquidState<D>;

    fn initial_state(&self, volume_ratio: f32) -> LiquidState<D> {
        LiquidState {
            volume_ratio,
            deviator: Symmetric::diagonal(0.0),
        }
    }

    #[inline(always)]
    fn kirchhoff_stress(&self, states: &LiquidBlock<D>) -> Symmetrics<D> {
        let mut stress: Symmetrics<D> = self.volume.kirchhoff_stress(&states.volume_ratio);
        for k in 0..D {
            for i in 0..LANES {
                stress.diagonal[k][i] += states.deviator.diagonal[k][i];
                stress.shear[k][i] = states.deviator.shear[k][i];
            }
        }
        stress
    }

    #[inline(always)]
    fn deform(&self, states: &mut LiquidBlock<D>, affine: &[[Lanes; D]; D], dt: f32, slow: f32) {
        Constitutive::<D>::deform(&self.volume, &mut states.volume_ratio, affine, dt, slow);
        let mut trial = turned(&states.deviator, affine, dt);
        let stiffness = 2.0 * dt * self.shear_modulus();
        for i in 0..LANES {
            let mut mean = 0.0;
            for axis in 0..D {
                mean += affine[axis][axis][i] / D as f32;
            }
            for row in 0..D {
                trial.diagonal[row][i] += stiffness * (affine[row][row][i] - mean);
                for column in row + 1..D {
                    let rate = 0.5 * (affine[row][column][i] + affine[column][row][i]);
                    trial.shear[shear_index::<D>(row, column)][i] += stiffness * rate;
                }
            }
        }
        let kept = self.kept(&trial.half_norm_squared().map(f32::sqrt), dt);
        for k in 0..D {
            for i in 0..LANES {
                states.deviator.diagonal[k][i] = trial.diagonal[k][i] * kept[i];
                states.deviator.shear[k][i] = trial.shear[k][i] * kept[i];
            }
        }
    }

    fn corrects_volume(&self) -> bool {
        self.volume.volume_correction
    }

    fn bulk_modulus(&self) -> f32 {
        self.volume.bulk_modulus
    }

    #[inline(always)]
    fn volumes(&self, states: &LiquidBlock<D>) -> Volumes {
        Constitutive::<D>::volumes(&self.volume, &states.volume_ratio)
    }

    #[inline(always)]
    fn correct_volume(&self, states: &mut LiquidBlock<D>, correction: &Correction) {
        Constitutive::<D>::correct_volume(&self.volume, &mut states.volume_ratio, correction);
    }

    #[inline(always)]
    fn volume_ratios(&self, states: &LiquidBlock<D>) -> Lanes {
        states.volume_ratio
    }

    fn energy_density(&self, state: &LiquidState<D>) -> f32 {
        let mut deviator = Symmetrics::ZERO;
        deviator.set(0, &state.deviator);
        let volumetric = Constitutive::<D>::energy_density(&self.volume, &state.volume_ratio);
        volumetric + deviator.half_norm_squared()[0] / (2.0 * self.shear_modulus())
    }
}

/// s + dt (W s - s W), scaled to the norm of s: a rotation, which stores no energy.
#[inline(always)]
fn turned<const D: usize>(
    deviator: &Symmetrics<D>,
    affine: &[[Lanes; D]; D],
    dt: f32,
) -> Symmetrics<D> {
    let mut turned = *deviator;
    for i in 0..LANES {
        let s = deviator.get(i);
        let spin = |row: usize, column: usize| {
            0.5 * dt * (affine[row][column][i] - affine[column][row][i])
        };
        for row in 0..D {
            for k in 0..D {
                turned.diagonal[row][i] += 2.0 * spin(row, k) * s.at(k, row);
            }
            for column in row + 1..D {
                for k in 0..D {
                    turned.shear[shear_index::<D>(row, column)][i] +=
                        spin(row, k) * s.at(k, column) - s.at(row, k) * spin(k, column);
                }
            }
        }
    }
    let (before, after) = (deviator.half_norm_squared(), turned.half_norm_squared());
    for i in 0..LANES {
        let grows = after[i] > 0.0;
        let ratio = if grows { before[i] } else { 1.0 } / if grows { after[i] } else { 1.0 };
        let scale = ratio.sqrt();
        for k in 0..D {
            turned.diagonal[k][i] *= scale;
            turned.shear[k][i] *= scale;
        }
    }
    turned
}

/// State of a particle of liquid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LiquidState<const D: usize> {
    /// J.
    pub volume_ratio: f32,
    /// s, the deviator of tau [Pa].
    pub deviator: Symmetric<D>,
}

/// `LiquidState` of a block.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub struct LiquidBlock<const D: usize> {
    volume_ratio: Lanes,
    deviator: Symmetrics<D>,
}

impl<const D: usize> State for LiquidState<D> {
    type Block = LiquidBlock<D>;

    fn splat(self) -> LiquidBlock<D> {
        let mut block = LiquidBlock {
            volume_ratio: [0.0; LANES],
            deviator: Symmetrics::ZERO,
        };
        (0..LANES).for_each(|lane| self.store(&mut block, lane));
        block
    }

    #[inline(always)]
    fn load(block: &LiquidBlock<D>, lane: usize) -> Self {
        Self {
            volume_ratio: block.volume_ratio[lane],
            deviator: block.deviator.get(lane),
        }
    }

    #[inline(always)]
    fn store(self, block: &mut LiquidBlock<D>, lane: usize) {
        block.volume_ratio[lane] = self.volume_ratio;
        block.deviator.set(lane, &self.deviator);
    }

    fn write(&self, put: &mut impl FnMut(f32)) {
        put(self.volume_ratio);
        let Symmetric { diagonal, shear } = &self.deviator;
        diagonal.iter().chain(shear).for_each(|&word| put(word));
    }

    fn read(take: &mut impl FnMut() -> f32) -> Self {
        Self {
            volume_ratio: take(),
            deviator: Symmetric {
                diagonal: Vector::from_fn(|_, _| take()),
                shear: Vector::from_fn(|_, _| take()),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Material;
    use crate::material::Model;

    const DT: f32 = 1.5e-4;

    fn liquid(viscosity: f32, yield_stress: f32, flow_index: f32) -> Liquid {
        let made = Material::liquid(
            1000.0,
            277_778.0,
            [viscosity, yield_stress, flow_index],
            0.25,
            0.0,
            true,
        );
        let Model::Liquid(liquid) = made.unwrap().model else {
            unreachable!("a liquid was made")
        };
        liquid
    }

    /// Shear stress and energy [Pa] after simple shear at a rate [1/s] over a time [s].
    fn sheared<const D: usize>(liquid: &Liquid, rate: f32, time: f32) -> (f32, f32) {
        let mut states = Constitutive::<D>::initial_state(liquid, 1.0).splat();
        let mut affine = [[[0.0; LANES]; D]; D];
        affine[0][D - 1] = [rate; LANES];
        for _ in 0..(time / DT) as usize {
            liquid.deform(&mut states, &affine, DT, 0.0);
        }
        let stress = Constitutive::<D>::kirchhoff_stress(liquid, &states).get(3);
        let energy = liquid.energy_density(&LiquidState::<D>::load(&states, 3));
        (stress.at(0, D - 1), energy)
    }

    #[test]
    fn steady_shear_has_the_stress_of_the_law() {
        for (viscosity, yield_stress, flow_index) in [
            (1.0e-3, 0.0, 1.0),
            (10.0, 0.0, 1.0),
            (5.0, 40.0, 1.0),
            (20.0, 30.0, 0.5),
            (3.0, 0.0, 0.25),
            (2.0, 5.0, 1.8),
        ] {
            let liquid = liquid(viscosity, yield_stress, flow_index);
            for rate in [0.5, 10.0, 60.0] {
                let law = yield_stress + viscosity * f32::powf(rate, flow_index);
                // Until the elastic strain has built up, and eight times the time in which the rest follows.
                let relaxation = law / (rate * liquid.shear_modulus());
                let time = 8.0 * relaxation + 20.0 * DT;
                let (in_2d, _) = sheared::<2>(&liquid, rate, time);
                let (in_3d, _) = sheared::<3>(&liquid, rate, time);
                for stress in [in_2d, in_3d] {
                    let off = (stress / law - 1.0).abs();
                    assert!(
                        off < 2.0e-3,
                        "{liquid:?} at {rate}/s: {stress} Pa, not {law}"
                    );
                }
            }
        }
    }

    #[test]
    fn below_the_yield_stress_it_is_elastic() {
        let liquid = liquid(10.0, 100.0, 0.7);
        let strain = 0.5 * 100.0 / liquid.shear_modulus();
        let (stress, energy) = sheared::<2>(&liquid, strain / (1000.0 * DT), 1000.4 * DT);
        assert!((stress - 50.0).abs() < 0.1, "{stress}");
        let stored = 0.5 * stress * strain;
        assert!((energy / stored - 1.0).abs() < 2.0e-3, "{energy} {stored}");
    }

    #[test]
    fn a_stress_that_turns_with_its_particle_stores_the_same_energy() {
        let liquid = liquid(10.0, 1.0e4, 1.0);
        let mut state = Constitutive::<3>::initial_state(&liquid, 1.0);
        state.deviator.shear = Vector::<3>::new(900.0, -300.0, 500.0);
        state.deviator.diagonal = Vector::<3>::new(200.0, 100.0, -300.0);
        let before = liquid.energy_density(&state);
        let mut states = state.splat();
        let mut affine = [[[0.0; LANES]; 3]; 3];
        for (row, column, spin) in [(0, 1, 8.0), (1, 2, -3.0), (0, 2, 5.0)] {
            affine[row][column] = [spin; LANES];
            affine[column][row] = [-spin; LANES];
        }
        for _ in 0..50_000 {
            liquid.deform(&mut states, &affine, DT, 0.0);
        }
        let after = liquid.energy_density(&LiquidState::<3>::load(&states, 0));
        // Rounding of the scale loses a little, and must never gain.
        let gain = after / before - 1.0;
        assert!(gain < 1.0e-5 && gain > -5.0e-3, "{before} {after}");
    }

    #[test]
    fn the_share_of_the_power_law_is_exact_to_rounding() {
        for flow_index in [0.2, 0.35, 0.5, 0.8, 0.97, 1.03, 1.3, 2.0] {
            let liquid = liquid(3.0, 0.0, flow_index);
            let (n, k) = (f64::from(liquid.flow_index), f64::from(liquid.viscosity));
            for log in -60..60 {
                let excess = 10.0f32.powf(0.15 * log as f32);
                let elastic = 20.0f32;
                let share = f64::from(liquid.viscous_share(&[excess; LANES], elastic)[5]);
                // By halving, of the logarithm of the rate.
                let (mut low, mut high) = (-200.0f64, 200.0f64);
                for _ in 0..200 {
                    let rate = (0.5 * (low + high)).exp();
                    let sum = k * rate.powf(n) + f64::from(elastic) * rate;
                    if sum > f64::from(excess) {
                        high = 0.5 * (low + high);
                    } else {
                        low = 0.5 * (low + high);
                    }
                }
                let exact = k * low.exp().powf(n) / f64::from(excess);
                // Relative to the smaller of both parts where that is the one that is solved for.
                let error = (share - exact).abs() / if n < 1.0 { exact } else { 1.0 };
                assert!(error < 2.0e-5, "n = {n}, {excess} Pa: {share}, not {exact}");
            }
        }
    }
}
