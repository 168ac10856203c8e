//! Correction of volume ratios towards the space that particles occupy.

use super::lanes::{PRESSURE, SMOOTH, VOLUME};
use super::smooth::binomial;
use crate::boundary::{WallFill, Walls};
use crate::grid::{Layout, Stencils, View};
use crate::linalg::{Kernel, LANES, Lanes, Quad, run_wide};
use crate::material::{Constitutive, Correction};
use crate::particles::Block;
use crate::substep::gather;

/// Rate of a correction, by the rate of deformation of a particle; 0 for matter at rest.
#[derive(Debug, Clone, Copy)]
struct Rate {
    /// At most [1/s].
    most: f32,
    /// Over the rate of strain [-].
    per_strain: f32,
    /// Matter under a lower rate of strain [1/s] is at rest.
    rest: f32,
}

impl Rate {
    /// The part [-] that is done in `dt` [s] under a rate of strain [1/s].
    #[inline(always)]
    fn part(self, strain_rate: f32, dt: f32) -> f32 {
        let beyond_rest = (strain_rate - self.rest).max(0.0);
        (self.most.min(self.per_strain * beyond_rest) * dt).min(0.5)
    }
}

/// Where matter is at rest, but for grains that press [1/s].
const REST: f32 = 0.2;

/// Neighbours share their pressure. Without it the mean compression of a tank is 28 % too small.
const SHARING: Rate = Rate {
    most: 80.0,
    per_strain: 80.0,
    rest: REST,
};
/// Matter with room around it gives its false pressure away.
const VOID: Rate = Rate {
    most: 50.0,
    per_strain: 10.0,
    rest: REST,
};
/// Grains do so in slow flow too: sand that is poured lands grain by grain, and comes to rest slowly.
const VOID_OF_GRAINS: Rate = Rate {
    most: 50.0,
    per_strain: 50.0,
    rest: 0.1 * REST,
};
/// Crowded matter gains pressure. Faster corrections feed waves.
const CROWDING: Rate = Rate {
    most: 20.0,
    per_strain: 100.0,
    rest: REST,
};
/// Room [-] that is no contradiction.
const VOID_TOLERANCE: f32 = 0.03;
/// Matter with less volume [-] around it is spray: it is meant to be apart.
const SPRAY: f32 = 0.5;
/// The same for grains that press each other: those that are apart have no pressure.
const SPRAY_OF_GRAINS: f32 = 0.05;
/// Volume of a particle [cells] above which excess density is mostly noise of the particles' places.
/// Such matter gains pressure only as far as the strain within its cell pays for it; else it would gain energy.
const SPARSE: f32 = 0.4;
/// Crowding [-] that is no contradiction.
const CROWDING_TOLERANCE: f32 = 0.01;

/// At a plane free surface the volume V on the grid and the distance d to the centre of the volume around, in
/// cells, belong together: 1 - V = SLOPE d^2 / (d + ROUNDING) within 0.007 in the mean over the places of the
/// surface on the grid. The rounding keeps the noise of d in the bulk from counting.
const SLOPE: f32 = 3.05;
const ROUNDING: f32 = 0.03;

/// The room between the walls.
#[derive(Debug, Clone)]
pub struct Rooms<const D: usize> {
    /// As fine as the volume on the nodes.
    pub fine: WallFill<D>,
    /// As smooth as the smooth volume.
    pub smooth: WallFill<D>,
}

impl<const D: usize> Rooms<D> {
    pub fn new(walls: &Walls<D>, layout: &Layout<D>) -> Self {
        let fine = WallFill::new(walls, layout);
        Self {
            smooth: fine.clone().smoothed(binomial),
            fine,
        }
    }
}

/// Corrects blocks of one group; `dt` is the time since the latest correction [s].
pub fn correct<const D: usize, M: Constitutive<D>>(
    blocks: &mut [Block<D, M::State>],
    material: &M,
    grid: View<'_, D>,
    room: &Rooms<D>,
    dt: f32,
) {
    run_wide(CorrectBlocks {
        blocks,
        material,
        grid,
        room,
        dt,
    });
}

