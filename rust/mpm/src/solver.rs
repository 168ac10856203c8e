//! The frame loop.

use std::sync::Arc;

use crate::diagnostics::Diagnostics;
use crate::error::MpmError;
use crate::g2p::{Bounds, Gather, g2p};
use crate::grid::Grid;
use crate::grid_update::{GridForces, grid_update};
use crate::material::{Constitutive, Material, Model};
use crate::math::{Columns, Matrix, Vector, lanes, vector};
use crate::obstacle::{MaterialFriction, Obstacle, Obstacles};
use crate::p2g::{Step, p2g};
use crate::particle::{Group, Particle, Phase, Slab, sort};
use crate::snapshot;
use crate::timestep::{Bound, FrameReport, StepChooser, Substeps};
use crate::walls::{WallContact, Walls};
use crate::with_group;

/// Everything about a scene but its particles.
#[derive(Debug, Clone)]
pub struct Settings<const D: usize> {
    /// Grid cells along each axis, 8 to 1024.
    pub resolution: usize,
    /// Length of a frame [s].
    pub frame_dt: f32,
    /// [m/s^2]
    pub gravity: Vector<D>,
    pub walls: Walls<D>,
    /// 1 to 255.
    pub materials: Vec<Material>,
    pub obstacles: Vec<Obstacle<D>>,
    pub substeps: Substeps,
    /// At least 1; no influence on the result.
    pub threads: usize,
}

/// Initial particles, N of each, vectors as N x D numbers.
#[derive(Debug, Clone, Copy)]
pub struct Particles<'a> {
    /// [m]
    pub x: &'a [f32],
    /// [m/s]
    pub v: &'a [f32],
    /// Index into the materials.
    pub material: &'a [u8],
    /// [kg]
    pub mass: &'a [f32],
    /// Rest volume [m^D].
    pub volume: &'a [f32],
    /// Initial J; 1 where absent.
    pub volume_ratio: Option<&'a [f32]>,
}

