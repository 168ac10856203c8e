//! Impulses of contacts: projected Gauss-Seidel with Coulomb's cone, Newton's restitution, and positions mended apart from
//! velocities, so that overlap gives no speed (Catto 2005; Guendelman et al. 2003).

use crate::contacts::Contact;
use crate::pose::{Matrix3, Vector3, turned};
use crate::state::{Kept, State};
use crate::world::World;

/// Most sweeps over all contacts, and the change relative to the largest impulse after which they end.
const MOST_SWEEPS: usize = 100;
const SETTLED: f64 = 1.0e-7;
/// Contacts that meet slower than this multiple of what gravity gives in a step do not bounce.
const RESTING: f64 = 4.0;
const RESTING_SPEED: f64 = 5.0e-3;
/// Parts of the restitution that are tried until contacts give no energy, and what counts as none.
const BOUNCES: [f64; 4] = [1.0, 0.7, 0.4, 0.0];
const SMALLEST_GAIN: f64 = 1.0e-9;
/// Part of the overlap beyond the slop that one sweep mends, and the number of sweeps.
const MENDED: f64 = 0.2;
const MENDING_SWEEPS: usize = 4;

/// Inverse inertia of a solid; zero of fixed ones.
#[derive(Clone, Copy)]
struct Inverse {
    mass: f64,
    inertia: Matrix3,
}

impl Inverse {
    const FIXED: Self = Self {
        mass: 0.0,
        inertia: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };
}

/// A contact ready for sweeps.
struct Row {
    contact: Contact,
    /// Of both solids and for each axis: the moment of a unit impulse [m], and the angular velocity that it gives [rad/s].
    moments: [[Vector3; 3]; 2],
    spins: [[Vector3; 3]; 2],
    /// Inverse masses of both, zero of fixed ones [1/kg].
    mobility: [f64; 2],
    /// Impulse per change of velocity along each axis [kg].
    stiffness: [f64; 3],
    /// Speed at which the solids should part [m/s].
    target: f64,
    impulse: [f64; 3],
}

/// Velocities of all bodies.
#[derive(Clone)]
struct Velocities {
    v: Vec<Vector3>,
    w: Vec<Vector3>,
}

impl Velocities {
    fn of(state: &State) -> Self {
        Self {
            v: state.bodies.iter().map(|body| body.v).collect(),
            w: state.bodies.iter().map(|body| body.w).collect(),
        }
    }

    /// Velocity of the second solid at a contact as seen from the first [m/s].
    fn relative(&self, contact: &Contact) -> Vector3 {
        let [a, b] = contact.solids;
        let [arm_a, arm_b] = &contact.arms;
        let first = self.v[a] + self.w[a].cross(arm_a);
        let second = if b < self.v.len() {
            self.v[b] + self.w[b].cross(arm_b)
        } else {
            contact.surface
        };
        second - first
    }

    fn push(&mut self, contact: &Contact, inverses: &[Inverse], impulse: &Vector3) {
        for (side, sign) in [(0, -1.0), (1, 1.0)] {
            let solid = contact.solids[side];
            if let Some(inverse) = inverses.get(solid) {
                self.v[solid] += impulse * (sign * inverse.mass);
                self.w[solid] += inverse.inertia * contact.arms[side].cross(impulse) * sign;
            }
        }
    }
}

/// Impulse per velocity along an axis at a contact [kg].
fn stiffness(contact: &Contact, axis: &Vector3, inverses: &[Inverse]) -> f64 {
    let mut mobility = 0.0;
    for (solid, arm) in contact.solids.iter().zip(&contact.arms) {
        if let Some(inverse) = inverses.get(*solid) {
            let turning = arm.cross(axis);
            mobility += inverse.mass + turning.dot(&(inverse.inertia * turning));
        }
    }
    1.0 / mobility
}

