//! Who the particles of a scene are, and how many came and went.

use super::emitter::EmitterStatus;

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
