//! Carried particles as bytes: magic, version, size of the scene, state, checksum. All little-endian.

use super::block::{Block, Carried, blocks, particles};
use super::few::Past;
use crate::error::MpmError;
use crate::linalg::{Matrix, Vector};
use crate::openings::Population;
use crate::snapshot::{Reader, fnv1a, read_population, write_population};

const MAGIC: &[u8; 8] = b"HMPMCARR";
/// Raised where the same carry gives other bits, too: version 2 leads strayed particles back.
const VERSION: u32 = 2;
/// Magic, version, dimension, resolution.
const HEADER: usize = 8 + 4 + 4 + 4;
const CHECKSUM: usize = 8;

/// What a snapshot has to hold.
#[derive(Debug, Clone)]
pub struct CarrierState<const D: usize> {
    /// The particles at the latest carry, in the order of their ids.
    pub blocks: Vec<Block<D>>,
    pub population: Population,
    /// The few at the latest carry.
    pub past: Past<D>,
    /// Frame of the latest carry.
    pub frame: u64,
    /// Number of materials of the scene.
    pub materials: usize,
}

pub fn encode<const D: usize>(resolution: usize, state: &CarrierState<D>) -> Vec<u8> {
    let mut out = Vec::new();
    out.extend_from_slice(MAGIC);
    for word in [VERSION, D as u32, resolution as u32] {
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
    out.extend_from_slice(&(state.past.ids.len() as u64).to_le_bytes());
    for ((id, x), affine) in state
        .past
        .ids
        .iter()
        .zip(&state.past.x)
        .zip(&state.past.affine)
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

/// `present` is a state of the same scene; in an open one the numbers of particles may differ.
pub fn decode<const D: usize>(
    resolution: usize,
    present: &CarrierState<D>,
    is_open: bool,
    data: &[u8],
) -> Result<CarrierState<D>, MpmError> {
    let refuse = |reason: &str| {
        Err(MpmError::Snapshot {
            reason: reason.into(),
        })
    };
    if data.len() < HEADER + CHECKSUM || &data[..8] != MAGIC {
        return refuse("these bytes are no state of carried particles, or cut off");
    }
    let (body, checksum) = data.split_at(data.len() - CHECKSUM);
    if fnv1a(body).to_le_bytes() != checksum {
        return refuse(
            "the checksum of its carried particles does not match: it is damaged or cut off",
        );
    }
    let mut reader = Reader { rest: &body[8..] };
    if reader.u32() != VERSION {
        return refuse("its carried particles are of a version that this build does not read");
    }
    let (dim, of) = (reader.u32() as usize, reader.u32() as usize);
    if (dim, of) != (D, resolution) {
        return refuse("its carried particles belong to a scene with another dimension or grid");
    }
    let frame = reader.u64();
    let other = "its carried particles belong to a scene with other particles";
    let Some(population) = read_population(&present.population, &mut reader) else {
        return refuse(other);
    };
    if !is_open && population.ids.len() != present.population.ids.len() {
        return refuse(other);
    }
    let materials = present.materials;
    let all: Vec<_> = (0..population.ids.len())
        .map(|_| Carried {
            x: Vector::from_fn(|_, _| reader.f32()),
            v: Vector::from_fn(|_, _| reader.f32()),
            mass: reader.f32(),
            volume: reader.f32(),
            material: reader.f32() as u8,
        })
        .collect();
    let few = reader.u64() as usize;
    if few > reader.rest.len() || all.iter().any(|p| usize::from(p.material) >= materials) {
        return refuse(other);
    }
    let mut past = Past {
        ids: Vec::with_capacity(few),
        x: Vec::with_capacity(few),
        affine: Vec::with_capacity(few),
    };
    for _ in 0..few {
        past.ids.push(reader.u64());
        past.x.push(Vector::from_fn(|_, _| reader.f32()));
        past.affine
            .push(Matrix::from_iterator((0..D * D).map(|_| reader.f32())));
    }
    if !reader.rest.is_empty() {
        return refuse(other);
    }
    Ok(CarrierState {
        blocks: blocks(&all),
        population,
        past,
        frame,
        materials,
    })
}
