//! Complete state as bytes: magic, versions of the layout and of the solver, fingerprint of the scene, particles in
//! the solver's own order, checksum. All little-endian.

use crate::error::MpmError;
use crate::linalg::{Matrix, Vector};
use crate::material::{Constitutive, State};
use crate::openings::{EmitterStatus, Flow, Openings, Population};
use crate::particles::{Activity, Group, Particle, with_group};
use crate::settings::SolverSettings;
use crate::state::SolverState;
use crate::version::SOLVER_VERSION;

const MAGIC: &[u8; 8] = b"HMPMSNAP";
/// Version of the layout of snapshots.
pub const SNAPSHOT_VERSION: u32 = 4;
/// The last version of the layout that did not name the solver's, which was 1.
const WITHOUT_SOLVER: u32 = 3;
/// Magic, both versions, fingerprint, frame, speed.
const HEADER: usize = 8 + 4 + 4 + 8 + 8 + 4;
const CHECKSUM: usize = 8;

pub(crate) fn encode<const D: usize>(
    settings: &SolverSettings<D>,
    state: &SolverState<D>,
) -> Vec<u8> {
    let mut out = Vec::new();
    out.extend_from_slice(MAGIC);
    out.extend_from_slice(&SNAPSHOT_VERSION.to_le_bytes());
    out.extend_from_slice(&SOLVER_VERSION.to_le_bytes());
    out.extend_from_slice(&fingerprint(settings).to_le_bytes());
    out.extend_from_slice(&state.frame.to_le_bytes());
    out.extend_from_slice(&state.max_speed.to_le_bytes());
    for group in &state.groups {
        with_group!(group, group => {
            out.extend_from_slice(&(group.len() as u32).to_le_bytes());
            for p in group.particles() {
                out.extend_from_slice(&p.id.to_le_bytes());
                write(&p, &mut |word: f32| out.extend_from_slice(&word.to_le_bytes()));
            }
        });
    }
    write_population(&state.population, &mut out);
    write_bodies(&state.rigid, &mut out);
    let checksum = fnv1a(&out);
    out.extend_from_slice(&checksum.to_le_bytes());
    out
}

/// `present` is a state of the same scene, with the same groups.
pub(crate) fn decode<const D: usize>(
    settings: &SolverSettings<D>,
    present: &SolverState<D>,
    data: &[u8],
) -> Result<SolverState<D>, MpmError> {
    let refuse = |reason: String| MpmError::Snapshot { reason };
    if data.len() < HEADER + CHECKSUM || &data[..8] != MAGIC {
        return Err(refuse(
            "these bytes are no hybridmpm snapshot, or cut off".into(),
        ));
    }
    let (body, checksum) = data.split_at(data.len() - CHECKSUM);
    let mut reader = Reader { rest: &body[8..] };
    let version = reader.u32();
    let solver = match version {
        WITHOUT_SOLVER => 1,
        SNAPSHOT_VERSION => reader.u32(),
        _ => {
            return Err(refuse(format!(
                "it has version {version}, this build reads version {SNAPSHOT_VERSION}"
            )));
        }
    };
    if fnv1a(body).to_le_bytes() != checksum {
        return Err(refuse(
            "its checksum does not match: it is damaged or cut off".into(),
        ));
    }
    if solver != SOLVER_VERSION {
        return Err(refuse(format!(
            "it was made by version {solver} of the solver and would go on differently with this build's version \
             {SOLVER_VERSION}: go on with the hybridmpm that made it, or simulate the scene anew"
        )));
    }
    if reader.u64() != fingerprint(settings) {
        return Err(refuse("it belongs to a scene with other settings".into()));
    }
    let mut state = SolverState {
        frame: reader.u64(),
        max_speed: reader.f32(),
        groups: present.groups.clone(),
        population: present.population.clone(),
        rigid: present.rigid.clone(),
    };
    let other = || refuse("it belongs to a scene with other particles".into());
    for group in &mut state.groups {
        with_group!(group, group => read_group(group, &mut reader, settings.openings.any()).ok_or_else(other)?);
    }
    state.population = read_population(&state.population, &mut reader).ok_or_else(other)?;
    if !state.rigid.bodies.is_empty() {
        read_bodies(&mut state.rigid, &mut reader).ok_or_else(other)?;
    }
    if !reader.rest.is_empty() || !is_numbered(&state) {
        return Err(other());
    }
    Ok(state)
}

