//! One particle and its activity.

use crate::linalg::{Matrix, Vector};

/// One material point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle<const D: usize, S> {
    /// Position [m].
    pub x: Vector<D>,
    /// Velocity [m/s].
    pub v: Vector<D>,
    /// APIC matrix C [1/s].
    pub affine: Matrix<D>,
    /// Mass [kg].
    pub mass: f32,
    /// Rest volume [m^D].
    pub volume: f32,
    /// Index in the caller's order.
    pub id: u32,
    /// Frames at rest [-]; counted where regions may sleep.
    pub calm: f32,
    pub activity: Activity,
    pub state: S,
}

/// Activity of a particle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Activity {
    #[default]
    Awake,
    /// Asleep, but near to awake particles, which its mass and stress on the grid support.
    Border,
    Asleep,
}
