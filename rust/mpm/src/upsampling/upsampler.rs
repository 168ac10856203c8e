//! `Upsampler`: all particles of a scene, moved with coarse particles.

use std::sync::Arc;

use super::block::{Block, Shown, blocks};
use super::coarse::{CoarseParticles, Previous};
use super::density::{DriftCorrection, Relaxation};
use super::exchange::ShownEnd;
use super::field::Field;
use super::force::gather_force;
use super::interpolation::{advect, interpolate_velocities};
use super::snapshot::{self, UpsamplerState};
use super::surfaces::Surfaces;
use crate::boundary::Obstacles;
use crate::error::MpmError;
use crate::grid::Layout;
use crate::initial::{Particles, check_particles};
use crate::linalg::{LANES, Lanes, Vector};
use crate::openings::{EmitterStatus, Population};
use crate::rigid::{Bodies, pose_of_numbers};
use crate::settings::{SolverSettings, check_grid};
use serde::{Deserialize, Serialize};
use threads::{Team, interrupted};

/// Frames from one update to the next in a scene without emitters and sinks.
const UPDATE_EVERY: u64 = 4;

/// Frames from one correction of the drift to the next; a multiple of `UPDATE_EVERY`.
const CORRECT_EVERY: u64 = 16;

/// Most passes of the density relaxation in an update. Most updates need at most two; in a splash at a wall eight did not
/// suffice.
const MAX_PASSES: usize = 24;

/// Constants of the upsampling.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct UpsamplingConstants {
    /// Part of the affine motion of coarse particles that is interpolated [-]. With 1 the centre of mass is most accurate,
    /// but particles clump; with 0 rotating bodies lag behind.
    pub affine_share: f32,
    /// Displacement of shown particles in each pass of the density relaxation [cells] per excess density and cell.
    pub relaxation: f32,
}

impl UpsamplingConstants {
    fn check(&self) -> Result<(), MpmError> {
        for (name, value, allowed, most) in [
            ("affine_share", self.affine_share, "in [0, 1]", 1.0),
            ("relaxation", self.relaxation, "in [0, 8] cells", 8.0),
        ] {
            if !(0.0..=most).contains(&value) {
                return Err(MpmError::parameter(name, allowed, value));
            }
        }
        Ok(())
    }
}

impl Default for UpsamplingConstants {
    fn default() -> Self {
        Self {
            affine_share: 0.5,
            relaxation: 2.0,
        }
    }
}

/// All particles of a scene, moved with coarse particles.
#[derive(Debug, Clone)]
pub struct Upsampler<const D: usize> {
    settings: SolverSettings<D>,
    constants: UpsamplingConstants,
    surfaces: Surfaces<D>,
    /// Motion on the coarse grid.
    field: Field<D>,
    relaxation: Relaxation<D>,
    drift: DriftCorrection<D>,
    team: Arc<Team>,
    state: UpsamplerState<D>,
    /// Frame after the latest update, and the particles computed for it.
    cache: Option<(u64, Vec<Block<D>>)>,
    /// Particles before the latest update, for one that is interrupted; also kept to reuse its memory.
    before: Vec<Block<D>>,
}

