//! Motion prescribed from outside, for example by a network.
//!
//! Grid velocities follow from the particles' by the transfers of a substep, without stress and gravity. They give
//! the affine matrices, and these may deform the materials, with return mapping.

use super::frame_loop::Solver;
use crate::boundary::{Bounds, Obstacles};
use crate::error::MpmError;
use crate::force::FrameForce;
use crate::grid::{Grid, Stencils};
use crate::linalg::{Kernel, LANES, Quad, Vector, norm, run_wide};
use crate::material::{Constitutive, State};
use crate::particles::{Activity, Block, Group, with_group};
use crate::substep::{P2gStep, Stage, gather};

/// Treatment of affine matrices and materials by a prescribed motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PrescribeOptions {
    /// Take the affine matrices from the grid velocities; else they are 0.
    pub affine: bool,
    /// Deform the materials by the affine matrices over the frames since; else their state stays.
    pub deform: bool,
}

/// A deformation is cut into steps of at most this strain: the materials take I + dt C for exp(dt C).
const STRAIN_PER_STEP: f32 = 0.05;
const MAX_STEPS: f32 = 64.0;

/// Report of a prescribed motion, in numbers that show whether it is plausible.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionReport {
    /// Density over rest density that one particle in a hundred exceeds [-].
    pub density: f32,
    /// Root mean square of the divergence of velocity [1/s].
    pub divergence: f32,
    /// Kinetic energy of the particles' velocities without their affine part [J].
    pub kinetic_energy: f64,
    /// Potential energy -m g . x [J].
    pub potential_energy: f64,
}

impl<const D: usize> Solver<D> {
    /// Sets N x D positions [m] and velocities [m/s], in the caller's order, as those at the end of frame `frame`.
    ///
    /// Particles less than a cell past a wall, or in an obstacle, are moved to its surface. On an error the state is
    /// unchanged.
    pub fn prescribe(
        &mut self,
        x: &[f32],
        v: &[f32],
        frame: u64,
        options: PrescribeOptions,
    ) -> Result<MotionReport, MpmError> {
        let size = self.count() * D;
        for (name, got) in [("x", x.len()), ("v", v.len())] {
            if got != size {
                return Err(MpmError::Length {
                    name,
                    expected: size,
                    got,
                });
            }
        }
        let is_fixed = self.settings.openings.any() || self.settings.sleep.is_some();
        if is_fixed || self.bodies.is_some() {
            let allowed =
                "without emitters, sinks, sleep and rigid bodies where motion is prescribed";
            return Err(MpmError::parameter("the scene", allowed, "some"));
        }
        self.check_motion(x, v)?;
        self.remember();
        let max_speed = self.state.max_speed;
        let frames = frame.saturating_sub(self.state.frame);
        let dt = frames as f32 * self.settings.frame_dt;
        let end = frame as f64 * f64::from(self.settings.frame_dt);
        self.obstacles.move_to(end, 0.0);
        for group in &mut self.state.groups {
            with_group!(group, group => place(group, x, v, &self.bounds, &self.obstacles));
        }
        self.sort();
        let largest = self.transfer();
        let steps = if options.deform {
            (largest * dt / STRAIN_PER_STEP)
                .ceil()
                .clamp(1.0, MAX_STEPS)
        } else {
            0.0
        };
        let (report, sound) = self.deform(dt, steps as u32);
        if !sound {
            let error = self.diagnose();
            std::mem::swap(&mut self.state.groups, &mut self.before);
            self.state.max_speed = max_speed;
            return Err(error);
        }
        if options.deform && dt > 0.0 {
            self.correct_volumes(dt);
        }
        self.state.max_speed = v.chunks_exact(D).map(norm).fold(0.0, f32::max);
        self.state.frame = frame;
        self.last_frame = None;
        if !options.affine {
            self.forget_affine();
        }
        Ok(report)
    }

    fn check_motion(&self, x: &[f32], v: &[f32]) -> Result<(), MpmError> {
        let frame = self.state.frame;
        for (particle, (x, v)) in (0..).zip(x.chunks_exact(D).zip(v.chunks_exact(D))) {
            if !x.iter().chain(v).all(|s| s.is_finite()) {
                return Err(MpmError::NonFinite { particle, frame });
            }
            if !self.bounds.allows(&Vector::from_column_slice(x)) {
                return Err(MpmError::LeftDomain {
                    particle,
                    frame,
                    position: x.to_vec(),
                    margin: self.grid.layout.dx(),
                });
            }
        }
        Ok(())
    }

    /// Sets the affine matrices from the velocities and the affine matrices so far; returns the largest entry.
    fn transfer(&mut self) -> f32 {
        let step = P2gStep {
            dt: 0.0,
            force: FrameForce::None,
        };
        self.run(&[Stage::P2g, Stage::GridUpdate, Stage::Across], step, true);
        let mut largest = 0.0;
        for group in &mut self.state.groups {
            with_group!(group, group => {
                let blocks = &mut group.awake.blocks;
                largest = run_wide(Gradients { blocks, grid: &self.grid }).max(largest);
            });
        }
        largest
    }

    fn forget_affine(&mut self) {
        for group in &mut self.state.groups {
            with_group!(group, group => for block in &mut group.awake.blocks {
                block.affine = [[[0.0; LANES]; D]; D];
            });
        }
    }

    /// Deforms all particles by their affine matrices; false when one is no longer sound.
    fn deform(&mut self, dt: f32, steps: u32) -> (MotionReport, bool) {
        let step_dt = dt / steps.max(1) as f32;
        let mut totals = Totals::new(self.count());
        for group in &mut self.state.groups {
            with_group!(group, group => run_wide(Deform {
                blocks: &mut group.awake.blocks,
                material: &group.material,
                grid: &self.grid,
                bounds: &self.bounds,
                gravity: self.settings.gravity,
                step_dt,
                steps,
                totals: &mut totals,
            }));
        }
        totals.report()
    }
}

