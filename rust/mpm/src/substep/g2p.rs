//! Grid to particles: velocity, affine matrix, deformation and position.
//!
//! v = sum_i w_ip v_i and C = (4 / dx^2) sum_i w_ip v_i (x_i - x_p)^T.

use wide::f32x4;

use crate::boundary::{Bounds, Obstacles};
use crate::grid::{Grid, Stencils};
use crate::linalg::{Kernel, LANES, Lanes, run_wide};
use crate::material::{Constitutive, State};
use crate::particles::{Activity, Block, MaterialGroup, with_group};
use threads::Team;

/// What one substep did to a set of particles.
#[derive(Debug, Clone, Copy)]
pub struct Outcome {
    pub max_speed_squared: f32,
    /// All particles are finite, inside and of positive volume.
    pub sound: bool,
}

impl Outcome {
    const NOTHING: Self = Self {
        max_speed_squared: 0.0,
        sound: true,
    };

    fn and(self, other: Self) -> Self {
        Self {
            max_speed_squared: self.max_speed_squared.max(other.max_speed_squared),
            sound: self.sound && other.sound,
        }
    }
}

/// Updates all particles from the grid's velocities, over a substep of `dt` [s].
pub fn g2p<const D: usize>(
    groups: &mut [MaterialGroup<D>],
    grid: &Grid<D>,
    bounds: &Bounds<D>,
    obstacles: &Obstacles<D>,
    dt: f32,
    team: &Team,
) -> Outcome {
    let mut outcome = Outcome::NOTHING;
    for group in groups {
        with_group!(group, group => {
            let (material, friction) = (&group.material, group.wall_friction);
            let share = group.awake.blocks.len().div_ceil(4 * team.size()).max(1);
            let mut parts: Vec<_> = group.awake.blocks.chunks_mut(share).map(|blocks| (blocks, Outcome::NOTHING)).collect();
            team.for_each(&mut parts, |(blocks, outcome)| {
                *outcome = run_wide(GatherBlocks { blocks, material, friction, grid, bounds, obstacles, dt });
            });
            // A maximum and a conjunction do not depend on how the work was cut.
            outcome = parts.iter().fold(outcome, |all, (_, part)| all.and(*part));
        });
    }
    outcome
}

/// Some blocks of one group.
struct GatherBlocks<'a, const D: usize, M: Constitutive<D>> {
    blocks: &'a mut [Block<D, M::State>],
    material: &'a M,
    friction: f32,
    grid: &'a Grid<D>,
    bounds: &'a Bounds<D>,
    obstacles: &'a Obstacles<D>,
    dt: f32,
}

/// Weighted sums over the nodes of each particle, each as velocity and mass.
pub struct Sums<const D: usize> {
    pub values: [f32x4; LANES],
    /// The same, each node times its steps from the lowest along an axis.
    pub moments: [[f32x4; LANES]; D],
}

impl<const D: usize, M: Constitutive<D>> Kernel for GatherBlocks<'_, D, M> {
    type Output = Outcome;

    #[inline(always)]
    fn run(self) -> Outcome {
        let Self {
            material,
            grid,
            bounds,
            obstacles,
            dt,
            friction,
            ..
        } = self;
        let mut max_speed_squared = f32x4::ZERO;
        let mut sound = true;
        for block in self.blocks {
            let stencils = Stencils::at(&block.x, &grid.layout);
            let sums = gather(grid, &stencils, block.count.min(LANES));
            let moved = move_block(block, &stencils, &sums, grid, bounds, dt);
            max_speed_squared = moved.max_speed_squared.fast_max(max_speed_squared);
            material.deform(&mut block.state, &block.affine, dt);
            let mut broken = 0u32;
            for i in 0..LANES {
                let state = M::State::load(&block.state, i);
                // Of NaN neither is true.
                let sound = material.volume_ratio(&state) > 0.0;
                broken |= u32::from(!sound);
            }
            sound &= broken == 0;
            if moved.outside {
                sound &= keep_inside(block, bounds);
            }
            if sound && obstacles.any() {
                push_out(block, &stencils, obstacles, friction);
            }
        }
        Outcome {
            max_speed_squared: max_speed_squared.to_array().into_iter().fold(0.0, f32::max),
            sound,
        }
    }
}