impl<const D: usize> Upsampler<D> {
    /// All particles of a scene at frame 0.
    ///
    /// `settings` are those of the scene, with its own emitters; `coarse_grid` has the cells per metre of the coarse grid, and
    /// its cells along each axis.
    pub fn new(
        settings: &SolverSettings<D>,
        coarse_grid: (usize, [usize; D]),
        constants: UpsamplingConstants,
        particles: Particles<'_>,
        coarse: &CoarseParticles<'_>,
    ) -> Result<Self, MpmError> {
        settings.check()?;
        constants.check()?;
        check_grid(coarse_grid.0, coarse_grid.1)?;
        check_particles(settings, particles)?;
        coarse.check::<D>()?;
        let layout = Layout::new(settings.resolution, settings.cells);
        let coarse_layout = Layout::new(coarse_grid.0, coarse_grid.1);
        let cell = layout.dx().powi(D as i32);
        let all: Vec<_> = (0..particles.mass.len())
            .map(|i| Shown {
                x: Vector::from_column_slice(&particles.x[i * D..][..D]),
                v: Vector::from_column_slice(&particles.v[i * D..][..D]),
                mass: particles.mass[i],
                volume: particles.volume[i] / cell,
                material: particles.material[i],
            })
            .collect();
        let walls = &settings.walls;
        let resting = settings.obstacles.iter().filter(|o| o.motion.is_none());
        let resting = Obstacles::new(resting.cloned().collect(), walls, &layout);
        let team = Arc::new(Team::new(settings.threads)?);
        Ok(Self {
            settings: settings.clone(),
            constants,
            surfaces: Surfaces {
                walls: *walls,
                obstacles: Obstacles::with_bodies(
                    settings.obstacles.clone(),
                    &Bodies::placed(&settings.rigid),
                    walls,
                    &layout,
                ),
                layout,
                frictions: settings.materials.iter().map(|m| m.wall_friction).collect(),
            },
            field: Field::new(coarse_layout),
            drift: DriftCorrection::new(coarse_layout, team.size()),
            relaxation: Relaxation::new(layout, constants.relaxation, walls, &resting, team.size()),
            team,
            state: UpsamplerState {
                blocks: blocks(&all),
                population: Population::new(all.len(), settings.openings.emitters.len()),
                previous: Previous::of(coarse),
                frame: 0,
                materials: settings.materials.len(),
            },
            cache: None,
            before: Vec::new(),
        })
    }

    /// Settings of the scene, with its own emitters.
    pub fn settings(&self) -> &SolverSettings<D> {
        &self.settings
    }

    pub fn constants(&self) -> UpsamplingConstants {
        self.constants
    }

    /// Frames from one update to the next: 1 in a scene with emitters or sinks, which act in each frame.
    pub fn every(&self) -> u64 {
        if self.settings.openings.any() {
            1
        } else {
            UPDATE_EVERY
        }
    }

    /// Frame of the latest update.
    pub fn frame(&self) -> u64 {
        self.state.frame
    }

    /// Number of particles.
    pub fn count(&self) -> usize {
        self.state.population.ids.len()
    }

    /// Permanent ids of the N particles, ascending.
    pub fn ids(&self) -> &[u64] {
        &self.state.population.ids
    }

