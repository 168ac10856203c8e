//! The particles that a solver starts with, and their checks.

use std::collections::BTreeSet;

use crate::error::MpmError;
use crate::linalg::{Matrix, Vector};
use crate::material::{Constitutive, Material, Model};
use crate::particles::{Activity, EMITTED, Group, MaterialGroup, Particle};
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
    /// Numbers of the bodies, below 2^31; where absent, all of one material is one body. Elastic bodies part from each
    /// other and from all else.
    pub body: Option<&'a [u32]>,
}

/// Most elastic bodies of a scene, emitters of elastic material included.
const MOST_BODIES: usize = 32_000;

/// Checks the particles and groups them by material, elastic ones by body.
pub(crate) fn group<const D: usize>(
    settings: &SolverSettings<D>,
    particles: Particles<'_>,
) -> Result<Vec<MaterialGroup<D>>, MpmError> {
    check_particles(settings, particles)?;
    let flows = |material: &Material| !matches!(material.model, Model::Elastic(_));
    let mut next_field = u16::from(settings.materials.iter().any(flows));
    let mut groups = Vec::new();
    for (index, material) in settings.materials.iter().enumerate() {
        let mut part = Part {
            index,
            material,
            body: None,
            field: 0,
        };
        match material.model {
            Model::Water(model) => groups.push(MaterialGroup::Water(part.select(model, particles))),
            Model::Liquid(model) => {
                groups.push(MaterialGroup::Liquid(part.select(model, particles)));
            }
            Model::Sand(model) => groups.push(MaterialGroup::Sand(part.select(model, particles))),
            Model::Elastic(model) => {
                for body in elastic_bodies(settings, particles, index) {
                    if usize::from(next_field) > MOST_BODIES {
                        let allowed = "of at most 32000 elastic bodies";
                        return Err(MpmError::parameter("body", allowed, "more"));
                    }
                    (part.body, part.field) = (Some(body), next_field);
                    groups.push(MaterialGroup::Elastic(part.select(model, particles)));
                    next_field += 1;
                }
            }
        }
    }
    Ok(groups)
}

/// The numbers of the bodies of an elastic material, those that emitters bring included.
fn elastic_bodies<const D: usize>(
    settings: &SolverSettings<D>,
    particles: Particles<'_>,
    material: usize,
) -> BTreeSet<u32> {
    let numbered = particles.material.iter().enumerate();
    let mine = numbered.filter(|(_, index)| usize::from(**index) == material);
    let body = |i: usize| particles.body.map_or(0, |bodies| bodies[i]);
    let emitters = (EMITTED..).zip(&settings.openings.emitters);
    let emitted = emitters.filter(|(_, emitter)| usize::from(emitter.material) == material);
    let bodies = mine.map(|(i, _)| body(i));
    bodies.chain(emitted.map(|(body, _)| body)).collect()
}

/// A part of the particles that becomes a group.
struct Part<'a> {
    index: usize,
    material: &'a Material,
    /// None for all bodies.
    body: Option<u32>,
    field: u16,
}

impl Part<'_> {
    fn select<const D: usize, M: Constitutive<D>>(
        &self,
        model: M,
        input: Particles<'_>,
    ) -> Group<D, M> {
        let body = |i: usize| input.body.map_or(0, |bodies| bodies[i]);
        let particles: Vec<_> = (0..input.mass.len())
            .filter(|&i| usize::from(input.material[i]) == self.index)
            .filter(|&i| self.body.is_none_or(|mine| body(i) == mine))
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
        Group {
            index: self.index as u8,
            body: self.body.unwrap_or(0),
            field: self.field,
            ..Group::new(model, self.material.wall_friction, &particles)
        }
    }
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
        ("body", particles.body.map_or(n, <[u32]>::len), n),
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
        let body = particles.body.map_or(0, |bodies| bodies[i]);
        if body >= EMITTED {
            return Err(MpmError::parameter(
                format!("body[{i}]"),
                "below 2^31",
                body,
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
