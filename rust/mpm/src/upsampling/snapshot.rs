//! State of an upsampler as bytes: magic, version, size of the scene, state, checksum. All little-endian.

use super::block::{Block, Shown, blocks, particles};
use super::coarse::Previous;
use crate::error::MpmError;
use crate::linalg::{Matrix, Vector};
use crate::openings::Population;
use crate::snapshot::{Reader, fnv1a, read_population, write_population};

const MAGIC: &[u8; 8] = b"HMPMCARR";
/// Raised with the format and with the bits of an update; version 2 added the correction of the drift.
pub const UPSAMPLER_VERSION: u32 = 2;
/// Magic, version, dimension, resolution.
const HEADER: usize = 8 + 4 + 4 + 4;
const CHECKSUM: usize = 8;

/// State of an upsampler.
#[derive(Debug, Clone)]
pub struct UpsamplerState<const D: usize> {
    /// Shown particles at the latest update, in the order of their ids.
    pub blocks: Vec<Block<D>>,
    pub population: Population,
    /// Coarse particles at the latest update.
    pub previous: Previous<D>,
    /// Frame of the latest update.
    pub frame: u64,
    /// Number of materials of the scene.
    pub materials: usize,
}

pub fn encode<const D: usize>(resolution: usize, state: &UpsamplerState<D>) -> Vec<u8> {
    let mut out = Vec::new();
    out.extend_from_slice(MAGIC);
    for word in [UPSAMPLER_VERSION, D as u32, resolution as u32] {
        out.extend_from_slice(&word.to_le_bytes());
    }
    out.extend_from_slice(&state.frame.to_le_bytes());
    write_population(&state.population, &mut out);
    let mut put = |word: f32| out.extend_from_slice(&word.to_le_bytes());
    for p in particles(&state.blocks, state.population.ids.len()) {
        p.x.iter().chain(&p.v).for_each(|&word| put(word));
        put(p.mass);
        put(p.volume);
        put(f32::from(p.material));
    }
    out.extend_from_slice(&(state.previous.ids.len() as u64).to_le_bytes());
    for ((id, x), affine) in state
        .previous
        .ids
        .iter()
        .zip(&state.previous.x)
        .zip(&state.previous.affine)
    {
        out.extend_from_slice(&id.to_le_bytes());
        for word in x.iter().chain(affine) {
            out.extend_from_slice(&word.to_le_bytes());
        }
    }
    let checksum = fnv1a(&out);
    out.extend_from_slice(&checksum.to_le_bytes());
    out
}

/// Reads a state; `present` is one of the same scene. With emitters or sinks their particle counts may differ.
pub fn decode<const D: usize>(
    resolution: usize,
    present: &UpsamplerState<D>,
    is_open: bool,
    data: &[u8],
) -> Result<UpsamplerState<D>, MpmError> {
    let refuse = |reason: &str| {
        Err(MpmError::Snapshot {
            reason: reason.into(),
        })
    };
    if data.len() < HEADER + CHECKSUM || &data[..8] != MAGIC {
        return refuse("these bytes are not a state of shown particles, or they are cut off");
    }
    let (body, checksum) = data.split_at(data.len() - CHECKSUM);
    if fnv1a(body).to_le_bytes() != checksum {
        return refuse(
            "the checksum of its shown particles does not match: it is damaged or cut off",
        );
    }
    let mut reader = Reader { rest: &body[8..] };
    if reader.u32() != UPSAMPLER_VERSION {
        return refuse("its shown particles are of a version that this build does not read");
    }
    let (dim, of) = (reader.u32() as usize, reader.u32() as usize);
    if (dim, of) != (D, resolution) {
        return refuse("its shown particles belong to a scene with another dimension or grid");
    }
    let frame = reader.u64();
    let other = "its shown particles belong to a scene with other particles";
    let Some(population) = read_population(&present.population, &mut reader) else {
        return refuse(other);
    };
    if !is_open && population.ids.len() != present.population.ids.len() {
        return refuse(other);
    }
    let materials = present.materials;
    let all: Vec<_> = (0..population.ids.len())
        .map(|_| Shown {
            x: Vector::from_fn(|_, _| reader.f32()),
            v: Vector::from_fn(|_, _| reader.f32()),
            mass: reader.f32(),
            volume: reader.f32(),
            material: reader.f32() as u8,
        })
        .collect();
    let coarse = reader.u64() as usize;
    if coarse > reader.rest.len() || all.iter().any(|p| usize::from(p.material) >= materials) {
        return refuse(other);
    }
    let mut previous = Previous {
        ids: Vec::with_capacity(coarse),
        x: Vec::with_capacity(coarse),
        affine: Vec::with_capacity(coarse),
    };
    for _ in 0..coarse {
        previous.ids.push(reader.u64());
        previous.x.push(Vector::from_fn(|_, _| reader.f32()));
        previous
            .affine
            .push(Matrix::from_iterator((0..D * D).map(|_| reader.f32())));
    }
    if !reader.rest.is_empty() {
        return refuse(other);
    }
    Ok(UpsamplerState {
        blocks: blocks(&all),
        population,
        previous,
        frame,
        materials,
    })
}
