//! Emitters, which add particles between frames, and sinks, which take them away.
//!
//! Both act on the state at the end of a frame and on its number alone, so they depend neither on threads nor
//! on how a run is cut into calls.

use super::emitter::Emitter;
use super::opening::{Crowd, Opening};
use super::population::Population;
use crate::boundary::{Obstacles, Shape};
use crate::linalg::{Matrix, Vector};
use crate::material::Constitutive;
use crate::particles::{Activity, EMITTED, Group, MaterialGroup, Particle, with_group};
use serde::{Deserialize, Serialize};

/// Where material enters and leaves a scene.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Openings<const D: usize> {
    /// They act at the end of each frame, after the sinks.
    pub emitters: Vec<Emitter<D>>,
    /// Particles that end a frame inside of one are removed.
    pub sinks: Vec<Shape<D>>,
    /// Emitters add no particles beyond this number.
    pub max_particles: usize,
}

impl<const D: usize> Openings<D> {
    /// A scene without emitters and sinks.
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
    /// Cells per metre.
    pub resolution: usize,
    pub obstacles: &'a Obstacles<D>,
}

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
                        // Particles that rested on the removed ones must wake.
                        calm: if near(&p.x) { 0.0 } else { p.calm },
                        ..p
                    })
                    .collect();
                group.clear();
                group.append(&staying);
            });
        }
        population.keep(&kept);
    }

    /// Adds the layers of an emitter that have become due.
    fn emit(&mut self, index: usize, openings: &Openings<D>) {
        let emitter = &openings.emitters[index];
        let mut flow = self.population.flows[index];
        let opening = Opening {
            emitter,
            frame: self.frame,
            frame_dt: self.frame_dt,
            room: openings
                .max_particles
                .saturating_sub(self.population.ids.len()),
        };
        let added = opening.let_out(&mut flow, |offset, layer| {
            let mut crowd = Crowd::around(emitter, offset, layer.len());
            layer.iter().any(|x| self.obstacles.contains(x))
                || self.groups.iter().any(|group| {
                    with_group!(group, group => group.particles().any(|p| crowd.is_full_with(&p.x)))
                })
        });
        self.population.flows[index] = flow;
        if !added.is_empty() {
            self.add(index, emitter, &added);
        }
    }

    /// Appends particles at rest density that move with the emitter's velocity.
    fn add(&mut self, index: usize, emitter: &Emitter<D>, x: &[Vector<D>]) {
        let first = self.population.ids.len() as u32;
        self.population.add(x.len(), emitter.mass);
        *self.max_speed = self.max_speed.max(emitter.velocity.norm());
        let takes = |group: &&mut MaterialGroup<D>| {
            let elastic = group.is_elastic();
            with_group!(&**group, group => {
                group.index == emitter.material && (!elastic || group.body == EMITTED + index as u32)
            })
        };
        let mut groups = self.groups.iter_mut();
        let group = groups.find(takes).expect("each emitter has a group");
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
