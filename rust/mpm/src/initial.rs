//! The particles that a solver starts with, and their checks.

use crate::error::MpmError;
use crate::linalg::{Matrix, Vector};
use crate::material::{Constitutive, Material, Model};
use crate::particles::{Activity, Group, MaterialGroup, Particle};
use crate::settings::SolverSettings;

/// Initial particles, N of each, vectors as N x D numbers.
#[derive(Debug, Clone, Copy)]
pub struct Particles<'a> {
    /// Positions [m].
    pub x: &'a [f32],
    /// Velocities [m/s].
    pub v: &'a [f32],
    /// Indices into the materials.
    pub material: &'a [u8],
    /// Masses [kg].
    pub mass: &'a [f32],
    /// Rest volumes [m^D].
    pub volume: &'a [f32],
    /// Initial J; 1 where absent.
    pub volume_ratio: Option<&'a [f32]>,
}

/// Checks the particles and groups them by material.
pub(crate) fn group<const D: usize>(
    settings: &SolverSettings<D>,
    particles: Particles<'_>,
) -> Result<Vec<MaterialGroup<D>>, MpmError> {
    check_particles(settings, particles)?;
    Ok(settings
        .materials
        .iter()
        .enumerate()
        .map(|(index, material)| match material.model {
            Model::Water(model) => MaterialGroup::Water(select(model, material, index, particles)),
            Model::Sand(model) => MaterialGroup::Sand(select(model, material, index, particles)),
            Model::Elastic(model) => {
                MaterialGroup::Elastic(select(model, material, index, particles))
            }
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

pub(crate) fn check_particles<const D: usize>(
    settings: &SolverSettings<D>,
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
        if !walls.contains(&x) {
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
