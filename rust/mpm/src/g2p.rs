//! Grid to particles: velocity, affine matrix, deformation and position.
//!
//! v = sum_i w_ip v_i and C = (4 / dx^2) sum_i w_ip v_i (x_i - x_p)^T.

use rayon::prelude::*;
use wide::f32x4;

use crate::grid::{Grid, Layout};
use crate::material::Constitutive;
use crate::math::{Columns, Vector, vector};
use crate::obstacle::Obstacles;
use crate::particle::{Particle, Phase};
use crate::stencil::Stencil;
use crate::walls::{WallFill, Walls};
use crate::with_group;

/// Where particles may be.
#[derive(Debug, Clone)]
pub struct Bounds<const D: usize> {
    walls: Walls<D>,
    fill: WallFill<D>,
    /// Farther than this is an error.
    lowest: Vector<D>,
    highest: Vector<D>,
    /// Between these, no wall is near.
    inner_lowest: Vector<D>,
    inner_highest: Vector<D>,
}

impl<const D: usize> Bounds<D> {
    pub fn new(walls: Walls<D>, layout: &Layout<D>) -> Self {
        let dx = layout.dx();
        // A stencil and the splines of its nodes reach 3 cells; what a substep adds hardly weighs.
        let far = 3.0 * dx;
        Self {
            walls,
            fill: WallFill::new(&walls, layout),
            lowest: walls.lower.map(|s| (s - dx).max(0.0)),
            highest: walls.upper.map(|s| (s + dx).min(1.0)),
            inner_lowest: walls.lower.add_scalar(far),
            inner_highest: walls.upper.add_scalar(-far),
        }
    }

    /// Whether the position is allowed; false also for NaN.
    #[inline(always)]
    pub fn hold(&self, x: &Vector<D>) -> bool {
        (0..D).all(|axis| x[axis] >= self.lowest[axis] && x[axis] <= self.highest[axis])
    }

    /// Whether no wall is near; false also for NaN.
    #[inline(always)]
    fn inner(&self, x: &Vector<D>) -> bool {
        (0..D).all(|axis| x[axis] >= self.inner_lowest[axis] && x[axis] <= self.inner_highest[axis])
    }

    /// Puts a particle back on the wall that it passed; false if it is too far past.
    ///
    /// The grid keeps material off the walls; this catches what rounding and single fast particles leave
    /// over.
    #[cold]
    fn put_back(&self, x: &mut Vector<D>, v: &mut f32x4) -> bool {
        if !self.hold(x) {
            return false;
        }
        let mut lanes = v.to_array();
        for axis in 0..D {
            let inside = x[axis].clamp(self.walls.lower[axis], self.walls.upper[axis]);
            if inside < x[axis] {
                lanes[axis] = lanes[axis].min(0.0);
            } else if inside > x[axis] {
                lanes[axis] = lanes[axis].max(0.0);
            }
            x[axis] = inside;
        }
        *v = f32x4::from(lanes);
        true
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
    // The last lane of what is gathered is mass, which has no place in a velocity.
    let components = f32x4::from([1.0, 1.0, 1.0, 0.0]);
    let unit_mass = f32x4::from([0.0, 0.0, 0.0, 1.0]);
    let per_cell = components * f32x4::splat(4.0 / layout.dx());
    let mut outcome = Outcome::NOTHING;
    for p in particles {
        let stencil = Stencil::at(&layout.cells(&p.x));
        let start = layout.row(stencil.base) * layout.extent + stencil.base[D - 1];
        let last = stencil.weights[D - 1].map(f32x4::splat);
        // Weighted sum of the velocities of a row, and that times the step along it.
        let gather_row = |weight: f32, begin: usize| {
            let row: &[f32x4; 3] = grid.nodes[begin..begin + 3]
                .try_into()
                .expect("three nodes");
            let (middle, end) = (row[1] * last[1], row[2] * last[2]);
            let weight = f32x4::splat(weight);
            (
                (row[0] * last[0] + middle + end) * weight,
                (middle + end + end) * weight,
            )
        };
        let mut planes = [f32x4::ZERO; 3];
        let mut moments = [f32x4::ZERO; D];
        for (i, plane) in planes.iter_mut().enumerate() {
            let (weight, begin) = (stencil.weights[0][i], start + layout.stencil_row([i, 0]));
            if D == 3 {
                let rows: [_; 3] = std::array::from_fn(|j| {
                    gather_row(weight * stencil.weights[1][j], begin + j * layout.extent)
                });
                *plane = rows[0].0 + rows[1].0 + rows[2].0;
                moments[1] += rows[1].0 + rows[2].0 + rows[2].0;
                moments[D - 1] += rows[0].1 + rows[1].1 + rows[2].1;
            } else {
                let (sum, moment) = gather_row(weight, begin);
                *plane = sum;
                moments[D - 1] += moment;
            }
        }
        let sum = planes[0] + planes[1] + planes[2];
        moments[0] = planes[1] + planes[2] + planes[2];
        let v = vector::<D>(sum);
        p.v = sum * components + unit_mass;
        p.affine = Columns(std::array::from_fn(|axis| {
            (moments[axis] - sum * f32x4::splat(stencil.offset[axis])) * per_cell
        }));
        p.x += v * dt;
        outcome.max_speed_squared = outcome.max_speed_squared.max(v.norm_squared());
        let inner = bounds.inner(&p.x);
        let mut crowding = sum.to_array()[3] * step.per_rest_mass;
        if !inner {
            crowding /= bounds.fill.at(&stencil);
        }
        let gradient = Columns(p.affine.0.map(|column| column * f32x4::splat(dt)));
        material.deform(&mut p.state, &gradient, crowding, dt);
        outcome.sound &= material.volume_ratio(&p.state) > 0.0;
        if !inner && !bounds.walls.contain(&p.x) {
            outcome.sound &= bounds.put_back(&mut p.x, &mut p.v);
        }
        if outcome.sound && obstacles.near(start) {
            obstacles.push_out(&mut p.x, &mut p.v, friction);
        }
    }
    outcome
}
