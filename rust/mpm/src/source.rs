//! Emitters, which add particles between frames, and sinks, which take them away.
//!
//! Both act on the state at the end of a frame and on its number alone, so they depend neither on threads nor
//! on how a run is cut into calls.

use crate::error::MpmError;
use crate::input::Settings;
use crate::material::Constitutive;
use crate::math::{Matrix, Vector};
use crate::obstacle::Obstacles;
use crate::particle::{Group, Particle};
use crate::shape::Shape;
use crate::solver::SolverState;
use crate::with_group;

/// An opening that material leaves at a given velocity, in layers one spacing apart.
#[derive(Debug, Clone, PartialEq)]
pub struct Emitter<const D: usize> {
    /// Index into the materials.
    pub material: u8,
    /// Of the material that leaves [m/s].
    pub velocity: Vector<D>,
    /// Distance between layers [m].
    pub spacing: f32,
    /// The particles of a layer that has just left the opening [m].
    pub sites: Vec<Vector<D>>,
    /// Offsets from the sites [m], of one layer after the other; used in turn.
    pub jitter: Vec<Vector<D>>,
    /// Of each particle [kg].
    pub mass: f32,
    /// Rest volume of each particle [m^D].
    pub volume: f32,
    /// [s]
    pub start: f64,
    /// May be infinite [s].
    pub stop: f64,
}

/// What an emitter did in the latest frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum EmitterStatus {
    /// It has not started.
    Waiting,
    Running,
    /// Material or an obstacle is in its way.
    Blocked,
    /// There are as many particles as are allowed.
    Full,
    /// It has stopped.
    Ended,
}

impl EmitterStatus {
    const ALL: [Self; 5] = [
        Self::Waiting,
        Self::Running,
        Self::Blocked,
        Self::Full,
        Self::Ended,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Running => "running",
            Self::Blocked => "blocked",
            Self::Full => "full",
            Self::Ended => "ended",
        }
    }

    pub(crate) fn from_number(number: u32) -> Option<Self> {
        Self::ALL.get(number as usize).copied()
    }
}

/// How far an emitter has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Flow {
    /// Way of the material since it left room for the latest layer [m].
    pub travelled: f64,
    pub layers: u64,
    pub status: EmitterStatus,
}

/// Who the particles are, and the balance of those that came and went.
#[derive(Debug, Clone)]
pub(crate) struct Population {
    /// Number for good of each particle, in the caller's order; ascending.
    pub ids: Vec<u64>,
    pub next_id: u64,
    /// [kg]
    pub emitted_mass: f64,
    /// [kg]
    pub removed_mass: f64,
    pub flows: Vec<Flow>,
}

impl Population {
    pub fn new(count: usize, emitters: usize) -> Self {
        let flow = Flow {
            travelled: 0.0,
            layers: 0,
            status: EmitterStatus::Waiting,
        };
        Self {
            ids: (0..count as u64).collect(),
            next_id: count as u64,
            emitted_mass: 0.0,
            removed_mass: 0.0,
            flows: vec![flow; emitters],
        }
    }
}

/// An opening that is this full of other material lets nothing out.
const CROWDED: f32 = 0.25;

