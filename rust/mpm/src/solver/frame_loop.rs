//! The frame loop.

use std::sync::Arc;

use crate::boundary::{Bounds, MaterialFriction, Obstacles, Pose, Reactions, WallContact};
use crate::error::MpmError;
use crate::force::{Force, FrameForce};
use crate::grid::{FieldSums, Fields, Grid, Layout};
use crate::initial::{Particles, group};
use crate::linalg::norm;
use crate::openings::{FrameEnd, Population};
use crate::particles::{
    MAX_SLABS, MaterialGroup, PERIOD, Slab, Sleep, Sorter, WakeCauses, bands, count_calm, decide,
    near_ones, with_group,
};
use crate::rigid::{Bodies, Pull, start as start_bodies};
use crate::settings::SolverSettings;
use crate::snapshot;
use crate::state::SolverState;
use crate::substep::{
    Bound, FrameReport, GridForces, Meeting, Outcome, P2gStep, Stage, StepChooser, Substep,
};
use crate::volume::VolumeCorrection;
use threads::{Team, interrupted};

/// Active nodes that cost what a particle does, by and large: a third to a tenth of them hold mass.
const NODES_OF_A_PARTICLE: usize = 8;

/// MLS-MPM on one scene.
#[derive(Clone)]
pub struct Solver<const D: usize> {
    pub(super) settings: SolverSettings<D>,
    pub(super) chooser: StepChooser,
    pub(super) bounds: Bounds<D>,
    pub(super) walls: WallContact,
    pub(super) obstacles: Obstacles<D>,
    /// None in a scene without rigid bodies.
    pub(super) bodies: Option<Bodies<D>>,
    pub(super) material_friction: MaterialFriction,
    pub(super) meeting: Meeting,
    /// None if no material is corrected.
    pub(super) volume: Option<VolumeCorrection<D>>,
    pub(super) team: Arc<Team>,
    pub(super) grid: Grid<D>,
    pub(super) slabs: Vec<Slab>,
    /// Impulses of walls and obstacles in the frame in progress, by slab.
    pub(super) reactions: Vec<Reactions<D>>,
    pub(super) sorter: Sorter,
    pub(super) state: SolverState<D>,
    /// State before the frame in progress; kept to reuse its memory.
    pub(super) before: Vec<MaterialGroup<D>>,
    bodies_before: rigid::State,
    /// Hands that pull in the next frame.
    pulls: Vec<Pull<D>>,
    pub(super) last_frame: Option<FrameReport>,
}

impl<const D: usize> Solver<D> {
    /// Checks everything; afterwards only the motion itself can fail. Fails as well where the work is `interrupted`.
    pub fn new(settings: SolverSettings<D>, particles: Particles<'_>) -> Result<Self, MpmError> {
        settings.check()?;
        let dx = 1.0 / settings.resolution as f32;
        let chooser = StepChooser::new(
            settings.substeps,
            settings.frame_dt,
            dx,
            D,
            &settings.materials,
        )?;
        let groups = group(&settings, particles)?;
        let frictions = || settings.materials.iter().map(|m| m.wall_friction);
        let uniform =
            frictions().all(|mu| mu.to_bits() == settings.materials[0].wall_friction.to_bits());
        let mut grid = Grid::new(Layout::new(settings.resolution, settings.cells), !uniform);
        let densities: Vec<_> = settings.materials.iter().map(|m| m.density).collect();
        let cell = dx.powi(D as i32);
        let meeting = Meeting::new(&groups, &densities, cell, settings.contact_friction);
        let sums = FieldSums {
            friction: !uniform,
            volume: meeting.mixes_densities(),
        };
        let flows = groups.iter().any(|group| !group.is_elastic());
        grid.fields = Fields::new(grid.layout, meeting.fields(), flows, sums);
        if settings.transfer_loss.is_some() {
            grid.keep_old();
        }
        let volume = groups
            .iter()
            .any(|group| with_group!(group, group => group.corrects_volume()))
            .then(|| VolumeCorrection::new(&settings.walls, &grid.layout, settings.frame_dt));
        let max_speed = particles.v.chunks_exact(D).map(norm).fold(0.0, f32::max);
        let obstacles = Obstacles::with_bodies(
            settings.obstacles.clone(),
            &Bodies::placed(&settings.rigid),
            &settings.walls,
            &grid.layout,
        );
        let mut no_reactions = Reactions::none(settings.obstacles.len(), settings.rigid.len());
        no_reactions.kept = false;
        let bodies = Bodies::new(
            &settings.rigid,
            &settings.walls,
            &settings.obstacles,
            &settings.gravity,
        );
        let rigid = start_bodies(&settings.rigid);
        if let Some(bodies) = &bodies {
            bodies.check(&rigid)?;
        }
        if interrupted() {
            return Err(MpmError::BuildCancelled);
        }
        Ok(Self {
            chooser,
            bounds: Bounds::new(settings.walls, &settings.gravity, &grid.layout),
            walls: WallContact::new(&settings.walls, &grid.layout),
            obstacles,
            bodies,
            material_friction: if uniform {
                MaterialFriction::Uniform(settings.materials[0].wall_friction)
            } else {
                MaterialFriction::Mixed
            },
            meeting,
            volume,
            team: Arc::new(Team::new(settings.threads)?),
            grid,
            slabs: Vec::new(),
            reactions: vec![no_reactions; MAX_SLABS],
            sorter: Sorter::default(),
            before: Vec::new(),
            bodies_before: rigid::State::default(),
            pulls: Vec::new(),
            state: SolverState {
                groups,
                frame: 0,
                max_speed,
                population: Population::new(particles.mass.len(), settings.openings.emitters.len()),
                rigid,
            },
            last_frame: None,
            settings,
        })
    }