impl<const D: usize> World<D> {
    /// Changes velocities so that the solids do not enter each other in a step.
    pub(crate) fn solve(
        &self,
        state: &mut State,
        contacts: &[Contact],
        gravity: &Vector3,
        dt: f64,
    ) {
        if contacts.is_empty() {
            state.kept.clear();
            return;
        }
        let inverses: Vec<Inverse> = self.inverses(state);
        let resting = RESTING * gravity.norm() * dt + RESTING_SPEED;
        let before = Velocities::of(state);
        let start = self.energy(state, &before);
        // Newton's law of restitution with friction can give energy, where several points bounce at once.
        for share in BOUNCES {
            let mut velocities = before.clone();
            let mut rows: Vec<Row> = (contacts.iter())
                .map(|contact| {
                    let speed = before.relative(contact).dot(&contact.axes[0]);
                    let bounces = -speed > resting && contact.gap + speed * dt < 0.0;
                    // Until the end of the step they may close the gap, but for the overlap that stays.
                    let closing = -(contact.gap + contact.slop) / dt;
                    let key = contact.key();
                    let kept = state.kept.binary_search_by_key(&key, |kept| kept.key);
                    let of = |side: usize| inverses.get(contact.solids[side]).copied();
                    let inverse = [0, 1].map(|side| of(side).unwrap_or(Inverse::FIXED));
                    let moments =
                        [0, 1].map(|side| contact.axes.map(|axis| contact.arms[side].cross(&axis)));
                    Row {
                        moments,
                        spins: [0, 1]
                            .map(|side: usize| moments[side].map(|m| inverse[side].inertia * m)),
                        mobility: inverse.map(|inverse| inverse.mass),
                        stiffness: contact
                            .axes
                            .map(|axis| stiffness(contact, &axis, &inverses)),
                        target: if bounces && contact.restitution * share > 0.0 {
                            -contact.restitution * share * speed
                        } else {
                            closing.min(0.0)
                        },
                        impulse: kept.map_or([0.0; 3], |place| state.kept[place].impulse),
                        contact: *contact,
                    }
                })
                .collect();
            sweep_all::<D>(&mut rows, &mut velocities);
            let work: f64 = rows
                .iter()
                .map(|row| total(row).dot(&row.contact.surface))
                .sum();
            let gain = self.energy(state, &velocities) - start + work;
            if gain <= SMALLEST_GAIN * start || share == 0.0 {
                keep(state, &rows, &velocities);
                return;
            }
        }
    }

    /// Kinetic energy with other velocities [J].
    fn energy(&self, state: &State, velocities: &Velocities) -> f64 {
        let all = self.bodies.iter().zip(&state.bodies);
        all.zip(velocities.v.iter().zip(&velocities.w))
            .map(|((body, moving), (v, w))| body.kinetic_energy(&moving.placed, v, w))
            .sum()
    }

    /// Moves bodies apart where they overlap by more than what stays.
    pub(crate) fn mend(&self, state: &mut State, contacts: &[Contact]) {
        let deep = |contact: &&Contact| contact.gap < -2.0 * contact.slop;
        let deep: Vec<Contact> = contacts.iter().filter(deep).copied().collect();
        if deep.is_empty() {
            return;
        }
        let inverses: Vec<Inverse> = self.inverses(state);
        let still = vec![Vector3::zeros(); state.bodies.len()];
        let mut moved = Velocities {
            v: still.clone(),
            w: still,
        };
        for _ in 0..MENDING_SWEEPS {
            for contact in &deep {
                let contact = Contact {
                    surface: Vector3::zeros(),
                    ..*contact
                };
                let normal = contact.axes[0];
                let gap = contact.gap + moved.relative(&contact).dot(&normal);
                let missing = -gap - 2.0 * contact.slop;
                if missing > 0.0 {
                    let push = MENDED * missing * stiffness(&contact, &normal, &inverses);
                    moved.push(&contact, &inverses, &(normal * push));
                }
            }
        }
        for (body, (v, w)) in state.bodies.iter_mut().zip(moved.v.iter().zip(&moved.w)) {
            body.placed.x += v;
            body.placed.turn = turned(&body.placed.turn, w);
        }
    }

