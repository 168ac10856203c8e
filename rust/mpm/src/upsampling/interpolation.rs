//! Interpolation of the field of motion to shown particles.

use wide::f32x4;

use super::block::Block;
use super::field::Field;
use crate::grid::{Layout, Stencils};
use crate::linalg::{Kernel, LANES, Lanes, Quad, Vector, run_wide};
use threads::Team;

/// Sum of weights on nodes with mass [-] above which a particle follows the field.
const SUPPORT: f32 = 1.0e-3;

/// Writes particles `from` moved by a field of displacements over `dt` [s]; those away from nodes with mass fly freely.
pub fn advect<const D: usize>(
    from: &[Block<D>],
    to: &mut Vec<Block<D>>,
    field: &Field<D>,
    gravity: &Vector<D>,
    dt: f32,
    team: &Team,
) {
    if to.len() != from.len() {
        to.clear();
        to.extend_from_slice(from);
    }
    let share = from.len().div_ceil(4 * team.size()).max(1);
    let mut parts: Vec<_> = from.chunks(share).zip(to.chunks_mut(share)).collect();
    team.for_each(&mut parts, |(from, to)| {
        run_wide(Advect {
            from,
            to,
            field,
            gravity: *gravity,
            dt,
        });
    });
}

struct Advect<'a, const D: usize> {
    from: &'a [Block<D>],
    to: &'a mut [Block<D>],
    field: &'a Field<D>,
    gravity: Vector<D>,
    dt: f32,
}

impl<const D: usize> Kernel for Advect<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        let (dt, rate) = (self.dt, 1.0 / self.dt);
        for (from, to) in self.from.iter().zip(self.to) {
            let (motion, support) = motion_at::<Q, D>(self.field, &from.x);
            *to = *from;
            for axis in 0..D {
                let gain = self.gravity[axis] * dt;
                for i in 0..LANES {
                    let is_supported = support[i] > SUPPORT;
                    let flight = (from.v[axis][i] + 0.5 * gain) * dt;
                    let shift = if is_supported {
                        motion[axis][i]
                    } else {
                        flight
                    };
                    let v = from.v[axis][i] + gain;
                    to.x[axis][i] = from.x[axis][i] + shift;
                    to.v[axis][i] = if is_supported { shift * rate } else { v };
                }
            }
        }
    }
}

/// Sets velocities to those of a field; particles away from nodes with mass keep theirs.
pub fn interpolate_velocities<const D: usize>(
    blocks: &mut [Block<D>],
    field: &Field<D>,
    team: &Team,
) {
    let share = blocks.len().div_ceil(4 * team.size()).max(1);
    let mut parts: Vec<_> = blocks.chunks_mut(share).collect();
    team.for_each(&mut parts, |blocks| {
        run_wide(InterpolateVelocities { blocks, field });
    });
}

struct InterpolateVelocities<'a, const D: usize> {
    blocks: &'a mut [Block<D>],
    field: &'a Field<D>,
}

impl<const D: usize> Kernel for InterpolateVelocities<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        for block in self.blocks {
            let (motion, support) = motion_at::<Q, D>(self.field, &block.x);
            for axis in 0..D {
                for i in 0..LANES {
                    let is_supported = support[i] > SUPPORT;
                    let v = block.v[axis][i];
                    block.v[axis][i] = if is_supported { motion[axis][i] } else { v };
                }
            }
        }
    }
}

/// Motion at each position of a block, and the sum of weights on nodes with mass.
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
    let divisor = support.map(|sum| sum.max(SUPPORT));
    for of_axis in &mut motion {
        // In place the compiler would divide lane by lane, and scatter.
        let mut mean = [0.0; LANES];
        for i in 0..LANES {
            mean[i] = of_axis[i] / divisor[i];
        }
        *of_axis = mean;
    }
    (motion, support)
}

/// Weighted nodes of one particle, not yet summed along the last axis.
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