    /// Advances by whole frames and calls back after each with the solver.
    ///
    /// On an error the state is the one before the frame that failed; earlier frames stand. A frame whose work is
    /// `interrupted` fails as cancelled.
    pub fn advance(
        &mut self,
        frames: usize,
        force: Force<'_>,
        mut after: impl FnMut(usize, &Self),
    ) -> Result<(), MpmError> {
        force.check::<D>(frames, self.count(), self.settings.openings.any())?;
        for index in 0..frames {
            let force = force.in_frame(index, self.count());
            self.advance_frame(force)?;
            after(index, self);
        }
        Ok(())
    }

    /// Pulls at a rigid body in the next frame, beside what else does.
    pub fn pull(&mut self, pull: Pull<D>) -> Result<(), MpmError> {
        pull.check(self.settings.rigid.len())?;
        self.pulls.push(pull);
        Ok(())
    }

    fn advance_frame(&mut self, force: FrameForce<'_, D>) -> Result<(), MpmError> {
        let max_speed = self.state.max_speed;
        // The clock of moving obstacles is a function of the frame's number.
        let start = self.state.frame as f64 * f64::from(self.settings.frame_dt);
        self.obstacles
            .place_bodies(Bodies::poses(&self.state.rigid, 0.0));
        self.obstacles.move_to(start, 0.0);
        self.bodies_before.clone_from(&self.state.rigid);
        // Sorting at the start of a frame makes a frame a function of the state alone.
        if let Some(sleep) = self.settings.sleep {
            self.remember();
            self.let_sleep(sleep, force);
            self.sort();
        } else {
            self.sort_and_remember();
        }
        let done = self.substeps(start, force);
        self.pulls.clear();
        match done {
            Ok(report) => {
                if let Some(sleep) = &self.settings.sleep {
                    count_calm(&mut self.state.groups, sleep);
                }
                self.last_frame = Some(report);
                self.state.frame += 1;
                self.exchange();
                Ok(())
            }
            Err(error) => {
                std::mem::swap(&mut self.state.groups, &mut self.before);
                std::mem::swap(&mut self.state.rigid, &mut self.bodies_before);
                self.state.max_speed = max_speed;
                Err(error)
            }
        }
    }

    fn exchange(&mut self) {
        let SolverState {
            groups,
            frame,
            max_speed,
            population,
            ..
        } = &mut self.state;
        let mut end = FrameEnd {
            groups,
            population,
            max_speed,
            frame: *frame,
            frame_dt: self.settings.frame_dt,
            resolution: self.settings.resolution,
            obstacles: &self.obstacles,
        };
        end.exchange(&self.settings.openings);
    }

    /// Copies the particles, to restore them if the frame fails.
    pub(super) fn remember(&mut self) {
        if self.before.is_empty() {
            self.before.clone_from(&self.state.groups);
        } else {
            let pairs = self.before.iter_mut().zip(&self.state.groups);
            pairs.for_each(|(before, now)| before.copy_particles(now));
        }
    }

    /// Sorts the particles and copies those before the sort, as `remember` does.
    fn sort_and_remember(&mut self) {
        if self.before.is_empty() {
            self.remember();
        }
        let pairs = self.before.iter_mut().zip(&mut self.state.groups);
        pairs.for_each(|(before, now)| before.lend(now));
        self.sort();
        let pairs = self.before.iter_mut().zip(&mut self.state.groups);
        pairs.for_each(|(before, now)| before.take_unsorted(now));
    }

