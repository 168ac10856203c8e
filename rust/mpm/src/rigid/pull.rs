//! A hand that pulls at a rigid body.

use rigid::{Body, Moving, Push};

use super::convert::double;
use crate::error::MpmError;
use crate::linalg::Vector;

/// Time in which what is pulled goes its reach at most, and comes to rest at least [s]: very light bodies would be thrown about
/// otherwise.
const LAG: f64 = 1.0 / 60.0;

/// A force that draws a point of a body to a target: a spring whose force is bounded, and a damper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pull<const D: usize> {
    /// Number of the body in the scene.
    pub body: usize,
    /// The point that is held, from the centre of mass, in the body's own frame [m].
    pub grip: Vector<D>,
    /// Where it is drawn to [m].
    pub target: Vector<D>,
    /// Distance from the target at which a spring at rest gives the largest force [m].
    pub reach: f32,
    /// Largest force [N], in 2D per metre of depth.
    pub strength: f32,
}

impl<const D: usize> Pull<D> {
    /// Refuses values out of range, in a scene of `count` bodies.
    pub(crate) fn check(&self, count: usize) -> Result<(), MpmError> {
        if self.body >= count {
            let allowed = "the number of a rigid body of the scene";
            return Err(MpmError::parameter("body", allowed, self.body));
        }
        for (name, point) in [("grip", &self.grip), ("target", &self.target)] {
            if !point.iter().all(|x| x.is_finite()) {
                return Err(MpmError::parameter(name, "finite", point.as_slice()));
            }
        }
        for (name, value) in [("reach", self.reach), ("strength", self.strength)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(MpmError::parameter(name, "finite and > 0", value));
            }
        }
        Ok(())
    }

    /// What the body gets in `dt` [s].
    pub(super) fn push(&self, body: &Body, moving: &Moving, dt: f64) -> Push {
        let (strength, reach) = (f64::from(self.strength), f64::from(self.reach));
        let arm = moving.placed.turn * double(&self.grip);
        let held = moving.placed.x + arm;
        let way = double(&self.target) - held;
        let stiffness = strength / reach;
        let critical = 2.0 * (stiffness * body.mass.mass).sqrt();
        let damping = critical.max(stiffness * LAG);
        // What is far off draws with the force that keeps up this speed.
        let fastest = reach / LAG;
        let spring = way * stiffness.min(damping * fastest / way.norm());
        let inverse = body.mass.inverse_inertia(&moving.placed.turn);
        // The damper acts on the velocity after the step, so that it stops the lightest body and does not turn it back.
        let mobility = 1.0 / body.mass.mass + arm.norm_squared() * inverse.norm();
        let force =
            (spring - moving.velocity_at(&held) * damping) / (1.0 + damping * mobility * dt);
        let impulse = force * (dt * (strength / force.norm()).min(1.0));
        Push {
            impulse,
            moment: arm.cross(&impulse),
        }
    }
}
