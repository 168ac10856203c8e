//! Bodies and fixed solids, and the step.

use crate::body::Body;
use crate::geometry::Geometry;
use crate::narrow::Solid;
use crate::pose::{Placed, Rotation, Vector3, turned};
use crate::state::{Moving, Rates, State};

/// Contacts that give more than this multiple of gravity are impacts.
const MOST_SUPPORT: f64 = 4.0;

/// Where a fixed solid is, and its prescribed motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fixed {
    pub placed: Placed,
    /// Velocity of the point `center` [m/s], and angular velocity about it [rad/s].
    pub v: Vector3,
    pub w: Vector3,
    pub center: Vector3,
}

impl Fixed {
    /// A solid at rest.
    pub fn resting(x: Vector3, turn: Rotation) -> Self {
        Self {
            placed: Placed { x, turn },
            v: Vector3::zeros(),
            w: Vector3::zeros(),
            center: x,
        }
    }
}

/// An impulse on a body from outside, and its moment about the centre of mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Push {
    /// [kg m/s]
    pub impulse: Vector3,
    /// [kg m^2/s]
    pub moment: Vector3,
}

impl Push {
    pub const NONE: Self = Self {
        impulse: Vector3::new(0.0, 0.0, 0.0),
        moment: Vector3::new(0.0, 0.0, 0.0),
    };
}

/// A fixed solid.
#[derive(Debug, Clone)]
pub(crate) struct FixedSolid {
    pub solid: Solid,
    pub reach: f64,
}

/// What does not change of a scene.
#[derive(Debug, Clone)]
pub struct World<const D: usize> {
    pub bodies: Vec<Body>,
    pub(crate) fixed: Vec<FixedSolid>,
    /// Of each body: the largest distance from its centre of mass, and the length of its smallest features [m].
    pub(crate) reaches: Vec<f64>,
    pub(crate) sizes: Vec<f64>,
}

impl<const D: usize> World<D> {
    pub fn new(bodies: Vec<Body>, fixed: &[Geometry]) -> Self {
        Self {
            reaches: bodies.iter().map(|body| body.geometry.reach()).collect(),
            sizes: (bodies.iter())
                .map(|body| body.geometry.size::<D>())
                .collect(),
            fixed: (fixed.iter())
                .map(|geometry| FixedSolid {
                    solid: Solid::new::<D>(geometry),
                    reach: geometry.reach(),
                })
                .collect(),
            bodies,
        }
    }

    /// Largest distance of a point of a body from its centre of mass [m].
    pub fn reach(&self, body: usize) -> f64 {
        self.reaches[body]
    }

    /// Advances all bodies by `dt` [s]. `fixed` is where the fixed solids are now, `pushes` what acts besides gravity [m/s^2] on each
    /// body.
    pub fn step(
        &self,
        state: &mut State,
        fixed: &[Fixed],
        gravity: &Vector3,
        pushes: &[Push],
        dt: f64,
    ) {
        for ((body, moving), push) in self.bodies.iter().zip(&mut state.bodies).zip(pushes) {
            let inverse = body.mass.inverse_inertia(&moving.placed.turn);
            moving.v += gravity * dt + push.impulse / body.mass.mass;
            moving.w += inverse * push.moment;
        }
        let contacts = self.contacts(state, fixed, dt);
        let free: Vec<Rates> = (state.bodies.iter())
            .map(|moving| Rates {
                v: moving.v,
                w: moving.w,
            })
            .collect();
        self.solve(state, &contacts, gravity, dt);
        for ((body, moving), free) in self.bodies.iter().zip(&mut state.bodies).zip(free) {
            let (v, w) = (moving.v - free.v, moving.w - free.w);
            let is_impact = v.norm() > MOST_SUPPORT * gravity.norm() * dt;
            moving.support = if is_impact {
                Rates::NONE
            } else {
                Rates {
                    v: v / dt,
                    w: w / dt,
                }
            };
            drift(body, moving, dt);
        }
        self.mend(state, &contacts);
    }

    /// Kinetic energy of all bodies [J].
    pub fn kinetic_energy(&self, state: &State) -> f64 {
        let all = self.bodies.iter().zip(&state.bodies);
        all.map(|(body, moving)| body.kinetic_energy(&moving.placed, &moving.v, &moving.w))
            .sum()
    }
}

/// Moves a body on with its velocities. Without torque the angular momentum stays.
fn drift(body: &Body, moving: &mut Moving, dt: f64) {
    let turn = moving.placed.turn;
    moving.placed.x += moving.v * dt;
    if body.mass.is_round() {
        moving.placed.turn = turned(&turn, &(moving.w * dt));
        return;
    }
    let momentum = body.mass.inertia(&turn) * moving.w;
    // The angular velocity half a step on turns the body through the whole one.
    let half = turned(&turn, &(moving.w * (0.5 * dt)));
    let middle = body.mass.inverse_inertia(&half) * momentum;
    moving.placed.turn = turned(&turn, &(middle * dt));
    moving.w = body.mass.inverse_inertia(&moving.placed.turn) * momentum;
}