/// Whether the particles have the places 0 .. N, each once.
fn is_numbered<const D: usize>(state: &SolverState<D>) -> bool {
    let mut taken = vec![false; state.population.ids.len()];
    let mut count = 0;
    for group in &state.groups {
        with_group!(group, group => for p in group.particles() {
            count += 1;
            if let Some(taken) = taken.get_mut(p.id as usize) {
                *taken = true;
            }
        });
    }
    count == taken.len() && taken.iter().all(|&taken| taken)
}

pub(crate) fn write_population(population: &Population, out: &mut Vec<u8>) {
    let numbers = [population.ids.len() as u64, population.next_id];
    for number in numbers.iter().chain(&population.ids) {
        out.extend_from_slice(&number.to_le_bytes());
    }
    out.extend_from_slice(&population.emitted_mass.to_le_bytes());
    out.extend_from_slice(&population.removed_mass.to_le_bytes());
    for flow in &population.flows {
        out.extend_from_slice(&flow.travelled.to_le_bytes());
        out.extend_from_slice(&flow.layers.to_le_bytes());
        out.extend_from_slice(&(flow.status as u32).to_le_bytes());
    }
}

/// Reads the states of as many emitters as `present` has; None if there are more ids than bytes.
pub(crate) fn read_population(present: &Population, reader: &mut Reader<'_>) -> Option<Population> {
    let count = reader.u64();
    if count > reader.rest.len() as u64 / 8 {
        return None;
    }
    let next_id = reader.u64();
    Some(Population {
        next_id,
        ids: (0..count).map(|_| reader.u64()).collect(),
        emitted_mass: reader.f64(),
        removed_mass: reader.f64(),
        flows: (0..present.flows.len())
            .map(|_| {
                Some(Flow {
                    travelled: reader.f64(),
                    layers: reader.u64(),
                    status: EmitterStatus::from_number(reader.u32())?,
                })
            })
            .collect::<Option<_>>()?,
    })
}

/// Writes the rigid bodies; nothing where there are none.
fn write_bodies(state: &rigid::State, out: &mut Vec<u8>) {
    if state.bodies.is_empty() {
        return;
    }
    for number in state.bodies.iter().flat_map(numbers_of) {
        out.extend_from_slice(&number.to_le_bytes());
    }
    out.extend_from_slice(&(state.kept.len() as u32).to_le_bytes());
    for kept in &state.kept {
        (kept.key.iter()).for_each(|part| out.extend_from_slice(&part.to_le_bytes()));
        (kept.impulse.iter()).for_each(|part| out.extend_from_slice(&part.to_le_bytes()));
    }
}

fn numbers_of(moving: &rigid::Moving) -> Vec<f64> {
    let turn = moving.placed.turn.quaternion();
    let vectors = [
        moving.placed.x,
        moving.v,
        moving.w,
        moving.support.v,
        moving.support.w,
    ];
    let vectors = vectors.into_iter().flat_map(|v| [v.x, v.y, v.z]);
    [turn.w, turn.i, turn.j, turn.k]
        .into_iter()
        .chain(vectors)
        .collect()
}

/// Reads as many bodies as there are; None if there are more contacts than bytes.
fn read_bodies(state: &mut rigid::State, reader: &mut Reader<'_>) -> Option<()> {
    for moving in &mut state.bodies {
        let [w, i, j, k] = [(); 4].map(|()| reader.f64());
        let turn = rigid::Rotation::new_unchecked(nalgebra::Quaternion::new(w, i, j, k));
        let mut vector = || {
            let [x, y, z] = [(); 3].map(|()| reader.f64());
            rigid::Vector3::new(x, y, z)
        };
        let x = vector();
        *moving = rigid::Moving {
            placed: rigid::Placed { x, turn },
            v: vector(),
            w: vector(),
            support: rigid::Rates {
                v: vector(),
                w: vector(),
            },
        };
    }
    let count = reader.u32() as usize;
    if count > reader.rest.len() {
        return None;
    }
    state.kept = (0..count)
        .map(|_| rigid::Kept {
            key: [(); 4].map(|()| reader.u32()),
            impulse: [(); 3].map(|()| reader.f64()),
        })
        .collect();
    Some(())
}

