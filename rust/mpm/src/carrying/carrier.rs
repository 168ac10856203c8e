//! `Carrier`: all particles of a scene, moved along by few.

use std::sync::Arc;

use super::block::{Block, Carried, blocks};
use super::density::{Crowding, Straying};
use super::exchange::CarriedEnd;
use super::few::{Few, Past};
use super::field::Field;
use super::force::gather_force;
use super::gather::{move_along, take_velocities};
use super::snapshot::{self, CarrierState};
use super::surfaces::Surfaces;
use crate::boundary::Obstacles;
use crate::error::MpmError;
use crate::grid::Layout;
use crate::initial::{Particles, check_particles};
use crate::linalg::{LANES, Vector};
use crate::openings::{EmitterStatus, Openings, Population};
use crate::settings::SolverSettings;
use threads::Team;

/// Frames from one carry to the next, where no particles come and go.
pub const CARRY_EVERY: u64 = 4;

/// Frames from one time to the next that the many are led back to where the few are; a multiple of `CARRY_EVERY`.
const LEAD_EVERY: u64 = 16;

/// Passes in which the many slide apart at a carry, at most. Few carries need more than two; in a splash at a wall eight
/// were too few.
const MOST_PASSES: usize = 24;

/// How particles are carried, apart from the few and the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarryConstants {
    /// The part of the affine motion of the few that the many take over [-]. All of it moves the centre of mass best,
    /// but lets particles clump; none leaves bodies that turn behind.
    pub affine_share: f32,
    /// How far the many slide apart in each pass of a carry [cells] per density in excess and cell.
    pub relaxation: f32,
}

impl CarryConstants {
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

impl Default for CarryConstants {
    fn default() -> Self {
        Self {
            affine_share: 0.5,
            relaxation: 2.0,
        }
    }
}

/// All particles of a scene, carried along by the motion of few.
#[derive(Debug, Clone)]
pub struct Carrier<const D: usize> {
    frame_dt: f32,
    gravity: Vector<D>,
    affine_share: f32,
    openings: Openings<D>,
    surfaces: Surfaces<D>,
    /// On the grid of the few.
    field: Field<D>,
    crowding: Crowding<D>,
    straying: Straying<D>,
    team: Arc<Team>,
    state: CarrierState<D>,
    /// The particles at a frame after the latest carry, as they were last shown.
    shown: Option<(u64, Vec<Block<D>>)>,
}

impl<const D: usize> Carrier<D> {
    /// All particles of a scene at frame 0.
    ///
    /// `settings` are those of the scene, with its own emitters; `coarse_resolution` is that of the grid of the few [cells/m].
    pub fn new(
        settings: &SolverSettings<D>,
        coarse_resolution: usize,
        constants: CarryConstants,
        particles: Particles<'_>,
        few: &Few<'_>,
    ) -> Result<Self, MpmError> {
        settings.check()?;
        constants.check()?;
        if !(8..=1024).contains(&coarse_resolution) {
            let allowed = "in [8, 1024]";
            return Err(MpmError::parameter(
                "coarse_resolution",
                allowed,
                coarse_resolution,
            ));
        }
        check_particles(settings, particles)?;
        few.check::<D>()?;
        let layout = Layout::new(settings.resolution);
        let cell = layout.dx().powi(D as i32);
        let all: Vec<_> = (0..particles.mass.len())
            .map(|i| Carried {
                x: Vector::from_column_slice(&particles.x[i * D..][..D]),
                v: Vector::from_column_slice(&particles.v[i * D..][..D]),
                mass: particles.mass[i],
                volume: particles.volume[i] / cell,
                material: particles.material[i],
            })
            .collect();
        let walls = &settings.walls;
        let resting = settings.obstacles.iter().filter(|o| o.motion.is_none());
        let resting = Obstacles::new(resting.copied().collect(), walls, &layout);
        let team = Arc::new(Team::new(settings.threads)?);
        Ok(Self {
            frame_dt: settings.frame_dt,
            gravity: settings.gravity,
            affine_share: constants.affine_share,
            surfaces: Surfaces {
                walls: *walls,
                obstacles: Obstacles::new(settings.obstacles.clone(), walls, &layout),
                layout,
                frictions: settings.materials.iter().map(|m| m.wall_friction).collect(),
            },
            field: Field::new(coarse_resolution),
            straying: Straying::new(Layout::new(coarse_resolution), team.size()),
            crowding: Crowding::new(layout, constants.relaxation, walls, &resting, team.size()),
            team,
            state: CarrierState {
                blocks: blocks(&all),
                population: Population::new(all.len(), settings.openings.emitters.len()),
                past: Past::of(few),
                frame: 0,
                materials: settings.materials.len(),
            },
            openings: settings.openings.clone(),
            shown: None,
        })
    }

