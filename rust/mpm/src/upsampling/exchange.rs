//! Emitters and sinks for shown particles.
//!
//! The rules and frames are those for coarse particles; emitted particles have the spacing of the scene.

use super::block::{Block, Shown, blocks, particles};
use super::surfaces::Surfaces;
use crate::openings::{Crowd, Opening, Openings, Population};

/// Shown particles at the end of a frame, for sinks and emitters to act on.
pub struct ShownEnd<'a, const D: usize> {
    pub blocks: &'a mut Vec<Block<D>>,
    pub population: &'a mut Population,
    pub surfaces: &'a Surfaces<D>,
    /// Frames done, including this one.
    pub frame: u64,
    /// Length of a frame [s].
    pub frame_dt: f32,
}

impl<const D: usize> ShownEnd<'_, D> {
    /// Lets sinks and then emitters act.
    pub fn exchange(&mut self, openings: &Openings<D>) {
        let mut all = particles(self.blocks, self.population.ids.len());
        let before = all.len();
        let drained = self.drain(&mut all, openings);
        for index in 0..openings.emitters.len() {
            self.emit(index, &mut all, openings);
        }
        if drained || all.len() != before {
            *self.blocks = blocks(&all);
        }
    }

    /// Removes the particles inside sinks; the others keep their order. Returns whether any was removed.
    fn drain(&mut self, all: &mut Vec<Shown<D>>, openings: &Openings<D>) -> bool {
        let inside = |p: &Shown<D>| {
            openings
                .sinks
                .iter()
                .any(|sink| sink.distance(&p.x).0 < 0.0)
        };
        let kept: Vec<bool> = all.iter().map(|p| !inside(p)).collect();
        let removed = all.iter().zip(&kept).filter(|(_, kept)| !**kept);
        self.population.removed_mass += removed.map(|(p, _)| f64::from(p.mass)).sum::<f64>();
        self.population.keep(&kept);
        let mut kept = kept.iter();
        let before = all.len();
        all.retain(|_| *kept.next().expect("one flag a particle"));
        all.len() < before
    }

    /// Adds the layers of an emitter that have become due.
    fn emit(&mut self, index: usize, all: &mut Vec<Shown<D>>, openings: &Openings<D>) {
        let emitter = &openings.emitters[index];
        let mut flow = self.population.flows[index];
        let opening = Opening {
            emitter,
            frame: self.frame,
            frame_dt: self.frame_dt,
            room: openings.max_particles.saturating_sub(all.len()),
        };
        let added = opening.let_out(&mut flow, |offset, layer| {
            let mut crowd = Crowd::around(emitter, offset, layer.len());
            layer.iter().any(|x| self.surfaces.obstacles.contains(x))
                || all.iter().any(|p| crowd.is_full_with(&p.x))
        });
        self.population.flows[index] = flow;
        self.population.add(added.len(), emitter.mass);
        all.extend(added.iter().map(|&x| Shown {
            x,
            v: emitter.velocity,
            mass: emitter.mass,
            volume: emitter.volume / self.surfaces.layout.dx().powi(D as i32),
            material: emitter.material,
        }));
    }
}
