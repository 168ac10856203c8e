//! The field of motion at the many particles.

use wide::f32x4;

use super::block::Block;
use super::field::Field;
use crate::grid::{Layout, Stencils};
use crate::linalg::{Kernel, LANES, Lanes, Quad, Vector, run_wide};
use threads::Team;

/// Sum of a particle's weights on nodes with mass [-] that it must have for the few to carry it.
const SUPPORT: f32 = 1.0e-3;

/// Moves all particles along with a field of displacements that took `dt` [s]. Those that nothing carries fly on.
pub fn move_along<const D: usize>(
    blocks: &mut [Block<D>],
    field: &Field<D>,
    gravity: &Vector<D>,
    dt: f32,
    team: &Team,
) {
    let share = blocks.len().div_ceil(4 * team.size()).max(1);
    let mut parts: Vec<_> = blocks.chunks_mut(share).collect();
    team.for_each(&mut parts, |blocks| {
        run_wide(MoveAlong {
            blocks,
            field,
            gravity: *gravity,
            dt,
        });
    });
}

struct MoveAlong<'a, const D: usize> {
    blocks: &'a mut [Block<D>],
    field: &'a Field<D>,
    gravity: Vector<D>,
    dt: f32,
}

impl<const D: usize> Kernel for MoveAlong<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        let (dt, rate) = (self.dt, 1.0 / self.dt);
        for block in self.blocks {
            let (motion, support) = motion_at::<Q, D>(self.field, &block.x);
            for axis in 0..D {
                let gain = self.gravity[axis] * dt;
                for i in 0..LANES {
                    let carried = support[i] > SUPPORT;
                    let flight = (block.v[axis][i] + 0.5 * gain) * dt;
                    let shift = if carried { motion[axis][i] } else { flight };
                    let v = block.v[axis][i] + gain;
                    block.x[axis][i] += shift;
                    block.v[axis][i] = if carried { shift * rate } else { v };
                }
            }
        }
    }
}

/// Gives all particles the motion of a field as their velocity; those that nothing carries keep theirs.
pub fn take_velocities<const D: usize>(blocks: &mut [Block<D>], field: &Field<D>, team: &Team) {
    let share = blocks.len().div_ceil(4 * team.size()).max(1);
    let mut parts: Vec<_> = blocks.chunks_mut(share).collect();
    team.for_each(&mut parts, |blocks| {
        run_wide(TakeVelocities { blocks, field });
    });
}

struct TakeVelocities<'a, const D: usize> {
    blocks: &'a mut [Block<D>],
    field: &'a Field<D>,
}

impl<const D: usize> Kernel for TakeVelocities<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        for block in self.blocks {
            let (motion, support) = motion_at::<Q, D>(self.field, &block.x);
            for axis in 0..D {
                for i in 0..LANES {
                    let carried = support[i] > SUPPORT;
                    let v = block.v[axis][i];
                    block.v[axis][i] = if carried { motion[axis][i] } else { v };
                }
            }
        }
    }
}

/// The motion at each place of a block, and the sums of the weights on nodes with mass.
#[inline(always)]
fn motion_at<Q: Quad, const D: usize>(field: &Field<D>, x: &[Lanes; D]) -> ([Lanes; D], Lanes) {
    let layout = &field.layout;
    let stencils = Stencils::at(x, layout);
    let mut motion = [[0.0; LANES]; D];
    let mut support = [0.0; LANES];
    for four in (0..LANES).step_by(4) {
        let mut sums = [Q::zero(); 4];
        for k in 0..4 {
            sums[k] = weighted(&field.nodes, layout, &stencils, four + k);
        }
        let lanes = f32x4::transpose(Q::sums(sums));
        for axis in 0..D {
            motion[axis][four..four + 4].copy_from_slice(&lanes[axis].to_array());
        }
        support[four..four + 4].copy_from_slice(&lanes[3].to_array());
    }
    for axis in 0..D {
        for i in 0..LANES {
            motion[axis][i] /= support[i].max(SUPPORT);
        }
    }
    (motion, support)
}

/// The nodes of one particle by their weights, summed but for the last axis.
#[inline(always)]
fn weighted<Q: Quad, const D: usize>(
    nodes: &[f32x4],
    layout: &Layout<D>,
    stencils: &Stencils<D>,
    i: usize,
) -> Q {
    let start = stencils.start[i] as usize;
    // One check for all rows of the stencil.
    let nodes = &nodes[start..start + layout.stencil_row([2, 2]) + 4];
    let mut sum = Q::zero();
    for a in 0..3 {
        let mut plane: Q = load_row(nodes, layout.stencil_row([a, 0]));
        if D == 3 {
            plane = plane.mul(Q::splat(stencils.weights[1][0][i]));
            for b in 1..3 {
                let row: Q = load_row(nodes, layout.stencil_row([a, b]));
                plane = row.mul_add(Q::splat(stencils.weights[1][b][i]), plane);
            }
        }
        sum = plane.mul_add(Q::splat(stencils.weights[0][a][i]), sum);
    }
    let last = &stencils.weights[D - 1];
    sum.mul(Q::of_nodes([last[0][i], last[1][i], last[2][i], 0.0]))
}

#[inline(always)]
fn load_row<Q: Quad>(nodes: &[f32x4], begin: usize) -> Q {
    Q::load(nodes[begin..begin + 4].try_into().expect("four nodes"))
}