    /// Frames from one carry to the next. Where particles come and go it is 1: they may in each frame.
    pub fn every(&self) -> u64 {
        if self.openings.any() { 1 } else { CARRY_EVERY }
    }

    /// Frame of the latest carry.
    pub fn frame(&self) -> u64 {
        self.state.frame
    }

    /// Number of particles.
    pub fn count(&self) -> usize {
        self.state.population.ids.len()
    }

    /// N numbers, ascending, that particles keep for good.
    pub fn ids(&self) -> &[u64] {
        &self.state.population.ids
    }

    /// What each emitter did in the latest frame.
    pub fn emitters(&self) -> impl Iterator<Item = EmitterStatus> + '_ {
        let flows = self.state.population.flows.iter();
        flows.map(|flow| flow.status)
    }

    /// Carries all particles to a frame, at whose end the few are as `few` says.
    pub fn carry(&mut self, few: &Few<'_>, frame: u64) -> Result<(), MpmError> {
        few.check::<D>()?;
        let mut blocks = std::mem::take(&mut self.state.blocks);
        let moved = self.move_to(&mut blocks, few, frame);
        self.state.blocks = blocks;
        moved?;
        self.shown = None;
        if frame.is_multiple_of(CARRY_EVERY) {
            if frame.is_multiple_of(LEAD_EVERY) {
                self.lead_back(few);
            }
            self.part();
        } else {
            hold(&self.surfaces, &mut self.state.blocks, &self.team);
        }
        let (state, surfaces) = (&mut self.state, &self.surfaces);
        state.frame = frame;
        state.past = Past::of(few);
        if self.openings.any() {
            let mut end = CarriedEnd {
                blocks: &mut state.blocks,
                population: &mut state.population,
                surfaces,
                frame,
                frame_dt: self.frame_dt,
            };
            end.exchange(&self.openings);
        }
        Ok(())
    }

    /// Writes N x D positions [m] at a frame since the latest carry, at whose end the few are as `few` says.
    pub fn write_positions(
        &mut self,
        few: &Few<'_>,
        frame: u64,
        out: &mut [f32],
    ) -> Result<(), MpmError> {
        let blocks = self.at_frame(few, frame)?;
        write(blocks, out, Block::position);
        Ok(())
    }

