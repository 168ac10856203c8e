//! What a solver is built from, and its checks: after them every stage may trust its input.

use crate::boundary::{Obstacle, Shape, Walls};
use crate::error::MpmError;
use crate::linalg::{Matrix, Vector};
use crate::material::{Constitutive, Material, Model};
use crate::openings::Emitter;
use crate::particles::{Activity, Group, Particle, Phase, Sleep};
use crate::substep::Substeps;

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
    /// They act at the end of each frame.
    pub emitters: Vec<Emitter<D>>,
    /// Particles that end a frame inside of one are removed.
    pub sinks: Vec<Shape<D>>,
    /// Emitters add none beyond.
    pub max_particles: usize,
    pub substeps: Substeps,
    /// Whether regions at rest may sleep; None for the ground truth.
    pub sleep: Option<Sleep>,
    /// At least 1; no influence on the result.
    pub threads: usize,
}

impl<const D: usize> Settings<D> {
    /// Whether the number of particles may change.
    pub fn is_open(&self) -> bool {
        !(self.emitters.is_empty() && self.sinks.is_empty())
    }
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

/// One over the mass that fills a cell at rest; 0 where particles differ in density by more than 1 %,
/// because the mass of a node then says nothing about how full it is.
pub(crate) fn per_rest_mass<const D: usize>(
    particles: Particles<'_>,
    emitters: &[Emitter<D>],
    dx: f32,
) -> f32 {
    let densities = || {
        let present = particles.mass.iter().zip(particles.volume);
        let coming = emitters.iter().map(|e| (&e.mass, &e.volume));
        present.chain(coming).map(|(mass, volume)| mass / volume)
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

pub(crate) fn check_settings<const D: usize>(settings: &Settings<D>) -> Result<(), MpmError> {
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
    if let Some(sleep) = &settings.sleep {
        sleep.check()?;
    }
    settings.walls.check(1.0 / settings.resolution as f32)?;
    settings.sinks.iter().try_for_each(Shape::check)?;
    let mut numbered = settings.emitters.iter().enumerate();
    numbered.try_for_each(|(i, emitter)| emitter.check(&format!("emitters[{i}]"), settings))
}

/// Checks the particles and groups them by material.
pub(crate) fn group<const D: usize>(
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
    let particles: Vec<_> = (0..input.mass.len())
        .filter(|&i| usize::from(input.material[i]) == index)
        .map(|i| Particle {
            x: Vector::from_column_slice(&input.x[i * D..][..D]),
            v: Vector::from_column_slice(&input.v[i * D..][..D]),
            affine: Matrix::zeros(),
            mass: input.mass[i],
            volume: input.volume[i],
            id: i as u32,
            calm: 0.0,
            activity: Activity::Awake,
            state: model.initial_state(input.volume_ratio.map_or(1.0, |ratios| ratios[i])),
        })
        .collect();
    Group::new(model, material.wall_friction, &particles)
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