    /// Decides which particles sleep, at times that depend on the state alone, and whenever a force acts or an emitter may
    /// have added particles.
    fn let_sleep(&mut self, sleep: Sleep, force: FrameForce<'_, D>) {
        let stirred = force.is_some() || !self.settings.openings.emitters.is_empty();
        if self.state.frame.is_multiple_of(PERIOD) || stirred {
            let causes = WakeCauses {
                force,
                obstacles: &self.obstacles,
                horizon: PERIOD as f32 * self.settings.frame_dt,
            };
            decide(&mut self.state.groups, &self.grid.layout, &sleep, &causes);
        }
    }

    fn substeps(&mut self, start: f64, force: FrameForce<'_, D>) -> Result<FrameReport, MpmError> {
        let dx = self.grid.layout.dx();
        let mut report = FrameReport {
            substeps: 0,
            smallest_dt: f32::INFINITY,
            bound: Bound::Frame,
            obstacle_work: 0.0,
            max_speed: 0.0,
            forces: Vec::new(),
        };
        self.reactions.iter_mut().for_each(Reactions::clear);
        let pull = self.settings.gravity.norm() + force.largest();
        let frame_dt = self.settings.frame_dt;
        let mut remaining = frame_dt;
        let (mut travelled, mut is_new) = (0.0, true);
        if let Some(elapsed) = self.volume.as_ref().and_then(|v| v.due(self.state.frame)) {
            self.correct_volumes(elapsed);
        }
        while remaining > 0.0 {
            self.check_cancelled()?;
            // A substep is at most dx / signal speed long, so speeds gain at most this.
            let speed = self.state.max_speed + pull * dx / self.chooser.signal_speed;
            let (dt, bound) = self
                .chooser
                .next(remaining, speed, self.obstacles.speed())?;
            if travelled >= dx {
                self.sort();
                (travelled, is_new) = (0.0, true);
            }
            let end = start + f64::from(frame_dt - remaining + dt);
            self.obstacles
                .place_bodies(Bodies::poses(&self.state.rigid, dt));
            is_new |= self.obstacles.move_to(end, dt);
            let step = P2gStep { dt, force };
            let outcome = match self.bodies.clone() {
                Some(bodies) => self.run_with_bodies(&bodies, end, step, is_new),
                None => self.run(&Stage::ALL, step, is_new),
            };
            is_new = false;
            // Stages that are interrupted leave slabs out.
            self.check_cancelled()?;
            self.state.max_speed = outcome.max_speed_squared.sqrt();
            if !outcome.sound {
                return Err(self.diagnose());
            }
            travelled += self.state.max_speed * dt + outcome.longest_push;
            remaining -= dt;
            // The remainder after the last substep is rounding.
            if remaining < 1.0e-3 * dt {
                remaining = 0.0;
            }
            report.substeps += 1;
            report.obstacle_work += outcome.obstacle_work;
            report.max_speed = self.state.max_speed;
            if dt < report.smallest_dt {
                (report.smallest_dt, report.bound) = (dt, bound);
            }
        }
        report.forces = self.forces();
        Ok(report)
    }

    /// Sums the forces on walls and obstacles in all later frames.
    pub fn keep_forces(&mut self) {
        self.reactions.iter_mut().for_each(|part| part.kept = true);
    }

    /// Mean forces on walls and obstacles over the frame; empty where they are not kept. In the order of the slabs, on which the
    /// sums depend.
    fn forces(&self) -> Vec<f64> {
        if !self.reactions[0].kept {
            return Vec::new();
        }
        let mut sum = Reactions::none(self.settings.obstacles.len(), 0);
        self.reactions.iter().for_each(|part| sum.join(part));
        sum.forces(f64::from(self.settings.frame_dt))
    }

    fn check_cancelled(&self) -> Result<(), MpmError> {
        if interrupted() {
            let frame = self.state.frame;
            return Err(MpmError::Cancelled { frame });
        }
        Ok(())
    }

    pub(super) fn sort(&mut self) {
        self.slabs = self.sorter.sort(
            &mut self.state.groups,
            &self.grid.layout,
            &self.walls.planes(),
            &self.team,
        );
        let bands = bands(&self.slabs, self.grid.layout.planes());
        let places = |planes| self.sorter.places(planes);
        self.grid.activate(&bands, places, &self.team);
        for (slab, band) in self.slabs.iter_mut().zip(bands) {
            slab.cost += self.grid.active.nodes(band) / NODES_OF_A_PARTICLE;
        }
        self.find_meetings();
        let Grid {
            active,
            fields,
            layout,
            ..
        } = &self.grid;
        self.walls.activate(active, fields, layout);
    }

