//! The rigid bodies of a scene, between the material and each other.
//!
//! Towards the material a body is an obstacle. In an explicit step the material would take on the velocity that the body has,
//! and the body would follow later: a body lighter than the material that moves along with it would overshoot. So the velocity
//! that body and material have in common after the substep is found first, from the lines that touch (a linear system of six
//! unknowns a body), and the body's surface moves with it. What the material then receives is taken from the body, to the bit.

use std::sync::Arc;

use nalgebra::{Matrix6, Vector6};
use rigid::{Fixed, Geometry, Matrix3, Placed, Push, Rotation, State, Vector3, World};

use super::body::{RigidBody, solid_of};
use super::convert::{double, pose_of, single, spin_matrix};
use super::pull::Pull;
use crate::boundary::{Motion, Obstacle, Pose, Probe, Reactions, Shape, Walls, Wrench};
use crate::error::MpmError;
use crate::linalg::Vector;

/// Sweeps to find out which lines touch.
const SWEEPS: usize = 4;

/// Largest overlap at the start, as a part of the smaller body's size.
const MOST_OVERLAP: f64 = 0.01;

/// The rigid bodies of a scene, and what they can touch besides each other.
#[derive(Debug, Clone)]
pub struct Bodies<const D: usize> {
    world: Arc<World<D>>,
    /// Walls, then obstacles: where each is at time 0, and its motion.
    fixed: Vec<(Placed, Option<Motion<D>>)>,
    gravity: Vector3,
}

impl<const D: usize> Bodies<D> {
    /// None in a scene without rigid bodies.
    pub fn new(
        list: &[RigidBody<D>],
        walls: &Walls<D>,
        obstacles: &[Obstacle<D>],
        gravity: &Vector<D>,
    ) -> Option<Self> {
        if list.is_empty() {
            return None;
        }
        let (mut solids, mut fixed) = (Vec::new(), Vec::new());
        for axis in 0..D {
            for (place, inward) in [(walls.lower[axis], 1.0), (walls.upper[axis], -1.0)] {
                let (mut normal, mut x) = (Vector3::zeros(), Vector3::zeros());
                (normal[axis], x[axis]) = (inward, f64::from(place));
                solids.push(Geometry::HalfSpace { normal });
                let turn = Rotation::identity();
                fixed.push((Placed { x, turn }, None));
            }
        }
        for obstacle in obstacles {
            let (solid, placed) = solid_of(&obstacle.shape);
            solids.push(solid);
            fixed.push((placed, obstacle.motion));
        }
        let bodies = list.iter().map(RigidBody::body).collect();
        Some(Self {
            world: Arc::new(World::new(bodies, &solids)),
            fixed,
            gravity: double(gravity),
        })
    }

    /// Refuses bodies that overlap each other, walls or obstacles by more than a little.
    pub fn check(&self, state: &State) -> Result<(), MpmError> {
        let fixed = self.fixed_at(0.0);
        let count = state.bodies.len();
        let name = |solid: usize| {
            if solid < count {
                format!("rigid[{solid}]")
            } else if solid < count + 2 * D {
                "a wall".to_owned()
            } else {
                format!("obstacles[{}]", solid - count - 2 * D)
            }
        };
        match self.world.overlap(state, &fixed) {
            Some((solids, share)) if share > MOST_OVERLAP => {
                let [part, other] = solids.map(name);
                let problem = format!(
                    "overlaps {other}: their overlap must be at most {MOST_OVERLAP} of the smaller body's size, \
                     got {share:.2}; move one of them"
                );
                Err(MpmError::Overlap { part, problem })
            }
            _ => Ok(()),
        }
    }

    /// Where walls and obstacles are at a time [s].
    fn fixed_at(&self, time: f64) -> Vec<Fixed> {
        let all = self.fixed.iter();
        all.map(|(placed, motion)| fixed_at(placed, motion.as_ref(), time))
            .collect()
    }

    /// Shapes and poses of bodies at the start.
    pub fn placed(list: &[RigidBody<D>]) -> Vec<(Shape<D>, Pose<D>)> {
        let one = |body: &RigidBody<D>| (body.own_shape(), pose_of(&body.moving(), 0.0));
        list.iter().map(one).collect()
    }

