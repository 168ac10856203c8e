//! Forces on many particles, handed to the few that carry them.

use super::block::{Block, Carried, blocks};
use super::few::Past;
use super::field::{Field, Mover};
use super::gather::take_velocities;
use crate::linalg::{LANES, Matrix, Vector};
use threads::Team;

/// Mean acceleration, weighted by mass, of the many around each of the few, N x D [m/s^2].
///
/// `force` are the accelerations of the many. They go to the nodes and from there to the few, as motion goes from the few
/// to the many. A particle without any of the many around gets none.
pub fn gather_force<const D: usize>(
    many: &[Block<D>],
    force: &[f32],
    past: &Past<D>,
    field: &mut Field<D>,
    team: &Team,
) -> Vec<f32> {
    let movers: Vec<_> = force
        .chunks_exact(D)
        .enumerate()
        .map(|(index, force)| {
            let (block, lane) = (&many[index / LANES], index % LANES);
            Mover {
                x: block.position(lane),
                shift: Vector::from_column_slice(force),
                gradient: Matrix::zeros(),
                mass: block.mass[lane],
            }
        })
        .collect();
    field.spread(&movers);
    let few: Vec<_> = past
        .x
        .iter()
        .map(|&x| Carried {
            x,
            v: Vector::zeros(),
            mass: 1.0,
            volume: 1.0,
            material: 0,
        })
        .collect();
    let mut few_blocks = blocks(&few);
    take_velocities(&mut few_blocks, field, team);
    (0..few.len())
        .flat_map(|index| {
            let a = few_blocks[index / LANES].velocity(index % LANES);
            (0..D).map(move |axis| a[axis])
        })
        .collect()
}
