//! The state of a solver between two frames.

use crate::openings::Population;
use crate::particles::MaterialGroup;

/// State of a solver, complete for a snapshot.
#[derive(Clone)]
pub(crate) struct SolverState<const D: usize> {
    pub groups: Vec<MaterialGroup<D>>,
    /// Frames done.
    pub frame: u64,
    /// Largest speed of a particle [m/s].
    pub max_speed: f32,
    pub population: Population,
    /// The rigid bodies.
    pub rigid: rigid::State,
}
