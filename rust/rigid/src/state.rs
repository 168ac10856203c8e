//! What a step changes.

use crate::pose::{Placed, Vector3};

/// A velocity and an angular velocity, or the rates of both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rates {
    pub v: Vector3,
    pub w: Vector3,
}

impl Rates {
    pub const NONE: Self = Self {
        v: Vector3::new(0.0, 0.0, 0.0),
        w: Vector3::new(0.0, 0.0, 0.0),
    };
}

/// Where a body is and how it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moving {
    /// Its centre of mass and orientation.
    pub placed: Placed,
    /// Velocity of the centre of mass [m/s].
    pub v: Vector3,
    /// Angular velocity [rad/s].
    pub w: Vector3,
    /// What contacts gave it in the last step, unless that was an impact [m/s^2, rad/s^2].
    pub support: Rates,
}

impl Moving {
    /// Velocity of the body at a point [m/s].
    pub fn velocity_at(&self, x: &Vector3) -> Vector3 {
        self.v + self.w.cross(&(x - self.placed.x))
    }
}

/// The impulses at a point of contact, from which the next step starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kept {
    /// The two solids and their features that touch.
    pub key: [u32; 4],
    /// Along the normal, and the two directions across it [kg m/s].
    pub impulse: [f64; 3],
}

/// Everything that a step starts from.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct State {
    pub bodies: Vec<Moving>,
    /// By ascending keys.
    pub kept: Vec<Kept>,
}