    /// Where bodies are after `dt` [s] with the velocities that they have.
    pub fn poses(state: &State, dt: f32) -> impl Iterator<Item = Pose<D>> + '_ {
        state.bodies.iter().map(move |moving| pose_of(moving, dt))
    }

    /// What hands that pull give to bodies in `dt` [s], each with the number of its body.
    pub fn pulled(&self, state: &State, pulls: &[Pull<D>], dt: f32) -> Vec<(usize, Push)> {
        let dt = f64::from(dt);
        let one = |pull: &Pull<D>| {
            let number = pull.body;
            let push = pull.push(&self.world.bodies[number], &state.bodies[number], dt);
            (number, push)
        };
        pulls.iter().map(one).collect()
    }

    /// The poses with the velocities that bodies and material will have in common after a substep of length `dt` [s].
    pub fn meet(
        &self,
        state: &State,
        poses: &[Pose<D>],
        first_body: usize,
        reactions: &[Reactions<D>],
        pulled: &[(usize, Push)],
        dt: f32,
    ) -> Vec<Pose<D>> {
        let mut probes: Vec<Vec<&Probe<D>>> = vec![Vec::new(); poses.len()];
        for probe in reactions.iter().flat_map(|part| &part.probes) {
            probes[probe.body as usize - first_body].push(probe);
        }
        let dt = f64::from(dt);
        let each = self
            .world
            .bodies
            .iter()
            .zip(&state.bodies)
            .zip(poses)
            .zip(probes)
            .enumerate();
        each.map(|(number, (((body, moving), pose), probes))| {
            let inertia = body.mass.inertia(&moving.placed.turn);
            let own = inertia_matrix(body.mass.mass, &inertia);
            let mut v = moving.v + (self.gravity + moving.support.v) * dt;
            let mut w = moving.w + moving.support.w * dt;
            for (_, push) in pulled.iter().filter(|(body, _)| *body == number) {
                v += push.impulse / body.mass.mass;
                w += body.mass.inverse_inertia(&moving.placed.turn) * push.moment;
            }
            let (v, w) = common_velocity::<D>(&own, [v, w], &double(&pose.center()), &probes);
            pose.moving(single(&v), spin_matrix(&w))
        })
        .collect()
    }

    /// Ends a substep: gives the bodies what they gave to the material, and moves them on. `time` is that of its end [s].
    pub fn step(
        &self,
        state: &mut State,
        poses: &[Pose<D>],
        reactions: &[Reactions<D>],
        pulled: &[(usize, Push)],
        time: f64,
        dt: f32,
    ) {
        let fixed = self.fixed_at(time);
        let mut pushes = Vec::with_capacity(poses.len());
        for (number, pose) in poses.iter().enumerate() {
            let mut sum = Wrench::<D>::NONE;
            for part in reactions {
                sum.join(&part.bodies[number]);
            }
            let impulse =
                -Vector3::from_fn(|axis, _| if axis < D { sum.impulse[axis] } else { 0.0 });
            let moment = -Vector3::from(sum.moment);
            pushes.push(Push {
                impulse,
                moment: moment - double(&pose.center()).cross(&impulse),
            });
        }
        for (number, push) in pulled {
            pushes[*number].impulse += push.impulse;
            pushes[*number].moment += push.moment;
        }
        self.world
            .step(state, &fixed, &self.gravity, &pushes, f64::from(dt));
    }

    /// Kinetic and potential energy [J].
    pub fn energy(&self, state: &State) -> [f64; 2] {
        let all = self.world.bodies.iter().zip(&state.bodies);
        let potential: f64 = all
            .map(|(body, moving)| -body.mass.mass * self.gravity.dot(&moving.placed.x))
            .sum();
        [self.world.kinetic_energy(state), potential]
    }
}

