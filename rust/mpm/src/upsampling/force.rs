//! Forces on shown particles, converted to forces on coarse particles.

use super::block::{Block, Shown, blocks};
use super::coarse::Previous;
use super::field::{Field, Sample};
use super::interpolation::interpolate_velocities;
use crate::linalg::{LANES, Matrix, Vector};
use threads::Team;

/// Mean acceleration, weighted by mass, of the shown particles around each coarse particle, n x D [m/s^2].
///
/// `force` are the accelerations of the shown particles, N x D [m/s^2]. They are scattered to the nodes and interpolated
/// to the coarse particles: the reverse path of displacements. It is 0 without shown particles nearby.
pub fn gather_force<const D: usize>(
    shown: &[Block<D>],
    force: &[f32],
    previous: &Previous<D>,
    field: &mut Field<D>,
    team: &Team,
) -> Vec<f32> {
    let samples: Vec<_> = force
        .chunks_exact(D)
        .enumerate()
        .map(|(index, force)| {
            let (block, lane) = (&shown[index / LANES], index % LANES);
            Sample {
                x: block.position(lane),
                shift: Vector::from_column_slice(force),
                gradient: Matrix::zeros(),
                mass: block.mass[lane],
            }
        })
        .collect();
    field.scatter(&samples);
    let coarse: Vec<_> = previous
        .x
        .iter()
        .map(|&x| Shown {
            x,
            v: Vector::zeros(),
            mass: 1.0,
            volume: 1.0,
            material: 0,
        })
        .collect();
    let mut coarse_blocks = blocks(&coarse);
    interpolate_velocities(&mut coarse_blocks, field, team);
    (0..coarse.len())
        .flat_map(|index| {
            let a = coarse_blocks[index / LANES].velocity(index % LANES);
            (0..D).map(move |axis| a[axis])
        })
        .collect()
}
