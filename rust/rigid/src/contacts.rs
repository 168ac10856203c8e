//! Contacts between bodies, and of bodies with fixed solids.

use crate::narrow::{Touch, touches};
use crate::pose::{Vector3, across};
use crate::state::State;
use crate::world::{Fixed, World};

/// Overlap that stays, as a part of the smaller solid: contacts neither flicker nor lose their normals.
const SLOP: f64 = 1.0e-4;

/// A point where two solids touch or are about to.
#[derive(Debug, Clone, Copy)]
pub struct Contact {
    /// Numbers of the solids; fixed ones follow the bodies.
    pub solids: [usize; 2],
    /// From the first to the second, and two directions across it.
    pub axes: [Vector3; 3],
    /// From the centres of mass to the point [m].
    pub arms: [Vector3; 2],
    /// Distance, negative where they overlap [m], and the overlap that stays.
    pub gap: f64,
    pub slop: f64,
    pub friction: f64,
    pub restitution: f64,
    /// Velocity of a fixed solid there [m/s].
    pub surface: Vector3,
    pub features: [u32; 2],
}

impl Contact {
    /// Names the contact in the next step.
    pub fn key(&self) -> [u32; 4] {
        let [a, b] = self.solids.map(|solid| solid as u32);
        [a, b, self.features[0], self.features[1]]
    }
}

impl<const D: usize> World<D> {
    /// The deepest overlap of two solids [m], as a part of the smaller body's size, with their numbers; those of fixed solids follow
    /// the bodies.
    pub fn overlap(&self, state: &State, fixed: &[Fixed]) -> Option<([usize; 2], f64)> {
        let contacts = self.contacts(state, fixed, 0.0);
        let share = |contact: &Contact| {
            let sizes = contact
                .solids
                .iter()
                .filter_map(|solid| self.sizes.get(*solid));
            -contact.gap / sizes.copied().fold(f64::INFINITY, f64::min)
        };
        let deepest = contacts.iter().max_by(|a, b| share(a).total_cmp(&share(b)));
        deepest.map(|contact| (contact.solids, share(contact)))
    }

    /// All points at which solids are nearer than they can move in a step [s], pair by pair.
    pub(crate) fn contacts(&self, state: &State, fixed: &[Fixed], dt: f64) -> Vec<Contact> {
        let mut contacts = Vec::new();
        let mut found = Vec::new();
        let count = self.bodies.len();
        let moving = state.bodies.iter().zip(&self.reaches);
        let speeds: Vec<f64> = moving
            .map(|(moving, reach)| moving.v.norm() + moving.w.norm() * reach + 1.0e-3)
            .collect();
        for first in 0..count {
            let (body, moving) = (&self.bodies[first], &state.bodies[first]);
            for second in first + 1..count {
                let other = &state.bodies[second];
                let slop = SLOP * self.sizes[first].min(self.sizes[second]);
                let near = 2.0 * dt * (speeds[first] + speeds[second]) + 2.0 * slop;
                let apart = self.reaches[first] + self.reaches[second] + near;
                if (other.placed.x - moving.placed.x).norm_squared() > apart * apart {
                    continue;
                }
                let theirs = &self.bodies[second];
                found.clear();
                let relative = moving.placed.relative(&other.placed);
                touches::<D>([&body.solid, &theirs.solid], &relative, near, &mut found);
                contacts.extend(found.iter().map(|touch: &Touch| {
                    let middle = moving.placed.apply(&((touch.on[0] + touch.on[1]) * 0.5));
                    Contact {
                        solids: [first, second],
                        axes: axes::<D>(&(moving.placed.turn * touch.normal)),
                        arms: [middle - moving.placed.x, middle - other.placed.x],
                        gap: touch.gap,
                        slop,
                        friction: 0.5 * (body.friction + theirs.friction),
                        restitution: 0.5 * (body.restitution + theirs.restitution),
                        surface: Vector3::zeros(),
                        features: touch.features,
                    }
                }));
            }
            for (number, (solid, fixed)) in self.fixed.iter().zip(fixed).enumerate() {
                let slop = SLOP * self.sizes[first];
                let distance = (moving.placed.x - fixed.placed.x).norm();
                let toward = fixed.v.norm() + fixed.w.norm() * (distance + self.reaches[first]);
                let near = 2.0 * dt * (speeds[first] + toward) + 2.0 * slop;
                let apart = self.reaches[first] + solid.reach + near;
                if distance > apart {
                    continue;
                }
                found.clear();
                let relative = fixed.placed.relative(&moving.placed);
                touches::<D>([&solid.solid, &body.solid], &relative, near, &mut found);
                contacts.extend(found.iter().map(|touch| {
                    let middle = fixed.placed.apply(&((touch.on[0] + touch.on[1]) * 0.5));
                    Contact {
                        solids: [first, count + number],
                        // The body comes first.
                        axes: axes::<D>(&-(fixed.placed.turn * touch.normal)),
                        arms: [middle - moving.placed.x, Vector3::zeros()],
                        gap: touch.gap,
                        slop,
                        friction: body.friction,
                        restitution: body.restitution,
                        surface: fixed.v + fixed.w.cross(&(middle - fixed.center)),
                        features: [touch.features[1], touch.features[0]],
                    }
                }));
            }
        }
        contacts
    }
}

/// A normal with two directions across it.
fn axes<const D: usize>(normal: &Vector3) -> [Vector3; 3] {
    let [one, other] = across::<D>(normal);
    [*normal, one, other]
}