/// Sums over the nodes of the first `count` particles of a block.
#[inline(always)]
pub fn gather<const D: usize>(grid: &Grid<D>, stencils: &Stencils<D>, count: usize) -> Sums<D> {
    let mut sums = Sums {
        values: [f32x4::ZERO; LANES],
        moments: [[f32x4::ZERO; LANES]; D],
    };
    for i in 0..count {
        let start = stencils.start[i] as usize;
        let last = std::array::from_fn(|step| stencils.weights[D - 1][step][i]).map(f32x4::splat);
        let mut planes = [f32x4::ZERO; 3];
        let mut moments = [f32x4::ZERO; D];
        for (a, plane) in planes.iter_mut().enumerate() {
            let (weight, begin) = (
                stencils.weights[0][a][i],
                start + grid.layout.stencil_row([a, 0]),
            );
            if D == 3 {
                let rows: [_; 3] = std::array::from_fn(|b| {
                    let weight = weight * stencils.weights[1][b][i];
                    gather_row(
                        &grid.nodes,
                        begin + b * grid.layout.row_length,
                        weight,
                        &last,
                    )
                });
                let beyond = rows[1].0 + rows[2].0;
                *plane = rows[0].0 + beyond;
                moments[1] += beyond + rows[2].0;
                moments[D - 1] += rows[0].1 + rows[1].1 + rows[2].1;
            } else {
                let (sum, moment) = gather_row(&grid.nodes, begin, weight, &last);
                *plane = sum;
                moments[D - 1] += moment;
            }
        }
        let beyond = planes[1] + planes[2];
        moments[0] = beyond + planes[2];
        sums.values[i] = planes[0] + beyond;
        for axis in 0..D {
            sums.moments[axis][i] = moments[axis];
        }
    }
    sums
}

/// Weighted sum over three nodes, and that of each node times its steps from the first.
#[inline(always)]
fn gather_row(nodes: &[f32x4], begin: usize, weight: f32, last: &[f32x4; 3]) -> (f32x4, f32x4) {
    let row: &[f32x4; 3] = nodes[begin..begin + 3].try_into().expect("three nodes");
    let end = row[2] * last[2];
    let beyond = row[1] * last[1] + end;
    let weight = f32x4::splat(weight);
    (
        (row[0] * last[0] + beyond) * weight,
        (beyond + end) * weight,
    )
}

/// What `move_block` found on its way.
struct Moved {
    max_speed_squared: f32x4,
    /// Whether a particle has left the walls.
    outside: bool,
}

/// Sets velocity and affine matrix, and moves the particles.
#[inline(always)]
fn move_block<const D: usize, S: State>(
    block: &mut Block<D, S>,
    stencils: &Stencils<D>,
    sums: &Sums<D>,
    grid: &Grid<D>,
    bounds: &Bounds<D>,
    dt: f32,
) -> Moved {
    let (dt, per_cell) = (f32x4::splat(dt), f32x4::splat(4.0 / grid.layout.dx()));
    let mut moved = Moved {
        max_speed_squared: f32x4::ZERO,
        outside: false,
    };
    let mut inside = f32x4::ZERO.simd_eq(f32x4::ZERO);
    // Four particles at a time, from one vector a particle to one vector a component.
    for four in (0..LANES).step_by(4) {
        let v = transposed(&sums.values, four);
        let mut speed_squared = f32x4::ZERO;
        for row in 0..D {
            let x = load(&block.x[row], four) + v[row] * dt;
            store(&mut block.v[row], four, v[row]);
            store(&mut block.x[row], four, x);
            speed_squared += v[row] * v[row];
            // False for NaN.
            inside &= x.simd_ge(f32x4::splat(bounds.walls.lower[row]));
            inside &= x.simd_le(f32x4::splat(bounds.walls.upper[row]));
        }
        // Of two numbers of which one is NaN, the second.
        moved.max_speed_squared = speed_squared.fast_max(moved.max_speed_squared);
        for axis in 0..D {
            let moments = transposed(&sums.moments[axis], four);
            let offset = load(&stencils.offset[axis], four);
            for row in 0..D {
                store(
                    &mut block.affine[row][axis],
                    four,
                    (moments[row] - v[row] * offset) * per_cell,
                );
            }
        }
    }
    moved.outside = !inside.all();
    moved
}

#[inline(always)]
fn transposed(values: &[f32x4; LANES], from: usize) -> [f32x4; 4] {
    f32x4::transpose(std::array::from_fn(|k| values[from + k]))
}

#[inline(always)]
fn load(lanes: &Lanes, from: usize) -> f32x4 {
    f32x4::from(std::array::from_fn::<f32, 4, _>(|k| lanes[from + k]))
}

#[inline(always)]
fn store(lanes: &mut Lanes, from: usize, values: f32x4) {
    lanes[from..from + 4].copy_from_slice(&values.to_array());
}

/// Puts particles back between the walls; false if one is too far past them.
#[cold]
fn keep_inside<const D: usize, S: State>(block: &mut Block<D, S>, bounds: &Bounds<D>) -> bool {
    let mut sound = true;
    for lane in 0..block.count {
        let mut particle = block.get(lane, Activity::Awake);
        if !bounds.walls.contains(&particle.x) {
            sound &= bounds.put_back(&mut particle.x, &mut particle.v);
            block.set(lane, &particle);
        }
    }
    sound
}

/// Moves particles that got into an obstacle back to its surface.
fn push_out<const D: usize, S: State>(
    block: &mut Block<D, S>,
    stencils: &Stencils<D>,
    obstacles: &Obstacles<D>,
    friction: f32,
) {
    for lane in 0..block.count {
        if obstacles.near(stencils.start[lane] as usize) {
            let mut particle = block.get(lane, Activity::Awake);
            obstacles.push_out(&mut particle.x, &mut particle.v, friction);
            block.set(lane, &particle);
        }
    }
}