/// Some blocks of one group.
struct CorrectBlocks<'a, const D: usize, M: Constitutive<D>> {
    blocks: &'a mut [Block<D, M::State>],
    material: &'a M,
    grid: View<'a, D>,
    room: &'a Rooms<D>,
    dt: f32,
}

impl<const D: usize, M: Constitutive<D>> Kernel for CorrectBlocks<'_, D, M> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        for block in self.blocks {
            let stencils = Stencils::at(&block.x, &self.grid.layout);
            let sums = gather::<Q, D, false>(self.grid, &stencils, block.count.min(LANES));
            let (room, centre) = self.room.smooth.at(&stencils);
            let (crowding_lane, crowding_room) = if self.material.crowds_within_cells() {
                (VOLUME, self.room.fine.at(&stencils).0)
            } else {
                (SMOOTH, room)
            };
            let held = self.material.volumes(&block.state);
            let cell = self.grid.layout.dx().powi(D as i32);
            let strain_rate = strain_rate(&block.affine);
            let mut correction = Correction {
                pressure: [0.0; LANES],
                sharing: strain_rate.map(|rate| SHARING.part(rate, self.dt)),
                expansion: [0.0; LANES],
            };
            for i in 0..block.count.min(LANES) {
                let sum = sums.value(i).to_array();
                let mut distance_squared = 0.0;
                for axis in 0..D {
                    let moment = sums.moment(axis, i).to_array()[SMOOTH];
                    distance_squared += (moment / sum[SMOOTH] - centre[axis][i]).powi(2);
                }
                correction.pressure[i] = sum[PRESSURE];
                let is_pressed = held.pressure[i] > 0.0;
                let (rate, spray) = if self.material.crowds_within_cells() && is_pressed {
                    (VOID_OF_GRAINS, SPRAY_OF_GRAINS)
                } else {
                    (VOID, SPRAY)
                };
                let void = void(sum[SMOOTH] / room[i], distance_squared, spray);
                let crowding = crowding(sum[crowding_lane] / crowding_room[i]);
                let expansion = rate.part(strain_rate[i], self.dt) * void
                    - CROWDING.part(strain_rate[i], self.dt) * crowding;
                correction.expansion[i] = expansion;
                if expansion < 0.0 && block.volume[i] > SPARSE * cell {
                    // The affine velocity over a cell has the energy m / 2 dx^2 / 4 D : D.
                    let modulus = self.material.bulk_modulus();
                    let across = 0.5 * self.grid.layout.dx() * strain_rate[i];
                    let budget = 0.5 * block.mass[i] / block.volume[i] * across * across;
                    let (pressed, kept) = pressed(-expansion, held.pressure[i], modulus, budget);
                    correction.expansion[i] = -pressed;
                    slow_strain(&mut block.affine, i, kept);
                }
            }
            self.material.correct_volume(&mut block.state, &correction);
        }
    }
}

/// The relative compression [-] that an energy [J/m^D] pays for, at most `wanted`, and the part of the rate of strain that is
/// left. Compression by d at pressure p and modulus K [Pa] needs p d + K d^2 / 2.
#[inline(always)]
fn pressed(wanted: f32, pressure: f32, modulus: f32, energy: f32) -> (f32, f32) {
    let p = pressure.max(0.0);
    let payable = ((p * p + 2.0 * modulus * energy).sqrt() - p) / modulus;
    let pressed = payable.min(wanted);
    let spent = pressed * (p + 0.5 * modulus * pressed) / energy.max(f32::MIN_POSITIVE);
    (pressed, (1.0 - spent).max(0.0).sqrt())
}

/// Multiplies the symmetric part of a particle's velocity gradient by `kept`; it goes on to turn as before.
#[inline(always)]
fn slow_strain<const D: usize>(affine: &mut [[Lanes; D]; D], lane: usize, kept: f32) {
    for row in 0..D {
        for column in row..D {
            let mean = 0.5 * (affine[row][column][lane] + affine[column][row][lane]);
            let change = mean * (1.0 - kept);
            affine[row][column][lane] -= change;
            if row != column {
                affine[column][row][lane] -= change;
            }
        }
    }
}