    /// Writes N x D velocities [m/s] at such a frame; `v` are those of the few, N x D.
    pub fn write_velocities(
        &mut self,
        few: &Few<'_>,
        v: &[f32],
        frame: u64,
        out: &mut [f32],
    ) -> Result<(), MpmError> {
        if v.len() != few.x.len() {
            return Err(MpmError::Length {
                name: "v",
                expected: few.x.len(),
                got: v.len(),
            });
        }
        let mut blocks = self.at_frame(few, frame)?.to_vec();
        self.field
            .spread(&Past::velocities(few, v, self.affine_share));
        take_velocities(&mut blocks, &self.field, &self.team);
        write(&blocks, out, Block::velocity);
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

    /// Accelerations of the many, N x D [m/s^2], as accelerations of the few that there were at the latest carry.
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
            &state.past,
            &mut self.field,
            &self.team,
        ))
    }

    /// The complete state.
    pub fn snapshot(&self) -> Vec<u8> {
        snapshot::encode(self.surfaces.layout.resolution, &self.state)
    }

    /// Takes the state of a snapshot of the same scene; on an error the present one stays.
    pub fn restore(&mut self, data: &[u8]) -> Result<(), MpmError> {
        let resolution = self.surfaces.layout.resolution;
        self.state = snapshot::decode(resolution, &self.state, self.openings.any(), data)?;
        self.shown = None;
        Ok(())
    }

    /// Leads all particles back to where the few are.
    fn lead_back(&mut self, few: &Few<'_>) {
        let blocks = &mut self.state.blocks;
        let (mut mass, mut cells) = (0.0, 0.0);
        for block in &*blocks {
            mass += block.mass.iter().sum::<f32>();
            cells += block.volume.iter().sum::<f32>();
        }
        if mass > 0.0 {
            let cell = self.surfaces.layout.dx().powi(D as i32);
            let density = mass / (cells * cell);
            self.straying.lead_back(blocks, few, density, &self.team);
            hold(&self.surfaces, blocks, &self.team);
        }
    }

    /// Lets all particles slide apart where they are too dense.
    fn part(&mut self) {
        let blocks = &mut self.state.blocks;
        for _ in 0..MOST_PASSES {
            let is_crowded = self.crowding.relax(blocks, &self.team);
            hold(&self.surfaces, blocks, &self.team);
            if !is_crowded {
                break;
            }
        }
    }

    /// The particles at a frame since the latest carry.
    fn at_frame(&mut self, few: &Few<'_>, frame: u64) -> Result<&[Block<D>], MpmError> {
        if frame == self.state.frame {
            return Ok(&self.state.blocks);
        }
        let cached = self.shown.as_ref().is_some_and(|(of, _)| *of == frame);
        if !cached {
            few.check::<D>()?;
            let mut blocks = self
                .shown
                .take()
                .map_or_else(Vec::new, |(_, blocks)| blocks);
            blocks.clone_from(&self.state.blocks);
            self.move_to(&mut blocks, few, frame)?;
            hold(&self.surfaces, &mut blocks, &self.team);
            self.shown = Some((frame, blocks));
        }
        Ok(&self.shown.as_ref().expect("just shown").1)
    }

    /// Moves particles from the latest carry to a later frame.
    fn move_to(
        &mut self,
        blocks: &mut [Block<D>],
        few: &Few<'_>,
        frame: u64,
    ) -> Result<(), MpmError> {
        if frame <= self.state.frame {
            let allowed = "after the frame of the latest carry";
            return Err(MpmError::parameter("frame", allowed, frame));
        }
        let dt = (frame - self.state.frame) as f32 * self.frame_dt;
        self.field
            .spread(&self.state.past.movers(few, dt, self.affine_share));
        move_along(blocks, &self.field, &self.gravity, dt, &self.team);
        // The clock of moving obstacles is a function of the frame's number.
        let time = frame as f64 * f64::from(self.frame_dt);
        self.surfaces.obstacles.move_to(time, dt);
        let surfaces = &self.surfaces;
        for_blocks(blocks, &self.team, |block| {
            surfaces.keep_between_walls(block);
        });
        Ok(())
    }
}

/// Puts all particles between the walls and outside of obstacles.
fn hold<const D: usize>(surfaces: &Surfaces<D>, blocks: &mut [Block<D>], team: &Team) {
    for_blocks(blocks, team, |block| surfaces.hold(block));
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
    vector: impl Fn(&Block<D>, usize) -> Vector<D>,
) {
    for (index, out) in out.chunks_exact_mut(D).enumerate() {
        let value = vector(&blocks[index / LANES], index % LANES);
        out.copy_from_slice(value.as_slice());
    }
}