impl<const D: usize> Emitter<D> {
    /// Refuses numbers out of range, and openings whose material would start outside the walls.
    pub(crate) fn check(&self, name: &str, settings: &Settings<D>) -> Result<(), MpmError> {
        let refuse = |what: &str, allowed, value: &dyn std::fmt::Debug| {
            Err(MpmError::parameter(
                format!("{name}.{what}"),
                allowed,
                value,
            ))
        };
        if usize::from(self.material) >= settings.materials.len() {
            return refuse("material", "an index into materials", &self.material);
        }
        let speed = self.velocity.norm();
        if !(speed > 0.0 && speed.is_finite()) {
            return refuse("velocity", "finite and not zero", &self.velocity.as_slice());
        }
        for (what, value) in [
            ("spacing", self.spacing),
            ("mass", self.mass),
            ("volume", self.volume),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(what, "finite and > 0", &value);
            }
        }
        if !(self.start >= 0.0 && self.start < self.stop) {
            return refuse("start", ">= 0 s and before stop", &(self.start, self.stop));
        }
        if self.sites.is_empty() || self.jitter.is_empty() {
            return refuse("sites", "one or more, with jitter", &self.sites.len());
        }
        if !self.jitter.len().is_multiple_of(self.sites.len()) {
            return refuse(
                "jitter",
                "of whole layers of sites",
                &(self.jitter.len(), self.sites.len()),
            );
        }
        let farthest = f64::from(speed) * f64::from(settings.frame_dt);
        for (offset, jitter) in [0.0, farthest].iter().flat_map(|&offset| {
            let layers = self.jitter.chunks(self.sites.len());
            layers.map(move |jitter| (offset, jitter))
        }) {
            let layer = self.layer(offset, jitter);
            if let Some(outside) = layer.iter().find(|x| !settings.walls.contain(x)) {
                let allowed = "an opening whose material stays inside the walls in its first frame";
                return refuse("sites", allowed, &outside.as_slice());
            }
        }
        Ok(())
    }

    /// The particles of a layer that has moved on by `offset` [m].
    fn layer(&self, offset: f64, jitter: &[Vector<D>]) -> Vec<Vector<D>> {
        let way = self.velocity * (offset / f64::from(self.velocity.norm())) as f32;
        let moved = self.sites.iter().zip(jitter);
        moved.map(|(site, jitter)| site + way + jitter).collect()
    }

    /// Offsets from the sites of the layer with this number.
    fn jitter_of(&self, layer: u64) -> &[Vector<D>] {
        let n = self.sites.len();
        let turns = (self.jitter.len() / n) as u64;
        &self.jitter[(layer % turns) as usize * n..][..n]
    }
}

/// Lets sinks and emitters act at the end of the frame that `state` has just finished.
pub(crate) fn exchange<const D: usize>(
    state: &mut SolverState<D>,
    settings: &Settings<D>,
    obstacles: &Obstacles<D>,
) {
    if !settings.sinks.is_empty() {
        drain(state, &settings.sinks);
    }
    for index in 0..settings.emitters.len() {
        emit(state, settings, index, obstacles);
    }
}

/// Removes the particles inside sinks; the others keep their order.
fn drain<const D: usize>(state: &mut SolverState<D>, sinks: &[Shape<D>]) {
    let population = &mut state.population;
    let mut kept = vec![true; population.ids.len()];
    for phase in &state.phases {
        with_group!(phase, group => for p in group.particles() {
            if sinks.iter().any(|sink| sink.distance(&p.x).0 < 0.0) {
                kept[p.id as usize] = false;
                population.removed_mass += f64::from(p.mass);
            }
        });
    }
    if kept.iter().all(|&kept| kept) {
        return;
    }
    let places: Vec<u32> = kept
        .iter()
        .scan(0, |next, &kept| {
            let place = *next;
            *next += u32::from(kept);
            Some(place)
        })
        .collect();
    for phase in &mut state.phases {
        with_group!(phase, group => {
            let staying: Vec<_> = group
                .particles()
                .filter(|p| kept[p.id as usize])
                .map(|p| Particle { id: places[p.id as usize], ..p })
                .collect();
            group.replace(&staying);
        });
    }
    let mut kept = kept.iter();
    population
        .ids
        .retain(|_| *kept.next().expect("one flag a particle"));
}