/// Moves each particle to its prescribed position, within the walls and outside the obstacles.
fn place<const D: usize, M: Constitutive<D>>(
    group: &mut Group<D, M>,
    x: &[f32],
    v: &[f32],
    bounds: &Bounds<D>,
    obstacles: &Obstacles<D>,
) {
    let friction = group.wall_friction;
    for block in &mut group.awake.blocks {
        for lane in 0..block.count {
            let mut particle = block.get(lane, Activity::Awake);
            let first = particle.id as usize * D;
            particle.x = Vector::from_column_slice(&x[first..][..D]);
            particle.v = Vector::from_column_slice(&v[first..][..D]);
            particle.affine.fill(0.0);
            if obstacles.any() {
                obstacles.push_out(&mut particle.x, &mut particle.v, friction, |_, _, _| ());
            }
            bounds.clamp(&mut particle.x, &mut particle.v);
            block.set(lane, &particle);
        }
    }
}

/// Affine matrices from the grid's velocities; the particles' own velocities stay.
struct Gradients<'a, const D: usize, S: State> {
    blocks: &'a mut [Block<D, S>],
    grid: &'a Grid<D>,
}

impl<const D: usize, S: State> Kernel for Gradients<'_, D, S> {
    type Output = f32;

    #[inline(always)]
    fn run<Q: Quad>(self) -> f32 {
        let per_cell = 4.0 / self.grid.layout.dx();
        let mut largest = 0.0f32;
        for block in self.blocks {
            let stencils = Stencils::at(&block.x, &self.grid.layout);
            let count = block.count.min(LANES);
            let sums = gather::<Q, D, false>(self.grid.view(), &stencils, count);
            for i in 0..count {
                let v = sums.value(i).to_array();
                for axis in 0..D {
                    let moments = sums.moment(axis, i).to_array();
                    for row in 0..D {
                        let entry = (moments[row] - v[row] * stencils.offset[axis][i]) * per_cell;
                        block.affine[row][axis][i] = entry;
                        largest = largest.max(entry.abs());
                    }
                }
            }
        }
        largest
    }
}

struct Deform<'a, const D: usize, M: Constitutive<D>> {
    blocks: &'a mut [Block<D, M::State>],
    material: &'a M,
    grid: &'a Grid<D>,
    bounds: &'a Bounds<D>,
    gravity: Vector<D>,
    step_dt: f32,
    steps: u32,
    totals: &'a mut Totals,
}

impl<const D: usize, M: Constitutive<D>> Kernel for Deform<'_, D, M> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        let per_cell_volume = 1.0 / self.grid.layout.dx().powi(D as i32);
        for block in self.blocks {
            let stencils = Stencils::at(&block.x, &self.grid.layout);
            let count = block.count.min(LANES);
            let sums = gather::<Q, D, false>(self.grid.view(), &stencils, count);
            // The density of a particle's own material, whatever the others weigh.
            let mut density = [0.0; LANES];
            for i in 0..count {
                let mass = sums.value(i).to_array()[3];
                density[i] = mass * per_cell_volume * block.volume[i] / block.mass[i];
            }
            let room = self.bounds.room(&stencils);
            (0..count).for_each(|i| density[i] /= room[i]);
            for _ in 0..self.steps {
                self.material.deform(
                    &mut block.state,
                    &block.affine,
                    self.step_dt,
                    self.bounds.slow,
                );
            }
            let ratios = self.material.volume_ratios(&block.state);
            for i in 0..count {
                self.totals.sound &= ratios[i] > 0.0;
                self.totals.add(block, i, density[i], &self.gravity);
            }
        }
    }
}

/// Sums over all particles.
struct Totals {
    density: Vec<f32>,
    divergence_squared: f64,
    kinetic_energy: f64,
    potential_energy: f64,
    sound: bool,
}

impl Totals {
    fn new(count: usize) -> Self {
        Self {
            density: Vec::with_capacity(count),
            divergence_squared: 0.0,
            kinetic_energy: 0.0,
            potential_energy: 0.0,
            sound: true,
        }
    }

    #[inline(always)]
    fn add<const D: usize, S: State>(
        &mut self,
        block: &Block<D, S>,
        lane: usize,
        density: f32,
        gravity: &Vector<D>,
    ) {
        let (mut divergence, mut speed_squared, mut height) = (0.0, 0.0, 0.0);
        for axis in 0..D {
            divergence += f64::from(block.affine[axis][axis][lane]);
            speed_squared += f64::from(block.v[axis][lane]).powi(2);
            height += f64::from(gravity[axis]) * f64::from(block.x[axis][lane]);
        }
        let mass = f64::from(block.mass[lane]);
        self.density.push(density);
        self.divergence_squared += divergence * divergence;
        self.kinetic_energy += 0.5 * mass * speed_squared;
        self.potential_energy -= mass * height;
    }

    fn report(mut self) -> (MotionReport, bool) {
        let count = self.density.len();
        let density = if count == 0 {
            0.0
        } else {
            let rank = (count - 1) * 99 / 100;
            *self.density.select_nth_unstable_by(rank, f32::total_cmp).1
        };
        let report = MotionReport {
            density,
            divergence: (self.divergence_squared / count.max(1) as f64).sqrt() as f32,
            kinetic_energy: self.kinetic_energy,
            potential_energy: self.potential_energy,
        };
        (report, self.sound)
    }
}
