//! What particles hold for their volume, led back to the room that they take.

use super::{PRESSURE, VOLUME};
use crate::boundary::WallFill;
use crate::grid::{Grid, Stencils};
use crate::linalg::{Kernel, LANES, Lanes, run_wide};
use crate::material::{Constitutive, Correction};
use crate::particles::{Block, Group};
use crate::substep::gather;
use threads::Team;

/// How fast matter with room around it gives its false pressure away [1/s].
const VOID_RATE: f32 = 50.0;
/// Room [-] that is no contradiction.
const VOID_TOLERANCE: f32 = 0.03;
/// How fast crowded matter that deforms gains pressure [1/s]. Faster corrections feed waves.
const CROWDING_RATE: f32 = 20.0;
/// Crowding [-] that is no contradiction.
const CROWDING_TOLERANCE: f32 = 0.01;
/// The rate of the correction over the rate of strain, for matter that hardly deforms [-].
const PER_STRAIN: f32 = 100.0;

/// At a plane free surface the volume V on the grid and the distance d to the centre of the volume around, in
/// cells, belong together: 1 - V = SLOPE d^2 / (d + ROUNDING) within 0.007 in the mean over the places of the
/// surface on the grid. The rounding keeps the noise of d in the bulk from counting.
const SLOPE: f32 = 3.05;
const ROUNDING: f32 = 0.03;

/// How much of a contradiction one correction takes back.
#[derive(Debug, Clone, Copy)]
pub struct Rates {
    /// Part of its deviation from the mean pressure that a particle loses [-].
    pub sharing: f32,
    /// Time since the latest correction [s].
    pub dt: f32,
}

/// Corrects the particles of one group that are awake.
pub fn correct<const D: usize, M: Constitutive<D>>(
    group: &mut Group<D, M>,
    grid: &Grid<D>,
    room: &WallFill<D>,
    rates: Rates,
    team: &Team,
) {
    let material = &group.material;
    let share = group.awake.blocks.len().div_ceil(4 * team.size()).max(1);
    let mut parts: Vec<_> = group.awake.blocks.chunks_mut(share).collect();
    team.for_each(&mut parts, |blocks| {
        run_wide(CorrectBlocks {
            blocks,
            material,
            grid,
            room,
            rates,
        });
    });
}

/// Some blocks of one group.
struct CorrectBlocks<'a, const D: usize, M: Constitutive<D>> {
    blocks: &'a mut [Block<D, M::State>],
    material: &'a M,
    grid: &'a Grid<D>,
    room: &'a WallFill<D>,
    rates: Rates,
}

impl<const D: usize, M: Constitutive<D>> Kernel for CorrectBlocks<'_, D, M> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for block in self.blocks {
            let stencils = Stencils::at(&block.x, &self.grid.layout);
            let sums = gather(self.grid, &stencils, block.count.min(LANES));
            let (room, centre) = self.room.at(&stencils);
            let strain_rate = strain_rate(&block.affine);
            let mut correction = Correction {
                pressure: [0.0; LANES],
                sharing: self.rates.sharing,
                expansion: [0.0; LANES],
            };
            for i in 0..block.count.min(LANES) {
                let sum = sums.values[i].to_array();
                let mut distance_squared = 0.0;
                for axis in 0..D {
                    let moment = sums.moments[axis][i].to_array()[VOLUME];
                    distance_squared += (moment / sum[VOLUME] - centre[axis][i]).powi(2);
                }
                correction.pressure[i] = sum[PRESSURE];
                correction.expansion[i] = expansion(
                    sum[VOLUME] / room[i],
                    distance_squared,
                    strain_rate[i],
                    self.rates.dt,
                );
            }
            self.material.correct_volume(&mut block.state, &correction);
        }
    }
}

/// Relative change of volume that a particle is due, from the volume on the grid around it [-], the squared
/// distance to the centre of that volume [cells^2], and the rate of strain [1/s].
#[inline(always)]
fn expansion(volume: f32, distance_squared: f32, strain_rate: f32, dt: f32) -> f32 {
    let surface = SLOPE * distance_squared / (distance_squared.sqrt() + ROUNDING);
    let void = (1.0 - volume - surface - VOID_TOLERANCE).max(0.0);
    let crowding = (volume - 1.0 - CROWDING_TOLERANCE).clamp(0.0, 0.5);
    let rate = CROWDING_RATE.min(PER_STRAIN * strain_rate);
    (VOID_RATE * dt).min(0.5) * void - (rate * dt).min(0.5) * crowding
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
    fn room_gives_pressure_away_and_crowding_gains_it_only_where_matter_deforms() {
        let of = |volume, strain_rate| expansion(volume, 0.0, strain_rate, 2.5e-3);
        assert_eq!(
            (of(1.0, 9.0), of(0.98, 9.0), of(1.01, 9.0)),
            (0.0, 0.0, 0.0)
        );
        assert!((of(0.83, 0.0) - 0.125 * 0.14).abs() < 1e-6);
        assert_eq!(of(1.3, 0.0), 0.0);
        assert!((of(1.11, 9.0) + 0.05 * 0.1).abs() < 1e-6);
        // A particle at a surface has little volume around it, and all of it on one side.
        assert_eq!(expansion(0.6, 0.16 * 0.16, 9.0, 2.5e-3), 0.0);
    }
}