    /// Status of each emitter in the latest frame.
    pub fn emitters(&self) -> impl Iterator<Item = EmitterStatus> + '_ {
        let flows = self.state.population.flows.iter();
        flows.map(|flow| flow.status)
    }

    /// Moves all particles to the end of a frame with the coarse particles, given at the same time.
    ///
    /// On an error, which an update that is `interrupted` ends with, the state is the one before.
    pub fn update(&mut self, coarse: &CoarseParticles<'_>, frame: u64) -> Result<(), MpmError> {
        coarse.check::<D>()?;
        let mut moved = std::mem::take(&mut self.before);
        let done = self.advect_to(&mut moved, coarse, frame);
        self.before = moved;
        done?;
        std::mem::swap(&mut self.state.blocks, &mut self.before);
        self.cache = None;
        if frame.is_multiple_of(UPDATE_EVERY) {
            if frame.is_multiple_of(CORRECT_EVERY) {
                self.correct_drift(coarse);
            }
            self.relax();
        } else {
            let mut blocks = std::mem::take(&mut self.state.blocks);
            self.keep_outside_obstacles(&mut blocks);
            self.state.blocks = blocks;
        }
        if interrupted() {
            std::mem::swap(&mut self.state.blocks, &mut self.before);
            return Err(MpmError::Cancelled { frame });
        }
        let (state, surfaces) = (&mut self.state, &self.surfaces);
        state.frame = frame;
        state.previous = Previous::of(coarse);
        if self.settings.openings.any() {
            let mut end = ShownEnd {
                blocks: &mut state.blocks,
                population: &mut state.population,
                surfaces,
                frame,
                frame_dt: self.settings.frame_dt,
            };
            end.exchange(&self.settings.openings);
        }
        Ok(())
    }

    /// Writes N x D positions [m] at the end of a frame since the latest update; `coarse` is given at the same time.
    pub fn write_positions(
        &mut self,
        coarse: &CoarseParticles<'_>,
        frame: u64,
        out: &mut [f32],
    ) -> Result<(), MpmError> {
        let blocks = self.at_frame(coarse, frame)?;
        write(blocks, out, |block| &block.x);
        Ok(())
    }

    /// Writes N x D velocities [m/s] at such a frame; `v` are those of the n coarse particles, n x D.
    pub fn write_velocities(
        &mut self,
        coarse: &CoarseParticles<'_>,
        v: &[f32],
        frame: u64,
        out: &mut [f32],
    ) -> Result<(), MpmError> {
        if v.len() != coarse.x.len() {
            return Err(MpmError::Length {
                name: "v",
                expected: coarse.x.len(),
                got: v.len(),
            });
        }
        let mut blocks = self.at_frame(coarse, frame)?.to_vec();
        self.field.scatter(&Previous::velocities(
            coarse,
            v,
            self.constants.affine_share,
        ));
        interpolate_velocities(&mut blocks, &self.field, &self.team);
        write(&blocks, out, |block| &block.v);
        Ok(())
    }

    /// Writes N masses [kg].
    pub fn write_masses(&self, out: &mut [f32]) {
        for (index, mass) in out.iter_mut().enumerate() {
            *mass = self.state.blocks[index / LANES].mass[index % LANES];
        }
    }

    /// Writes N indices into the materials.
    pub fn write_materials(&self, out: &mut [u8]) {
        for (index, material) in out.iter_mut().enumerate() {
            *material = self.state.blocks[index / LANES].material[index % LANES];
        }
    }

    /// Converts accelerations of shown particles, N x D [m/s^2], to those of the coarse particles at the latest update.
    pub fn gather_force(&mut self, force: &[f32]) -> Result<Vec<f32>, MpmError> {
        if force.len() != self.count() * D {
            return Err(MpmError::Length {
                name: "force",
                expected: self.count() * D,
                got: force.len(),
            });
        }
        let state = &self.state;
        Ok(gather_force(
            &state.blocks,
            force,
            &state.previous,
            &mut self.field,
            &self.team,
        ))
    }

    /// The complete state.
    pub fn snapshot(&self) -> Vec<u8> {
        snapshot::encode(self.surfaces.layout.resolution, &self.state)
    }

    /// Restores the state of a snapshot of the same scene; on an error the present state is kept.
    pub fn restore(&mut self, data: &[u8]) -> Result<(), MpmError> {
        let resolution = self.surfaces.layout.resolution;
        self.state = snapshot::decode(resolution, &self.state, self.settings.openings.any(), data)?;
        self.cache = None;
        Ok(())
    }

    /// Moves shown particles towards the mass of the coarse particles.
    fn correct_drift(&mut self, coarse: &CoarseParticles<'_>) {
        let blocks = &mut self.state.blocks;
        let (mut mass, mut cells) = (0.0, 0.0);
        for block in &*blocks {
            mass += block.mass.iter().sum::<f32>();
            cells += block.volume.iter().sum::<f32>();
        }
        if mass > 0.0 {
            let cell = self.surfaces.layout.dx().powi(D as i32);
            let density = mass / (cells * cell);
            self.drift.correct(blocks, coarse, density, &self.team);
            confine(&self.surfaces, blocks, &self.team);
        }
    }

    /// Moves shown particles apart where they are denser than at rest.
    fn relax(&mut self) {
        let blocks = &mut self.state.blocks;
        for _ in 0..MAX_PASSES {
            let is_dense = self.relaxation.relax(blocks, &self.team);
            confine(&self.surfaces, blocks, &self.team);
            if !is_dense || interrupted() {
                break;
            }
        }
    }

    /// Particles at the end of a frame since the latest update.
    fn at_frame(
        &mut self,
        coarse: &CoarseParticles<'_>,
        frame: u64,
    ) -> Result<&[Block<D>], MpmError> {
        if frame == self.state.frame {
            return Ok(&self.state.blocks);
        }
        let cached = self.cache.as_ref().is_some_and(|(of, _)| *of == frame);
        if !cached {
            coarse.check::<D>()?;
            let mut blocks = self
                .cache
                .take()
                .map_or_else(Vec::new, |(_, blocks)| blocks);
            self.advect_to(&mut blocks, coarse, frame)?;
            self.keep_outside_obstacles(&mut blocks);
            self.cache = Some((frame, blocks));
        }
        Ok(&self.cache.as_ref().expect("just computed").1)
    }

    /// Writes particles at the end of a frame after the latest update, between the walls.
    fn advect_to(
        &mut self,
        blocks: &mut Vec<Block<D>>,
        coarse: &CoarseParticles<'_>,
        frame: u64,
    ) -> Result<(), MpmError> {
        if frame <= self.state.frame {
            let allowed = "after the frame of the latest update";
            return Err(MpmError::parameter("frame", allowed, frame));
        }
        let (expected, got) = (self.settings.rigid.len(), coarse.rigid.len());
        if got != expected {
            return Err(MpmError::Length {
                name: "rigid",
                expected,
                got,
            });
        }
        let dt = (frame - self.state.frame) as f32 * self.settings.frame_dt;
        self.field.scatter(
            &self
                .state
                .previous
                .samples(coarse, dt, self.constants.affine_share),
        );
        // Obstacles are placed by the number of the frame, and rigid bodies as they are then.
        let poses = coarse.rigid.iter().map(pose_of_numbers);
        self.surfaces.obstacles.place_bodies(poses);
        let time = frame as f64 * f64::from(self.settings.frame_dt);
        self.surfaces.obstacles.move_to(time, dt);
        let gravity = &self.settings.gravity;
        let (from, field) = (&self.state.blocks, &self.field);
        advect(from, blocks, field, gravity, dt, &self.team);
        let surfaces = &self.surfaces;
        for_blocks(blocks, &self.team, |block| {
            surfaces.keep_between_walls(block);
        });
        Ok(())
    }

    /// Moves particles out of obstacles, if there are any.
    fn keep_outside_obstacles(&self, blocks: &mut [Block<D>]) {
        if self.surfaces.obstacles.any() {
            confine(&self.surfaces, blocks, &self.team);
        }
    }
}

/// Moves all particles between the walls and out of obstacles.
fn confine<const D: usize>(surfaces: &Surfaces<D>, blocks: &mut [Block<D>], team: &Team) {
    for_blocks(blocks, team, |block| surfaces.confine(block));
}

fn for_blocks<const D: usize>(
    blocks: &mut [Block<D>],
    team: &Team,
    work: impl Fn(&mut Block<D>) + Sync,
) {
    let share = blocks.len().div_ceil(4 * team.size()).max(1);
    let mut parts: Vec<_> = blocks.chunks_mut(share).collect();
    team.for_each(&mut parts, |blocks| blocks.iter_mut().for_each(&work));
}

/// Writes a vector of each particle.
fn write<const D: usize>(
    blocks: &[Block<D>],
    out: &mut [f32],
    vectors: impl Fn(&Block<D>) -> &[Lanes; D],
) {
    for (block, out) in blocks.iter().zip(out.chunks_mut(LANES * D)) {
        let vectors = vectors(block);
        for (lane, out) in out.chunks_exact_mut(D).enumerate() {
            for axis in 0..D {
                out[axis] = vectors[axis][lane];
            }
        }
    }
}