/// How much volume is missing around a particle [-], beyond what is tolerated: from the volume on the grid [-] and the
/// squared distance to its centre [cells^2]. None where the volume is below that of `spray` [-].
#[inline(always)]
fn void(volume: f32, distance_squared: f32, spray: f32) -> f32 {
    let surface = SLOPE * distance_squared / (distance_squared.sqrt() + ROUNDING);
    let void = (1.0 - volume - surface - VOID_TOLERANCE).max(0.0);
    if volume < spray { 0.0 } else { void }
}

/// Excess volume around a particle beyond the tolerance [-].
#[inline(always)]
fn crowding(volume: f32) -> f32 {
    (volume - 1.0 - CROWDING_TOLERANCE).clamp(0.0, 0.5)
}

/// Frobenius norm of the symmetric part of the velocity gradient [1/s].
#[inline(always)]
fn strain_rate<const D: usize>(affine: &[[Lanes; D]; D]) -> Lanes {
    let mut squares = [0.0; LANES];
    for row in 0..D {
        for column in 0..D {
            for i in 0..LANES {
                let entry = 0.5 * (affine[row][column][i] + affine[column][row][i]);
                squares[i] += entry * entry;
            }
        }
    }
    squares.map(f32::sqrt)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voids_are_told_from_surfaces_and_spray() {
        assert_eq!(
            (
                void(1.0, 0.0, SPRAY),
                void(0.98, 0.0, SPRAY),
                void(1.2, 0.0, SPRAY)
            ),
            (0.0, 0.0, 0.0)
        );
        assert!((void(0.83, 0.0, SPRAY) - 0.14).abs() < 1e-6);
        assert_eq!(void(0.2, 0.0, SPRAY), 0.0);
        assert!((void(0.2, 0.0, SPRAY_OF_GRAINS) - 0.77).abs() < 1e-6);
        // A particle at a surface has little volume around it, and all of it on one side.
        assert_eq!(void(0.6, 0.16 * 0.16, SPRAY), 0.0);
        assert!((crowding(1.11) - 0.1).abs() < 1e-6 && crowding(1.0) == 0.0);
        assert_eq!(crowding(3.0), 0.5);
    }

    #[test]
    fn pressure_is_paid_from_the_strain_of_the_cell() {
        // 3 J/m^2 at 10 Pa and 20 Pa: 10 d + 10 d^2 = 3 for d = .2416.
        let (most, kept) = pressed(1.0, 10.0, 20.0, 3.0);
        assert!(
            (most - 0.241_62).abs() < 1e-4 && kept < 2e-3,
            "{most} {kept}"
        );
        let (part, kept) = pressed(0.1, 10.0, 20.0, 3.0);
        assert!((part - 0.1).abs() < 1e-6 && (kept * kept - (1.0 - 1.1 / 3.0)).abs() < 1e-5);
        assert_eq!(pressed(0.1, 0.0, 20.0, 0.0), (0.0, 1.0));
        let mut affine = [[[1.0; LANES], [4.0; LANES]], [[2.0; LANES], [-1.0; LANES]]];
        slow_strain::<2>(&mut affine, 3, 0.5);
        let at = |row: usize, column: usize| affine[row][column][3];
        assert_eq!(
            [at(0, 0), at(0, 1), at(1, 0), at(1, 1)],
            [0.5, 2.5, 0.5, -0.5]
        );
    }

    #[test]
    fn matter_at_rest_is_not_corrected() {
        for rate in [SHARING, VOID, VOID_OF_GRAINS, CROWDING] {
            assert_eq!(rate.part(0.0, 5.0e-3), 0.0);
            assert_eq!(rate.part(rate.rest, 5.0e-3), 0.0);
            assert!(rate.part(1.1 * rate.rest, 5.0e-3) > 0.0);
            for dt in [5.0e-3, 2.5e-3] {
                assert!((rate.part(50.0, dt) - rate.most * dt).abs() < 1e-6);
            }
            assert!(rate.part(50.0, 1.0) <= 0.5);
        }
    }
}
