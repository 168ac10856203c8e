//! Grid to particles: velocity, affine matrix, deformation and position.
//!
//! v = sum_i w_ip v_i and C = (4 / dx^2) sum_i w_ip v_i (x_i - x_p)^T.

use rayon::prelude::*;
use wide::f32x4;

use crate::grid::{Grid, Layout};
use crate::material::Constitutive;
use crate::math::{Matrix, Vector};
use crate::obstacle::Obstacles;
use crate::p2g::for_each_row;
use crate::particle::{Particle, Phase};
use crate::stencil::Stencil;
use crate::walls::{WallFill, Walls};
use crate::with_group;

/// Where particles may be.
#[derive(Debug, Clone)]
pub struct Bounds<const D: usize> {
    /// Particles past a wall are put back on it.
    pub walls: Walls<D>,
    /// Farther than this is an error.
    pub lowest: Vector<D>,
    pub highest: Vector<D>,
    fill: WallFill<D>,
}

impl<const D: usize> Bounds<D> {
    pub fn new(walls: Walls<D>, layout: &Layout<D>) -> Self {
        let dx = layout.dx();
        Self {
            fill: WallFill::new(&walls, layout),
            walls,
            lowest: walls.lower.map(|s| (s - dx).max(0.0)),
            highest: walls.upper.map(|s| (s + dx).min(1.0)),
        }
    }

    /// False also for NaN.
    #[inline(always)]
    pub fn hold(&self, x: &Vector<D>) -> bool {
        (0..D).all(|axis| x[axis] >= self.lowest[axis] && x[axis] <= self.highest[axis])
    }
}

/// What one substep needs besides the grid.
#[derive(Debug, Clone, Copy)]
pub struct Gather {
    /// [s]
    pub dt: f32,
    /// One over the mass of a cell at rest density [1/kg]; 0 where bodies differ in density.
    pub per_rest_mass: f32,
}

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

/// Updates all particles from the grid's velocities.
pub fn g2p<const D: usize>(
    phases: &mut [Phase<D>],
    grid: &Grid<D>,
    bounds: &Bounds<D>,
    obstacles: &Obstacles<D>,
    step: Gather,
    parallel: bool,
) -> Outcome {
    let mut outcome = Outcome::NOTHING;
    for phase in phases {
        with_group!(phase, group => {
            let friction = group.wall_friction;
            let material = &group.material;
            let gather = |particles: &mut [Particle<D, _>]| {
                gather_group(particles, material, friction, grid, bounds, obstacles, step)
            };
            outcome = outcome.and(if parallel {
                // A maximum and a conjunction do not depend on their order.
                let chunk = group.particles.len().div_ceil(4 * rayon::current_num_threads()).max(1);
                group.particles.par_chunks_mut(chunk).map(gather).reduce(|| Outcome::NOTHING, Outcome::and)
            } else {
                gather(&mut group.particles)
            });
        });
    }
    outcome
}

#[inline(always)]
fn gather_group<const D: usize, M: Constitutive<D>>(
    particles: &mut [Particle<D, M::State>],
    material: &M,
    friction: f32,
    grid: &Grid<D>,
    bounds: &Bounds<D>,
    obstacles: &Obstacles<D>,
    step: Gather,
) -> Outcome {
    let (layout, dt) = (grid.layout, step.dt);
    let per_cell = 4.0 / layout.dx();
    let mut outcome = Outcome::NOTHING;
    for p in particles {
        let stencil = Stencil::at(&layout.cells(&p.x));
        let start = layout.row(stencil.base) * layout.extent + stencil.base[D - 1];
        let last = stencil.weights[D - 1].map(f32x4::splat);
        // Moments of the velocity: its weighted sum, and that times the step along each axis.
        let mut sum = f32x4::ZERO;
        let mut moments = [f32x4::ZERO; D];
        for_each_row::<D>(|i, j| {
            let begin = start + layout.stencil_row([i, j]);
            let row: &[f32x4; 3] = grid.nodes[begin..begin + 3]
                .try_into()
                .expect("three nodes");
            let mut weight = stencil.weights[0][i];
            if D == 3 {
                weight *= stencil.weights[1][j];
            }
            let weight = f32x4::splat(weight);
            let (middle, end) = (row[1] * last[1], row[2] * last[2]);
            let across = (row[0] * last[0] + middle + end) * weight;
            sum += across;
            moments[0] += across * f32x4::splat(i as f32);
            if D == 3 {
                moments[1] += across * f32x4::splat(j as f32);
            }
            moments[D - 1] += (middle + end + end) * weight;
        });
        let v = vector::<D>(sum);
        let mut affine = Matrix::<D>::zeros();
        for axis in 0..D {
            let column = vector::<D>(moments[axis]) - v * stencil.offset[axis];
            affine.set_column(axis, &(column * per_cell));
        }
        p.v = v;
        p.affine = affine;
        let crowding = sum.to_array()[3] * step.per_rest_mass / bounds.fill.at(&p.x, &stencil);
        material.deform(&mut p.state, &(affine * dt), crowding, dt);
        p.x += v * dt;
        let sound = bounds.hold(&p.x) && material.volume_ratio(&p.state) > 0.0;
        outcome.sound &= sound;
        outcome.max_speed_squared = outcome.max_speed_squared.max(v.norm_squared());
        if !sound {
            continue;
        }
        for axis in 0..D {
            // The grid keeps material off the walls; this catches what rounding and single fast
            // particles leave over.
            let inside = p.x[axis].clamp(bounds.walls.lower[axis], bounds.walls.upper[axis]);
            if inside != p.x[axis] {
                let inward = (inside - p.x[axis]).signum();
                p.x[axis] = inside;
                p.v[axis] = inward * (inward * p.v[axis]).max(0.0);
            }
        }
        if obstacles.near(start) {
            obstacles.push_out(&mut p.x, &mut p.v, friction);
        }
    }
    outcome
}

#[inline(always)]
fn vector<const D: usize>(lanes: f32x4) -> Vector<D> {
    let lanes = lanes.to_array();
    Vector::from_fn(|axis, _| lanes[axis])
}