/// The numbers of a body as others read them: centre of mass [m], unit quaternion of its turn with the scalar first, velocity [m/s]
/// and angular velocity [rad/s].
pub fn numbers_of(moving: &rigid::Moving) -> [f64; 13] {
    let (x, v, w) = (moving.placed.x, moving.v, moving.w);
    let turn = moving.placed.turn.quaternion();
    [
        x.x, x.y, x.z, turn.w, turn.i, turn.j, turn.k, v.x, v.y, v.z, w.x, w.y, w.z,
    ]
}

/// The state at the start.
pub fn start<const D: usize>(list: &[RigidBody<D>]) -> State {
    State {
        bodies: list.iter().map(RigidBody::moving).collect(),
        kept: Vec::new(),
    }
}

/// Where a fixed solid is at a time [s].
fn fixed_at<const D: usize>(start: &Placed, motion: Option<&Motion<D>>, time: f64) -> Fixed {
    let Some(motion) = motion else {
        return Fixed::resting(start.x, start.turn);
    };
    let pose = motion.pose(time);
    let mut matrix = Matrix3::identity();
    let (v, spin) = pose.rates();
    let mut w = Vector3::zeros();
    for row in 0..D {
        for column in 0..D {
            matrix[(row, column)] = f64::from(pose.rotation()[(row, column)]);
        }
    }
    w.z = f64::from(spin[(1, 0)]);
    if D == 3 {
        w.x = f64::from(spin[(2, 1)]);
        w.y = f64::from(spin[(0, 2)]);
    }
    let turn = rigid::turn_of_matrix(&matrix);
    let center = double(&pose.center());
    Fixed {
        placed: Placed {
            x: center + turn * (start.x - double(&motion.center())),
            turn: turn * start.turn,
        },
        v: double(v),
        w,
        center,
    }
}

/// Mass and inertia of the six motions of a body.
fn inertia_matrix(mass: f64, inertia: &Matrix3) -> Matrix6<f64> {
    let mut own = Matrix6::zeros();
    for axis in 0..3 {
        own[(axis, axis)] = mass;
    }
    own.fixed_view_mut::<3, 3>(3, 3).copy_from(inertia);
    own
}

/// Finds the velocity and angular velocity of a body and of the material that it pushes or that pushes it, as after an inelastic
/// impact: only lines at which they come nearer act, with Coulomb friction.
fn common_velocity<const D: usize>(
    own: &Matrix6<f64>,
    free: [Vector3; 2],
    center: &Vector3,
    probes: &[&Probe<D>],
) -> (Vector3, Vector3) {
    let mut own = *own;
    if D == 2 {
        // Motions out of the plane have no inertia and do not occur.
        for axis in [2, 3, 4] {
            own[(axis, axis)] = 1.0;
        }
    }
    let six = |v: &Vector3, w: &Vector3| Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z);
    let momentum = own * six(&free[0], &free[1]);
    let [mut v, mut w] = free;
    for _ in 0..SWEEPS {
        let (mut matrix, mut right) = (own, momentum);
        for probe in probes {
            let arm = double(&probe.x) - center;
            let (normal, u) = (double(&probe.normal), double(&probe.u));
            let mass = f64::from(probe.mass);
            let mut constrain = |axis: &Vector3, wanted: f64| {
                let row = six(axis, &arm.cross(axis));
                matrix += row * row.transpose() * mass;
                right += row * (mass * wanted);
            };
            let relative = v + w.cross(&arm) - u;
            let approach = relative.dot(&normal) - f64::from(probe.closing);
            if approach <= 0.0 {
                continue;
            }
            constrain(&normal, u.dot(&normal) + f64::from(probe.closing));
            let slip = relative - normal * relative.dot(&normal);
            if probe.friction > 0.0 && slip.norm() <= f64::from(probe.friction) * approach {
                let [one, other] = rigid::across::<D>(&normal);
                constrain(&one, u.dot(&one));
                if D == 3 {
                    constrain(&other, u.dot(&other));
                }
            }
        }
        let Some(factors) = matrix.cholesky() else {
            break;
        };
        let solved = factors.solve(&right);
        v = Vector3::new(solved[0], solved[1], solved[2]);
        w = Vector3::new(solved[3], solved[4], solved[5]);
    }
    (v, w)
}
