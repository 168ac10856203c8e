//! Emitters, which add particles between frames, and sinks, which take them away.
//!
//! Both act on the state at the end of a frame and on its number alone, so they depend neither on threads nor
//! on how a run is cut into calls.

use super::emitter::{Emitter, EmitterStatus};
use crate::boundary::{Obstacles, Shape};
use crate::linalg::{Matrix, Vector};
use crate::material::Constitutive;
use crate::particles::{Activity, Group, Particle};
use crate::settings::Settings;
use crate::solver::SolverState;
use crate::with_group;

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

/// Lets sinks and emitters act at the end of the frame that `state` has just finished.
pub(crate) fn exchange<const D: usize>(
    state: &mut SolverState<D>,
    settings: &Settings<D>,
    obstacles: &Obstacles<D>,
) {
    if !settings.sinks.is_empty() {
        drain(
            state,
            &settings.sinks,
            WOKEN_CELLS / settings.resolution as f32,
        );
    }
    for index in 0..settings.emitters.len() {
        emit(state, settings, index, obstacles);
    }
}

/// Cells around a sink in which sleepers wake when it takes something.
const WOKEN_CELLS: f32 = 8.0;

/// Removes the particles inside sinks; the others keep their order.
fn drain<const D: usize>(state: &mut SolverState<D>, sinks: &[Shape<D>], reach: f32) {
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
    let near = |x: &Vector<D>| sinks.iter().any(|sink| sink.distance(x).0 < reach);
    for phase in &mut state.phases {
        with_group!(phase, group => {
            let staying: Vec<_> = group
                .particles()
                .filter(|p| kept[p.id as usize])
                .map(|p| Particle {
                    id: places[p.id as usize],
                    // What stood on the particles that are gone has to notice.
                    calm: if near(&p.x) { 0.0 } else { p.calm },
                    ..p
                })
                .collect();
            group.clear();
            group.append(&staying);
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
    let state = group.material.initial_state(1.0);
    let particles: Vec<_> = (x.iter().zip(first..))
        .map(|(&x, id)| Particle {
            x,
            v: emitter.velocity,
            affine: Matrix::zeros(),
            mass: emitter.mass,
            volume: emitter.volume,
            id,
            calm: 0.0,
            activity: Activity::Awake,
            state,
        })
        .collect();
    group.append(&particles);
}
