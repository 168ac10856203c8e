//! The state of a solver between two frames.

use crate::openings::Population;
use crate::particles::Phase;

/// What a snapshot has to hold.
#[derive(Clone)]
pub(crate) struct SolverState<const D: usize> {
    pub phases: Vec<Phase<D>>,
    /// Frames done.
    pub frame: u64,
    /// Of all particles [m/s].
    pub max_speed: f32,
    pub population: Population,
}
