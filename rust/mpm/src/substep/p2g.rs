//! Particles to grid (Hu et al. 2018, eq. 16-19; APIC by Jiang et al. 2015).
//!
//! Node i receives w_ip (m v + A (x_i - x_p)) with A = m C - dt V_0 (4 / dx^2) tau, and w_ip m.

use wide::f32x4;

use crate::force::FrameForce;
use crate::grid::{Grid, Layout, Stencils, Window};
use crate::linalg::{Kernel, LANES, Lanes, run_wide, shear_index};
use crate::material::{Constitutive, State};
use crate::particles::{Block, MaterialGroup, Slab, for_each_slab, with_group};
use threads::Team;

/// What one substep needs besides the state.
#[derive(Clone, Copy)]
pub struct P2gStep<'a, const D: usize> {
    /// Length of the substep [s].
    pub dt: f32,
    pub force: FrameForce<'a, D>,
}

/// Adds all particles to a cleared grid.
pub fn p2g<const D: usize>(
    groups: &[MaterialGroup<D>],
    slabs: &[Slab],
    grid: &mut Grid<D>,
    step: P2gStep<'_, D>,
    team: &Team,
) {
    for_each_slab(slabs, grid, team, |slab, window| {
        for group in groups {
            with_group!(group, group => {
                for blocks in [group.awake.of_slab(slab), group.border.of_slab(slab)] {
                    run_wide(Scatter {
                        blocks,
                        material: &group.material,
                        layout: window.layout,
                        step,
                        first: window.first,
                        nodes: window.nodes,
                    });
                    if !window.friction_mass.is_empty() {
                        scatter_friction(blocks, group.wall_friction, window);
                    }
                }
            });
        }
    });
}

/// The blocks of one group in one slab.
struct Scatter<'a, const D: usize, M: Constitutive<D>> {
    blocks: &'a [Block<D, M::State>],
    material: &'a M,
    layout: Layout<D>,
    step: P2gStep<'a, D>,
    /// Memory index of the first of `nodes`.
    first: usize,
    nodes: &'a mut [f32x4],
}

/// What the nodes of a particle get, in lanes of momentum and mass.
struct Shares<const D: usize> {
    /// The lowest node at weight one.
    lowest: [[f32; 4]; LANES],
    /// What a node gets more for each step along an axis.
    per_step: [[[f32; 4]; LANES]; D],
}

impl<const D: usize, M: Constitutive<D>> Kernel for Scatter<'_, D, M> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let row_length = self.layout.row_length;
        for block in self.blocks {
            let stencils = Stencils::at(&block.x, &self.layout);
            let shares = self.shares(block, &stencils);
            for i in 0..block.count.min(LANES) {
                let start = stencils.start[i] as usize - self.first;
                let last =
                    std::array::from_fn(|step| stencils.weights[D - 1][step][i]).map(f32x4::splat);
                let along = f32x4::from(shares.per_step[D - 1][i]);
                let mut value = f32x4::from(shares.lowest[i]);
                for a in 0..3 {
                    let weight = stencils.weights[0][a][i];
                    let begin = start + self.layout.stencil_row([a, 0]);
                    if D == 3 {
                        let mut value = value;
                        for b in 0..3 {
                            let weight = weight * stencils.weights[1][b][i];
                            scatter_row(
                                self.nodes,
                                begin + b * row_length,
                                value,
                                along,
                                weight,
                                &last,
                            );
                            value += f32x4::from(shares.per_step[1][i]);
                        }
                    } else {
                        scatter_row(self.nodes, begin, value, along, weight, &last);
                    }
                    value += f32x4::from(shares.per_step[0][i]);
                }
            }
        }
    }
}

impl<const D: usize, M: Constitutive<D>> Scatter<'_, D, M> {
    #[inline(always)]
    fn shares(&self, block: &Block<D, M::State>, stencils: &Stencils<D>) -> Shares<D> {
        let dx = self.layout.dx();
        let stress_factor = -self.step.dt * 4.0 / dx;
        let stress = self.material.kirchhoff_stress(&block.state);
        let v = self.pushed(block);
        let mut shares = Shares {
            lowest: [[0.0; 4]; LANES],
            per_step: [[[0.0; 4]; LANES]; D],
        };
        for i in 0..LANES {
            let mass = block.mass[i];
            let (inertia, tension) = (mass * dx, stress_factor * block.volume[i]);
            let mut lowest = [0.0; 4];
            for row in 0..D {
                lowest[row] = mass * v[row][i];
            }
            lowest[3] = mass;
            for axis in 0..D {
                let mut step = [0.0; 4];
                for row in 0..D {
                    let tau = if row == axis {
                        stress.diagonal[row][i]
                    } else {
                        stress.shear[shear_index::<D>(row, axis)][i]
                    };
                    step[row] = block.affine[row][axis][i] * inertia + tau * tension;
                    lowest[row] -= step[row] * stencils.offset[axis][i];
                }
                shares.per_step[axis][i] = step;
            }
            shares.lowest[i] = lowest;
        }
        shares
    }

    /// Velocities after the push of the external force.
    #[inline(always)]
    fn pushed(&self, block: &Block<D, M::State>) -> [Lanes; D] {
        let mut v = block.v;
        match self.step.force {
            FrameForce::None => {}
            FrameForce::Uniform(a) => {
                for axis in 0..D {
                    let gain = self.step.dt * a[axis];
                    v[axis].iter_mut().for_each(|v| *v += gain);
                }
            }
            FrameForce::PerParticle(all) => {
                for i in 0..block.count.min(LANES) {
                    let a = &all[block.id[i] as usize * D..][..D];
                    for axis in 0..D {
                        v[axis][i] += self.step.dt * a[axis];
                    }
                }
            }
        }
        v
    }
}

/// Adds a particle's share to three nodes.
#[inline(always)]
pub fn scatter_row(
    nodes: &mut [f32x4],
    begin: usize,
    lowest: f32x4,
    along: f32x4,
    weight: f32,
    last: &[f32x4; 3],
) {
    let row: &mut [f32x4; 3] = (&mut nodes[begin..begin + 3])
        .try_into()
        .expect("three nodes");
    let weight = f32x4::splat(weight);
    let (lowest, along) = (lowest * weight, along * weight);
    let middle = lowest + along;
    row[0] += lowest * last[0];
    row[1] += middle * last[1];
    row[2] += (middle + along) * last[2];
}

/// Wall friction as a mass-weighted quantity, where materials differ in it.
fn scatter_friction<const D: usize, S: State>(
    blocks: &[Block<D, S>],
    friction: f32,
    window: &mut Window<'_, D>,
) {
    for block in blocks.iter().filter(|_| friction > 0.0) {
        let stencils = Stencils::at(&block.x, &window.layout);
        for i in 0..block.count {
            let start = stencils.start[i] as usize - window.first;
            for_each_row::<D>(|a, b| {
                let across = if D == 3 {
                    stencils.weights[1][b][i]
                } else {
                    1.0
                };
                let weight = stencils.weights[0][a][i] * across * block.mass[i] * friction;
                for step in 0..3 {
                    let node = start + window.layout.stencil_row([a, b]) + step;
                    window.friction_mass[node] += weight * stencils.weights[D - 1][step][i];
                }
            });
        }
    }
}

/// Calls back for each row of nodes of a stencil.
#[inline(always)]
pub fn for_each_row<const D: usize>(mut visit: impl FnMut(usize, usize)) {
    for a in 0..3 {
        if D == 3 {
            (0..3).for_each(|b| visit(a, b));
        } else {
            visit(a, 0);
        }
    }
}