/// External acceleration besides gravity [m/s^2].
#[derive(Debug, Clone, Copy)]
pub enum Force<'a> {
    None,
    /// N x D numbers for all frames.
    Held(&'a [f32]),
    /// frames x N x D numbers.
    PerFrame(&'a [f32]),
}

/// Below this many particles, handing work to threads costs more than it saves.
const PARALLEL_FROM: usize = 8_192;

/// MLS-MPM on one scene.
#[derive(Clone)]
pub struct Solver<const D: usize> {
    settings: Settings<D>,
    chooser: StepChooser,
    bounds: Bounds<D>,
    walls: WallContact,
    obstacles: Obstacles<D>,
    material_friction: MaterialFriction,
    /// See `Gather`.
    per_rest_mass: f32,
    pool: Option<Arc<rayon::ThreadPool>>,
    grid: Grid<D>,
    slabs: Vec<Slab>,
    state: State<D>,
    /// State before the frame in progress; kept to reuse its memory.
    before: Vec<Phase<D>>,
    last_frame: Option<FrameReport>,
    count: usize,
}

/// What a snapshot has to hold.
#[derive(Clone)]
pub(crate) struct State<const D: usize> {
    pub phases: Vec<Phase<D>>,
    /// Frames done.
    pub frame: u64,
    /// Of all particles [m/s].
    pub max_speed: f32,
}

impl<const D: usize> Solver<D> {
    /// Checks everything; afterwards only the motion itself can fail.
    pub fn new(settings: Settings<D>, particles: Particles<'_>) -> Result<Self, MpmError> {
        check_settings(&settings)?;
        let dx = 1.0 / settings.resolution as f32;
        let chooser = StepChooser::new(
            settings.substeps,
            settings.frame_dt,
            dx,
            D,
            &settings.materials,
        )?;
        let phases = group(&settings, particles)?;
        let frictions = || settings.materials.iter().map(|m| m.wall_friction);
        let uniform =
            frictions().all(|mu| mu.to_bits() == settings.materials[0].wall_friction.to_bits());
        let grid = Grid::new(settings.resolution, !uniform);
        let pool = if settings.threads > 1 {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(settings.threads)
                .build();
            Some(Arc::new(pool.map_err(|error| {
                MpmError::parameter(
                    "threads",
                    "a number that the system grants",
                    error.to_string(),
                )
            })?))
        } else {
            None
        };
        let max_speed = particles.v.chunks_exact(D).map(norm).fold(0.0, f32::max);
        Ok(Self {
            chooser,
            bounds: Bounds::new(settings.walls, &grid.layout),
            walls: WallContact::new(&settings.walls, &grid.layout),
            obstacles: Obstacles::new(settings.obstacles.clone(), &grid.layout),
            material_friction: if uniform {
                MaterialFriction::Uniform(settings.materials[0].wall_friction)
            } else {
                MaterialFriction::Mixed
            },
            per_rest_mass: per_rest_mass::<D>(particles, dx),
            pool,
            grid,
            slabs: Vec::new(),
            before: Vec::new(),
            state: State {
                phases,
                frame: 0,
                max_speed,
            },
            last_frame: None,
            count: particles.mass.len(),
            settings,
        })
    }

    /// Advances by whole frames and calls back after each with the solver.
    ///
    /// On an error the state is the one before the frame that failed; earlier frames stand.
    pub fn advance(
        &mut self,
        frames: usize,
        force: Force<'_>,
        mut after: impl FnMut(usize, &Self),
    ) -> Result<(), MpmError> {
        let size = self.count * D;
        let (forces, expected) = match force {
            Force::None => (&[][..], 0),
            Force::Held(forces) => (forces, size),
            Force::PerFrame(forces) => (forces, size * frames),
        };
        if forces.len() != expected {
            return Err(MpmError::Length {
                name: "force",
                expected,
                got: forces.len(),
            });
        }
        if let Some(bad) = forces.iter().find(|a| !a.is_finite()) {
            return Err(MpmError::parameter("force", "finite", bad));
        }
        for index in 0..frames {
            let force = match force {
                Force::None => None,
                Force::Held(held) => Some(held),
                Force::PerFrame(all) => Some(&all[index * size..][..size]),
            };
            self.advance_frame(force)?;
            after(index, self);
        }
        Ok(())
    }

    fn advance_frame(&mut self, force: Option<&[f32]>) -> Result<(), MpmError> {
        if self.before.is_empty() {
            self.before.clone_from(&self.state.phases);
        } else {
            let pairs = self.before.iter_mut().zip(&self.state.phases);
            pairs.for_each(|(before, now)| before.copy_particles(now));
        }
        let max_speed = self.state.max_speed;
        let parallel = self.count >= PARALLEL_FROM;
        let result = match self.pool.clone().filter(|_| parallel) {
            Some(pool) => pool.install(|| self.substeps(force, true)),
            None => self.substeps(force, false),
        };
        match result {
            Ok(report) => {
                self.last_frame = Some(report);
                self.state.frame += 1;
                Ok(())
            }
            Err(error) => {
                std::mem::swap(&mut self.state.phases, &mut self.before);
                self.state.max_speed = max_speed;
                Err(error)
            }
        }
    }

    fn substeps(&mut self, force: Option<&[f32]>, parallel: bool) -> Result<FrameReport, MpmError> {
        let dx = self.grid.layout.dx();
        let mut report = FrameReport {
            substeps: 0,
            smallest_dt: f32::INFINITY,
            bound: Bound::Frame,
        };
        let pull = self.settings.gravity.norm()
            + force.map_or(0.0, |force| {
                force.chunks_exact(D).map(norm).fold(0.0, f32::max)
            });
        let mut remaining = self.settings.frame_dt;
        // Sorting at the start of a frame makes a frame a function of the state alone.
        let mut travelled = f32::INFINITY;
        while remaining > 0.0 {
            // A substep is at most dx / signal speed long, so speeds gain at most this.
            let speed = self.state.max_speed + pull * dx / self.chooser.signal_speed;
            let (dt, bound) = self.chooser.next(remaining, speed)?;
            if travelled >= dx {
                self.sort();
                travelled = 0.0;
            }
            let outcome = self.substep(Step { dt, force }, parallel);
            if !outcome {
                return Err(self.diagnose());
            }
            travelled += self.state.max_speed * dt;
            remaining -= dt;
            // What is left after the last substep is rounding.
            if remaining < 1.0e-3 * dt {
                remaining = 0.0;
            }
            report.substeps += 1;
            if dt < report.smallest_dt {
                (report.smallest_dt, report.bound) = (dt, bound);
            }
        }
        Ok(report)
    }

    fn sort(&mut self) {
        let layout = self.grid.layout;
        self.slabs = sort(&mut self.state.phases, &layout);
        let bases = self.state.phases.iter().flat_map(|phase| {
            let bases: Box<dyn Iterator<Item = [usize; D]>> = with_group!(phase, group => {
                Box::new(group.particles.iter().map(move |p| crate::particle::base(&p.x, &layout)))
            });
            bases
        });
        self.grid.activate(bases);
    }

    /// One substep; false when a particle is no longer sound.
    fn substep(&mut self, step: Step<'_, D>, parallel: bool) -> bool {
        self.grid.clear();
        p2g(
            &self.state.phases,
            &self.slabs,
            &mut self.grid,
            step,
            parallel,
        );
        let forces = GridForces {
            gravity: self.settings.gravity,
            walls: &self.walls,
            obstacles: &self.obstacles,
            material_friction: self.material_friction,
        };
        grid_update(&mut self.grid, &forces, step.dt);
        let (phases, grid) = (&mut self.state.phases, &self.grid);
        let gather = Gather {
            dt: step.dt,
            per_rest_mass: self.per_rest_mass,
        };
        let outcome = g2p(
            phases,
            grid,
            &self.bounds,
            &self.obstacles,
            gather,
            parallel,
        );
        self.state.max_speed = outcome.max_speed_squared.sqrt();
        outcome.sound
    }

    /// Names the particle that is no longer sound, the lowest index if there are several.
    fn diagnose(&self) -> MpmError {
        let frame = self.state.frame;
        let mut found: Option<(u32, MpmError)> = None;
        for phase in &self.state.phases {
            with_group!(phase, group => {
                for p in &group.particles {
                    let j = group.volume_ratio(p);
                    let finite = p.x.iter().chain(&p.v.to_array()).all(|s| s.is_finite()) && j.is_finite();
                    let error = if !finite {
                        MpmError::NonFinite { particle: p.id, frame }
                    } else if !self.bounds.hold(&p.x) {
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

    pub fn settings(&self) -> &Settings<D> {
        &self.settings
    }

    /// Number of particles.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Frames done.
    pub fn frame(&self) -> u64 {
        self.state.frame
    }

    /// How the latest frame was cut; None before the first.
    pub fn last_frame(&self) -> Option<FrameReport> {
        self.last_frame
    }

    /// Writes N x D positions [m] in the caller's order.
    pub fn write_positions(&self, out: &mut [f32]) {
        self.scatter(out, D, |x, _, _, into| into.copy_from_slice(x.as_slice()));
    }

    /// Writes N x D velocities [m/s] in the caller's order.
    pub fn write_velocities(&self, out: &mut [f32]) {
        self.scatter(out, D, |_, v, _, into| into.copy_from_slice(v.as_slice()));
    }

    /// Writes N x D x D APIC matrices [1/s], row-major, in the caller's order.
    pub fn write_affine(&self, out: &mut [f32]) {
        self.scatter(out, D * D, |_, _, c, into| {
            for (row, values) in into.chunks_exact_mut(D).enumerate() {
                values
                    .iter_mut()
                    .enumerate()
                    .for_each(|(column, value)| *value = c[(row, column)]);
            }
        });
    }

    /// Writes N volume ratios in the caller's order.
    pub fn write_volume_ratios(&self, out: &mut [f32]) {
        for phase in &self.state.phases {
            with_group!(phase, group => for p in &group.particles {
                out[p.id as usize] = group.volume_ratio(p);
            });
        }
    }

    fn scatter(
        &self,
        out: &mut [f32],
        width: usize,
        write: impl Fn(&Vector<D>, &Vector<D>, &Matrix<D>, &mut [f32]),
    ) {
        for phase in &self.state.phases {
            with_group!(phase, group => for p in &group.particles {
                write(&p.x, &vector(p.v), &p.affine.matrix(), &mut out[p.id as usize * width..][..width]);
            });
        }
    }

    /// Totals over all particles.
    pub fn diagnostics(&self) -> Diagnostics {
        Diagnostics::of(&self.state.phases, &self.settings.gravity)
    }

    /// The complete state. Going on from it gives the same bits.
    pub fn snapshot(&self) -> Vec<u8> {
        snapshot::encode(&self.settings, &self.state)
    }

    /// Takes the state of a snapshot of the same scene; on an error the present one stays.
    pub fn restore(&mut self, data: &[u8]) -> Result<(), MpmError> {
        self.state = snapshot::decode(&self.settings, &self.state, data)?;
        self.last_frame = None;
        Ok(())
    }
}

/// One over the mass that fills a cell at rest; 0 where particles differ in density by more than 1 %,
/// because the mass of a node then says nothing about how full it is.
fn per_rest_mass<const D: usize>(particles: Particles<'_>, dx: f32) -> f32 {
    let densities = || {
        particles
            .mass
            .iter()
            .zip(particles.volume)
            .map(|(mass, volume)| mass / volume)
    };
    let (lightest, heaviest) = densities().fold((f32::INFINITY, 0.0f32), |(low, high), rho| {
        (low.min(rho), high.max(rho))
    });
    if heaviest > 0.0 && heaviest <= 1.01 * lightest {
        1.0 / (heaviest * dx.powi(D as i32))
    } else {
        0.0
    }
}

fn norm(components: &[f32]) -> f32 {
    components.iter().map(|s| s * s).sum::<f32>().sqrt()
}

fn check_settings<const D: usize>(settings: &Settings<D>) -> Result<(), MpmError> {
    if !(8..=1024).contains(&settings.resolution) {
        return Err(MpmError::parameter(
            "resolution",
            "in [8, 1024]",
            settings.resolution,
        ));
    }
    if !(settings.frame_dt > 0.0 && settings.frame_dt.is_finite()) {
        return Err(MpmError::parameter(
            "frame_dt",
            "finite and > 0 s",
            settings.frame_dt,
        ));
    }
    if !settings.gravity.iter().all(|g| g.is_finite()) {
        return Err(MpmError::parameter(
            "gravity",
            "finite",
            settings.gravity.as_slice(),
        ));
    }
    if settings.materials.is_empty() || settings.materials.len() > 255 {
        return Err(MpmError::parameter(
            "materials",
            "1 to 255 materials",
            settings.materials.len(),
        ));
    }
    if settings.threads == 0 {
        return Err(MpmError::parameter("threads", "at least 1", 0));
    }
    settings.walls.check(1.0 / settings.resolution as f32)
}

/// Checks the particles and groups them by material.
fn group<const D: usize>(
    settings: &Settings<D>,
    particles: Particles<'_>,
) -> Result<Vec<Phase<D>>, MpmError> {
    check_particles(settings, particles)?;
    Ok(settings
        .materials
        .iter()
        .enumerate()
        .map(|(index, material)| match material.model {
            Model::Water(model) => Phase::Water(select(model, material, index, particles)),
            Model::Sand(model) => Phase::Sand(select(model, material, index, particles)),
            Model::Elastic(model) => Phase::Elastic(select(model, material, index, particles)),
        })
        .collect())
}

fn select<const D: usize, M: Constitutive<D>>(
    model: M,
    material: &Material,
    index: usize,
    input: Particles<'_>,
) -> Group<D, M> {
    let particles = (0..input.mass.len())
        .filter(|&i| usize::from(input.material[i]) == index)
        .map(|i| Particle {
            x: Vector::from_column_slice(&input.x[i * D..][..D]),
            v: lanes(&Vector::<D>::from_column_slice(&input.v[i * D..][..D]), 1.0),
            affine: Columns::ZERO,
            mass: input.mass[i],
            volume: input.volume[i],
            id: i as u32,
            state: model.initial_state(input.volume_ratio.map_or(1.0, |ratios| ratios[i])),
        })
        .collect();
    Group::new(model, material.wall_friction, particles)
}

fn check_particles<const D: usize>(
    settings: &Settings<D>,
    particles: Particles<'_>,
) -> Result<(), MpmError> {
    let n = particles.mass.len();
    let lengths = [
        ("x", particles.x.len(), n * D),
        ("v", particles.v.len(), n * D),
        ("material", particles.material.len(), n),
        ("volume", particles.volume.len(), n),
        (
            "volume_ratio",
            particles.volume_ratio.map_or(n, <[f32]>::len),
            n,
        ),
    ];
    if let Some(&(name, got, expected)) = lengths.iter().find(|(_, got, expected)| got != expected)
    {
        return Err(MpmError::Length {
            name,
            expected,
            got,
        });
    }
    let walls = &settings.walls;
    for i in 0..n {
        let x = Vector::<D>::from_column_slice(&particles.x[i * D..][..D]);
        if !walls.contain(&x) {
            return Err(MpmError::parameter(
                format!("x[{i}]"),
                "inside the walls",
                x.as_slice(),
            ));
        }
        let v = &particles.v[i * D..][..D];
        if !v.iter().all(|s| s.is_finite()) {
            return Err(MpmError::parameter(format!("v[{i}]"), "finite", v));
        }
        if usize::from(particles.material[i]) >= settings.materials.len() {
            let value = particles.material[i];
            return Err(MpmError::parameter(
                format!("material[{i}]"),
                "an index into materials",
                value,
            ));
        }
        let ratio = particles.volume_ratio.map_or(1.0, |ratios| ratios[i]);
        for (name, value) in [
            ("mass", particles.mass[i]),
            ("volume", particles.volume[i]),
            ("volume_ratio", ratio),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(MpmError::parameter(
                    format!("{name}[{i}]"),
                    "finite and > 0",
                    value,
                ));
            }
        }
    }
    Ok(())
}
