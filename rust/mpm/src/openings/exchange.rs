//! Emitters, which add particles between frames, and sinks, which take them away.
//!
//! Both act on the state at the end of a frame and on its number alone, so they depend neither on threads nor
//! on how a run is cut into calls.

use super::emitter::{Emitter, EmitterStatus};
use super::population::Population;
use crate::boundary::{Obstacles, Shape};
use crate::linalg::{Matrix, Vector};
use crate::material::Constitutive;
use crate::particles::{Activity, Group, MaterialGroup, Particle, with_group};

/// Where material enters and leaves a scene.
#[derive(Debug, Clone)]
pub struct Openings<const D: usize> {
    /// They act at the end of each frame, after the sinks.
    pub emitters: Vec<Emitter<D>>,
    /// Particles that end a frame inside of one are removed.
    pub sinks: Vec<Shape<D>>,
    /// Emitters add no particles beyond this number.
    pub max_particles: usize,
}

impl<const D: usize> Openings<D> {
    /// A scene whose particles stay the same ones.
    pub const NONE: Self = Self {
        emitters: Vec::new(),
        sinks: Vec::new(),
        max_particles: usize::MAX,
    };

    /// Whether the number of particles may change.
    pub fn any(&self) -> bool {
        !(self.emitters.is_empty() && self.sinks.is_empty())
    }
}

/// A scene at the end of a frame, for sinks and emitters to act on.
pub(crate) struct FrameEnd<'a, const D: usize> {
    pub groups: &'a mut [MaterialGroup<D>],
    pub population: &'a mut Population,
    /// Largest speed of the particles [m/s].
    pub max_speed: &'a mut f32,
    /// Frames done, this one among them.
    pub frame: u64,
    /// Length of a frame [s].
    pub frame_dt: f32,
    /// Cells along each axis of the box.
    pub resolution: usize,
    pub obstacles: &'a Obstacles<D>,
}

/// An opening that is this full of other material lets nothing out.
const CROWDED: f32 = 0.25;
/// Cells around a sink in which sleepers wake when it takes something.
const WOKEN_CELLS: f32 = 8.0;

impl<const D: usize> FrameEnd<'_, D> {
    /// Lets sinks and then emitters act.
    pub fn exchange(&mut self, openings: &Openings<D>) {
        if !openings.sinks.is_empty() {
            self.drain(&openings.sinks);
        }
        for index in 0..openings.emitters.len() {
            self.emit(index, openings);
        }
    }

    /// Removes the particles inside sinks; the others keep their order.
    fn drain(&mut self, sinks: &[Shape<D>]) {
        let population = &mut *self.population;
        let mut kept = vec![true; population.ids.len()];
        for group in &*self.groups {
            with_group!(group, group => for p in group.particles() {
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
        let reach = WOKEN_CELLS / self.resolution as f32;
        let near = |x: &Vector<D>| sinks.iter().any(|sink| sink.distance(x).0 < reach);
        for group in &mut *self.groups {
            with_group!(group, group => {
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

    /// Adds the layers of an emitter that have become due.
    fn emit(&mut self, index: usize, openings: &Openings<D>) {
        let emitter = &openings.emitters[index];
        let mut flow = self.population.flows[index];
        let frame_dt = f64::from(self.frame_dt);
        let (begin, end) = (
            (self.frame - 1) as f64 * frame_dt,
            self.frame as f64 * frame_dt,
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
            let count = self.population.ids.len() + added.len() + layer.len();
            let full = count > openings.max_particles;
            if full || self.is_blocked(emitter, offset, &layer) {
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
        self.population.flows[index] = flow;
        if !added.is_empty() {
            self.add(emitter, &added);
        }
    }

    /// Whether a layer would get into an obstacle, or into material that is already there.
    fn is_blocked(&self, emitter: &Emitter<D>, offset: f64, layer: &[Vector<D>]) -> bool {
        if layer.iter().any(|x| self.obstacles.contains(x)) {
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
        for group in &*self.groups {
            with_group!(group, group => for p in group.particles() {
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
    fn add(&mut self, emitter: &Emitter<D>, x: &[Vector<D>]) {
        let population = &mut *self.population;
        let first = population.ids.len() as u32;
        population
            .ids
            .extend(population.next_id..population.next_id + x.len() as u64);
        population.next_id += x.len() as u64;
        population.emitted_mass += x.len() as f64 * f64::from(emitter.mass);
        *self.max_speed = self.max_speed.max(emitter.velocity.norm());
        let group = &mut self.groups[usize::from(emitter.material)];
        with_group!(group, group => append(group, emitter, x, first));
    }
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