/// Adds the layers that have become due.
fn emit<const D: usize>(
    state: &mut SolverState<D>,
    settings: &Settings<D>,
    index: usize,
    obstacles: &Obstacles<D>,
) {
    let emitter = &settings.emitters[index];
    let mut flow = state.population.flows[index];
    let frame_dt = f64::from(settings.frame_dt);
    let (begin, end) = (
        (state.frame - 1) as f64 * frame_dt,
        state.frame as f64 * frame_dt,
    );
    let last = end.min(emitter.stop);
    let speed = f64::from(emitter.velocity.norm());
    flow.travelled += speed * (last - begin.max(emitter.start)).max(0.0);
    flow.status = if end <= emitter.start {
        EmitterStatus::Waiting
    } else if begin >= emitter.stop {
        EmitterStatus::Ended
    } else {
        EmitterStatus::Running
    };
    let (spacing, mut added) = (f64::from(emitter.spacing), Vec::new());
    while flow.status == EmitterStatus::Running && flow.travelled >= spacing {
        let offset = flow.travelled - spacing + speed * (end - last);
        let layer = emitter.layer(offset, emitter.jitter_of(flow.layers));
        let count = state.population.ids.len() + added.len() + layer.len();
        let full = count > settings.max_particles;
        if full || is_blocked(state, emitter, offset, &layer, obstacles) {
            flow.status = if full {
                EmitterStatus::Full
            } else {
                EmitterStatus::Blocked
            };
            // What could not leave is not made up for; the next layer may leave at once.
            flow.travelled = spacing;
            break;
        }
        added.extend(layer);
        flow.layers += 1;
        flow.travelled -= spacing;
    }
    state.population.flows[index] = flow;
    if !added.is_empty() {
        add(state, emitter, &added);
    }
}

/// Whether a layer would get into an obstacle, or into material that is already there.
fn is_blocked<const D: usize>(
    state: &SolverState<D>,
    emitter: &Emitter<D>,
    offset: f64,
    layer: &[Vector<D>],
    obstacles: &Obstacles<D>,
) -> bool {
    if layer.iter().any(|x| obstacles.hold(x)) {
        return true;
    }
    // Of the even layer: with jitter the one before may come as near as half a spacing.
    let even = emitter.layer(offset, &vec![Vector::zeros(); layer.len()]);
    let reach = 0.5 * emitter.spacing;
    let lower = even
        .iter()
        .fold(even[0], |low, x| low.inf(x))
        .add_scalar(-reach);
    let upper = even
        .iter()
        .fold(even[0], |high, x| high.sup(x))
        .add_scalar(reach);
    let most = CROWDED * layer.len() as f32;
    let mut found = 0.0;
    for phase in &state.phases {
        with_group!(phase, group => for p in group.particles() {
            let close = |site: &Vector<D>| (p.x - site).norm_squared() < reach * reach;
            let boxed = (0..D).all(|axis| p.x[axis] > lower[axis] && p.x[axis] < upper[axis]);
            if boxed && even.iter().any(close) {
                found += 1.0;
                if found > most {
                    return true;
                }
            }
        });
    }
    false
}

/// Appends particles at rest density that move with the emitter's velocity.
fn add<const D: usize>(state: &mut SolverState<D>, emitter: &Emitter<D>, x: &[Vector<D>]) {
    let population = &mut state.population;
    let first = population.ids.len() as u32;
    population
        .ids
        .extend(population.next_id..population.next_id + x.len() as u64);
    population.next_id += x.len() as u64;
    population.emitted_mass += x.len() as f64 * f64::from(emitter.mass);
    state.max_speed = state.max_speed.max(emitter.velocity.norm());
    with_group!(&mut state.phases[usize::from(emitter.material)], group => append(group, emitter, x, first));
}

fn append<const D: usize, M: Constitutive<D>>(
    group: &mut Group<D, M>,
    emitter: &Emitter<D>,
    x: &[Vector<D>],
    first: u32,
) {
    let mut particles: Vec<_> = group.particles().collect();
    particles.extend(x.iter().zip(first..).map(|(&x, id)| Particle {
        x,
        v: emitter.velocity,
        affine: Matrix::zeros(),
        mass: emitter.mass,
        volume: emitter.volume,
        id,
        state: group.material.initial_state(1.0),
    }));
    group.replace(&particles);
}