    /// Finds the nodes that several bodies may reach before the next sort, one of them elastic.
    fn find_meetings(&mut self) {
        let (fields, layout) = (&mut self.grid.fields, &self.grid.layout);
        if !fields.any() {
            return;
        }
        fields.clear();
        let bounds = |group: usize| self.sorter.bounds_of(group);
        let near = near_ones(&self.state.groups, bounds);
        for (index, zone) in near {
            let of_group = self.sorter.places_of(index);
            let field = with_group!(&self.state.groups[index], group => group.field);
            fields.add(field, of_group.filter(|place| zone.contains(*place)));
        }
        let walls = &self.walls;
        fields.finish(|chunk, others| walls.chunks_of_lines(layout, chunk, others));
    }

    /// Leads the volumes of all particles back to the room that they take, after a sort; `dt` is the time since the
    /// last correction [s].
    pub(super) fn correct_volumes(&mut self, dt: f32) {
        if let Some(volume) = &mut self.volume {
            let groups = &mut self.state.groups;
            volume.apply(
                groups,
                &self.slabs,
                &mut self.grid,
                &self.obstacles,
                dt,
                &self.team,
            );
        }
    }

    /// Takes the sorted particles and the grid through some stages of a substep. `is_new` where it is the first one after a
    /// sort, or after `Obstacles::move_to` asked for it.
    pub(super) fn run(&mut self, stages: &[Stage], step: P2gStep<'_, D>, is_new: bool) -> Outcome {
        let substep = Substep {
            step,
            forces: GridForces {
                gravity: self.settings.gravity,
                walls: &self.walls,
                obstacles: &self.obstacles,
                material_friction: self.material_friction,
                meeting: &self.meeting,
                dt: step.dt,
                bodies: self.bodies.is_some() && !stages.contains(&Stage::P2g)
                    || stages.contains(&Stage::Probe),
            },
            bounds: &self.bounds,
            transfer_loss: self.settings.transfer_loss.unwrap_or(0.0),
            is_new,
        };
        let groups = &mut self.state.groups;
        let (grid, reactions) = (&mut self.grid, &mut self.reactions);
        substep.run(stages, groups, &self.slabs, grid, reactions, &self.team)
    }

    /// All stages of a substep that ends at a time [s], with rigid bodies.
    fn run_with_bodies(
        &mut self,
        bodies: &Bodies<D>,
        end: f64,
        step: P2gStep<'_, D>,
        is_new: bool,
    ) -> Outcome {
        self.reactions.iter_mut().for_each(Reactions::clear_bodies);
        self.run(&Stage::TO_BODIES, step, is_new);
        let poses: Vec<Pose<D>> = self.obstacles.body_poses().copied().collect();
        let first = self.settings.obstacles.len();
        let (state, reactions) = (&mut self.state.rigid, &self.reactions);
        let pulled = bodies.pulled(state, &self.pulls, step.dt);
        let meeting = bodies.meet(state, &poses, first, reactions, &pulled, step.dt);
        self.obstacles.place_bodies(meeting.into_iter());
        let outcome = self.run(&Stage::FROM_BODIES, step, is_new);
        let (state, reactions) = (&mut self.state.rigid, &self.reactions);
        bodies.step(state, &poses, reactions, &pulled, end, step.dt);
        outcome
    }

    /// Names the particle that is no longer sound, the lowest index if there are several.
    pub(super) fn diagnose(&self) -> MpmError {
        let frame = self.state.frame;
        let mut found: Option<(u32, MpmError)> = None;
        for group in &self.state.groups {
            with_group!(group, group => {
                for p in group.particles() {
                    let j = group.volume_ratio(&p);
                    let finite = p.x.iter().chain(&p.v).all(|s| s.is_finite()) && j.is_finite();
                    let error = if !finite {
                        MpmError::NonFinite { particle: p.id, frame }
                    } else if !self.bounds.allows(&p.x) {
                        let position = p.x.as_slice().to_vec();
                        let margin = self.grid.layout.dx();
                        MpmError::LeftDomain { particle: p.id, frame, position, margin }
                    } else if j <= 0.0 {
                        MpmError::Inverted { particle: p.id, frame, volume_ratio: j }
                    } else {
                        continue;
                    };
                    if found.as_ref().is_none_or(|(id, _)| p.id < *id) {
                        found = Some((p.id, error));
                    }
                }
            });
        }
        found
            .expect("diagnose is called only when a particle is unsound")
            .1
    }

    /// The complete state. Going on from it gives the same bits.
    pub fn snapshot(&self) -> Vec<u8> {
        snapshot::encode(&self.settings, &self.state)
    }

    /// Takes the state of a snapshot of the same scene; on an error the present one stays.
    pub fn restore(&mut self, data: &[u8]) -> Result<(), MpmError> {
        self.state = snapshot::decode(&self.settings, &self.state, data)?;
        self.last_frame = None;
        self.pulls.clear();
        Ok(())
    }
}