    fn inverses(&self, state: &State) -> Vec<Inverse> {
        let all = self.bodies.iter().zip(&state.bodies);
        all.map(|(body, moving)| {
            if body.mass.mass.is_finite() {
                Inverse {
                    mass: 1.0 / body.mass.mass,
                    inertia: body.mass.inverse_inertia(&moving.placed.turn),
                }
            } else {
                Inverse::FIXED
            }
        })
        .collect()
    }
}

/// Sweeps over all contacts until little changes, from the impulses of the step before.
fn sweep_all<const D: usize>(rows: &mut [Row], velocities: &mut Velocities) {
    let across = if D == 2 { 2 } else { 3 };
    for row in &*rows {
        for k in 0..across {
            row.push(velocities, k, row.impulse[k]);
        }
    }
    for _ in 0..MOST_SWEEPS {
        let (mut change, mut largest) = (0.0f64, 0.0f64);
        for row in &mut *rows {
            let before = row.impulse;
            row.sweep(velocities, across);
            for k in 0..3 {
                change = change.max((row.impulse[k] - before[k]).abs());
                largest = largest.max(row.impulse[k].abs());
            }
        }
        if change <= SETTLED * largest {
            break;
        }
    }
}

/// Takes the velocities over, and keeps the impulses for the next step.
fn keep(state: &mut State, rows: &[Row], velocities: &Velocities) {
    let all = velocities.v.iter().zip(&velocities.w);
    for (body, (v, w)) in state.bodies.iter_mut().zip(all) {
        (body.v, body.w) = (*v, *w);
    }
    state.kept = rows
        .iter()
        .filter(|row| row.impulse != [0.0; 3])
        .map(|row| Kept {
            key: row.contact.key(),
            impulse: row.impulse,
        })
        .collect();
    state.kept.sort_by_key(|kept| kept.key);
    state.kept.dedup_by_key(|kept| kept.key);
}

fn total(row: &Row) -> Vector3 {
    let [n, s, t] = row.contact.axes;
    n * row.impulse[0] + s * row.impulse[1] + t * row.impulse[2]
}

impl Row {
    /// Speed of the second solid along an axis as seen from the first [m/s].
    #[inline(always)]
    fn speed(&self, velocities: &Velocities, k: usize) -> f64 {
        let ([a, b], axis) = (self.contact.solids, &self.contact.axes[k]);
        let first = velocities.v[a].dot(axis) + velocities.w[a].dot(&self.moments[0][k]);
        let second = if b < velocities.v.len() {
            velocities.v[b].dot(axis) + velocities.w[b].dot(&self.moments[1][k])
        } else {
            self.contact.surface.dot(axis)
        };
        second - first
    }

    /// Gives both solids an impulse along an axis [kg m/s].
    #[inline(always)]
    fn push(&self, velocities: &mut Velocities, k: usize, impulse: f64) {
        let ([a, b], axis) = (self.contact.solids, &self.contact.axes[k]);
        velocities.v[a] -= axis * (impulse * self.mobility[0]);
        velocities.w[a] -= self.spins[0][k] * impulse;
        if b < velocities.v.len() {
            velocities.v[b] += axis * (impulse * self.mobility[1]);
            velocities.w[b] += self.spins[1][k] * impulse;
        }
    }

    /// Takes one contact nearer to its law.
    fn sweep(&mut self, velocities: &mut Velocities, across: usize) {
        let missing = self.target - self.speed(velocities, 0);
        let wanted = (self.impulse[0] + missing * self.stiffness[0]).max(0.0);
        self.push(velocities, 0, wanted - self.impulse[0]);
        self.impulse[0] = wanted;
        let mut next = [0.0; 3];
        let mut size = 0.0;
        for k in 1..across {
            next[k] = self.impulse[k] - self.speed(velocities, k) * self.stiffness[k];
            size += next[k] * next[k];
        }
        let (size, most) = (size.sqrt(), self.contact.friction * wanted);
        let factor = if size > most { most / size } else { 1.0 };
        for k in 1..across {
            let kept = next[k] * factor;
            self.push(velocities, k, kept - self.impulse[k]);
            self.impulse[k] = kept;
        }
    }
}
