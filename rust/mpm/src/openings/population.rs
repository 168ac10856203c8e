//! Ids of the particles of a scene, and the mass added and removed.

use super::emitter::EmitterStatus;

/// How far an emitter has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Flow {
    /// How far the material has moved since it left room for the latest layer [m].
    pub travelled: f64,
    /// Layers that have left.
    pub layers: u64,
    pub status: EmitterStatus,
}

/// Ids of the particles, and the balance of those added and removed.
#[derive(Debug, Clone)]
pub(crate) struct Population {
    /// Number that each particle keeps for good, in the caller's order; ascending.
    pub ids: Vec<u64>,
    /// Number that the next particle gets.
    pub next_id: u64,
    /// Mass that emitters have added since frame 0 [kg].
    pub emitted_mass: f64,
    /// Mass that sinks have removed since frame 0 [kg].
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

    /// Numbers particles that an emitter adds; each has this mass [kg].
    pub fn add(&mut self, count: usize, mass: f32) {
        let end = self.next_id + count as u64;
        self.ids.extend(self.next_id..end);
        self.next_id = end;
        self.emitted_mass += count as f64 * f64::from(mass);
    }

    /// Forgets the particles that are not kept.
    pub fn keep(&mut self, kept: &[bool]) {
        let mut kept = kept.iter();
        self.ids
            .retain(|_| *kept.next().expect("one flag a particle"));
    }
}