/// Reads the particles of a group. None where it has another size than the present one, or ids that this one lacks;
/// in a scene with openings both may differ.
fn read_group<const D: usize, M: Constitutive<D>>(
    group: &mut Group<D, M>,
    reader: &mut Reader<'_>,
    is_open: bool,
) -> Option<()> {
    let count = reader.u32() as usize;
    if count > reader.rest.len() || !(is_open || count == group.len()) {
        return None;
    }
    let mut ids: Vec<u32> = group.particles().map(|p| p.id).collect();
    let particles: Vec<_> = (0..count)
        .map(|_| {
            let id = reader.u32();
            read(id, &mut || reader.f32())
        })
        .collect();
    let mut restored: Vec<u32> = particles.iter().map(|p| p.id).collect();
    ids.sort_unstable();
    restored.sort_unstable();
    group.clear();
    group.append(&particles);
    (is_open || ids == restored).then_some(())
}

fn write<const D: usize, S: State>(p: &Particle<D, S>, put: &mut impl FnMut(f32)) {
    p.x.iter()
        .chain(&p.v)
        .chain(&p.affine)
        .for_each(|&word| put(word));
    put(p.mass);
    put(p.volume);
    put(p.calm);
    put(f32::from(p.activity as u8));
    p.state.write(put);
}

fn read<const D: usize, S: State>(id: u32, take: &mut impl FnMut() -> f32) -> Particle<D, S> {
    Particle {
        id,
        x: Vector::from_fn(|_, _| take()),
        v: Vector::from_fn(|_, _| take()),
        affine: Matrix::from_fn(|_, _| take()),
        mass: take(),
        volume: take(),
        calm: take(),
        activity: match take() as u8 {
            0 => Activity::Awake,
            1 => Activity::Border,
            _ => Activity::Asleep,
        },
        state: S::read(take),
    }
}

/// Hash of all settings that shape the motion. Substeps and threads are not among them and may differ.
fn fingerprint<const D: usize>(settings: &SolverSettings<D>) -> u64 {
    let SolverSettings {
        resolution,
        cells,
        frame_dt,
        gravity,
        walls,
        contact_friction,
        transfer_loss,
        materials,
        obstacles,
        rigid,
        openings,
        sleep,
        ..
    } = settings;
    let Openings {
        emitters, sinks, ..
    } = openings;
    let text = format!(
        "{D} {resolution} {frame_dt:?} {gravity:?} {walls:?} {contact_friction:?} {materials:?} {obstacles:?} \
         {emitters:?} {sinks:?} {sleep:?}"
    );
    // A world of one metre has the fingerprint that it had when there were no others.
    let of_world = if *cells == [*resolution; D] {
        String::new()
    } else {
        format!(" {cells:?}")
    };
    // The same for scenes that lose deviations in each substep.
    let of_loss = transfer_loss.map_or(String::new(), |rate| format!(" loss {rate:?}"));
    // The same for scenes without rigid bodies.
    let of_bodies = if rigid.is_empty() {
        String::new()
    } else {
        format!(" rigid {rigid:?}")
    };
    fnv1a((text + &of_world + &of_loss + &of_bodies).as_bytes())
}

pub(crate) fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// Reads numbers off a slice. Past the end it answers zeros: the checksum has spoken before, and a group
/// of another size is refused by its count.
pub(crate) struct Reader<'a> {
    pub rest: &'a [u8],
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let Some((head, rest)) = self.rest.split_first_chunk::<N>() else {
            self.rest = &[];
            return [0; N];
        };
        self.rest = rest;
        *head
    }

    pub fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    pub fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.take())
    }

    pub fn f64(&mut self) -> f64 {
        f64::from_le_bytes(self.take())
    }

    pub fn f32(&mut self) -> f32 {
        f32::from_le_bytes(self.take())
    }
}
