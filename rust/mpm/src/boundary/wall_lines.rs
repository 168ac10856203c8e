//! Contact of a wall on many lines of nodes at a time.

use super::contact::{Contact, ContactKind, remaining_slip};
use super::node::MaterialFriction;
use super::reactions::Wrench;
use super::touch::{Touch, heights, shear};
use crate::grid::{CHUNK, PADDING, SMALLEST_MASS, Window};
use crate::linalg::{Kernel, LANES, Lanes, Quad};

/// A wall, and where it lies between the nodes of lines across it.
#[derive(Debug, Clone)]
pub struct Wall {
    pub axis: usize,
    /// +1 at a lower wall, -1 at an upper one.
    pub inward: f32,
    pub contact: Contact,
    /// [m]
    pub position: f64,
    /// Weights of the outer, middle and inner node at the wall.
    pub weights: [f32; 3],
}

/// Contact of one wall on node lines.
pub struct ResolveLines<'a, 'w, const D: usize> {
    pub window: &'a mut Window<'w, D>,
    pub wall: &'a Wall,
    /// See `touching`.
    pub touching: Touch,
    /// Duration of the substep [s].
    pub dt: f32,
    /// Their middle nodes, or the first of each chunk of these.
    pub lines: &'a [usize],
    pub friction: MaterialFriction,
    /// None where nobody reads forces: in 3D their sums take up to 3 % of a frame.
    pub wrench: Option<&'a mut Wrench<D>>,
}

impl<const D: usize> Kernel for ResolveLines<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        // Without friction nothing happens along the wall.
        let smooth = self.wall.contact.kind == ContactKind::Slip
            || self.wall.contact.kind == ContactKind::Separating
                && matches!(self.friction, MaterialFriction::Uniform(0.0));
        let axis = self.wall.axis;
        let across = [axis];
        let all = std::array::from_fn(|k| match k {
            0 => axis,
            k if k <= axis => k - 1,
            k => k,
        });
        match (axis == D - 1, smooth) {
            (true, true) => self.resolve::<Q, 1, 1>(across),
            (true, false) => self.resolve::<Q, 1, D>(all),
            (false, true) => self.resolve::<Q, CHUNK, 1>(across),
            (false, false) => self.resolve::<Q, CHUNK, D>(all),
        }
    }
}

impl<const D: usize> ResolveLines<'_, '_, D> {
    /// Changes the components of the velocity along some axes, the first of which is across the wall. So many lines lie side by
    /// side: one or a chunk.
    #[inline(always)]
    fn resolve<Q: Quad, const SIDE_BY_SIDE: usize, const N: usize>(mut self, axes: [usize; N]) {
        let mut starts = [0; LANES];
        let (mut found, most) = (0, LANES / SIDE_BY_SIDE);
        for start in self.lines {
            let start = start - self.window.first;
            starts[found] = start;
            found += usize::from(self.window.dirty[start / CHUNK]);
            if found == most {
                self.resolve_batch::<Q, SIDE_BY_SIDE, N>(&starts, found, &axes);
                found = 0;
            }
        }
        if found > 0 {
            self.resolve_batch::<Q, SIDE_BY_SIDE, N>(&starts, found, &axes);
        }
    }

    /// The same for lines that start at the first `found` of some middle nodes.
    #[inline(always)]
    fn resolve_batch<Q: Quad, const SIDE_BY_SIDE: usize, const N: usize>(
        &mut self,
        starts: &[usize; LANES],
        found: usize,
        axes: &[usize; N],
    ) {
        let inward = self.wall.inward as isize * self.window.layout.stride(self.wall.axis) as isize;
        let steps = [-inward, 0, inward];
        let nodes = &mut *self.window.nodes;
        let mut lines = ManyLines {
            mass: [[0.0; LANES]; 3],
            v: [[[0.0; LANES]; 3]; N],
        };
        let place = |step: usize, k: usize| starts[k].wrapping_add_signed(steps[step]);
        // A second chunk that is missing is the first once more, to be left out.
        let chunks = |step: usize| {
            [place(step, 0), place(step, found - 1)].map(|start| {
                let chunk = &nodes[start..start + CHUNK];
                chunk.try_into().expect("a chunk")
            })
        };
        for step in 0..3 {
            if SIDE_BY_SIDE == CHUNK {
                lines.mass[step] = Q::column(chunks(step), 3);
            } else {
                for lane in 0..found {
                    lines.mass[step][lane] = nodes[place(step, lane)].as_array()[3];
                }
            }
        }
        // In a splash most lines do not touch: their velocities are not read.
        if !lines.leave_out_what_does_not_touch(self.touching, found * SIDE_BY_SIDE) {
            return;
        }
        for step in 0..3 {
            for k in 0..N {
                if SIDE_BY_SIDE == CHUNK {
                    lines.v[k][step] = Q::column(chunks(step), axes[k]);
                } else {
                    for lane in 0..found {
                        lines.v[k][step][lane] = nodes[place(step, lane)].as_array()[axes[k]];
                    }
                }
            }
        }
        let mut mu = [0.0; LANES];
        if N > 1 {
            for lane in 0..found * SIDE_BY_SIDE {
                let node = starts[lane / SIDE_BY_SIDE] + lane % SIDE_BY_SIDE;
                let mass = lines.mass[1][lane].max(SMALLEST_MASS);
                mu[lane] = self.friction.at(self.window.friction_mass, node, mass);
            }
        }
        let given = lines.apply(self.wall, self.touching, &mu, self.dt);
        self.sum_up::<SIDE_BY_SIDE, N>(starts, found, axes, &given);
        let nodes = &mut *self.window.nodes;
        for step in 0..3 {
            for k in 0..N {
                let (v, _) = lines.v[k][step].as_chunks::<SIDE_BY_SIDE>();
                for (start, v) in starts[..found].iter().zip(v) {
                    let place = start.wrapping_add_signed(steps[step]);
                    if SIDE_BY_SIDE == CHUNK {
                        let chunk = &mut nodes[place..place + CHUNK];
                        let v = v[..].try_into().expect("a chunk");
                        Q::set_column(chunk.try_into().expect("a chunk"), axes[k], v);
                    } else {
                        nodes[place].as_mut_array()[axes[k]] = v[0];
                    }
                }
            }
        }
    }
}

impl<const D: usize> ResolveLines<'_, '_, D> {
    /// Adds the impulses on lines that start at the first `found` of some middle nodes, at the wall itself.
    #[inline(always)]
    fn sum_up<const SIDE_BY_SIDE: usize, const N: usize>(
        &mut self,
        starts: &[usize; LANES],
        found: usize,
        axes: &[usize; N],
        given: &[Lanes; N],
    ) {
        let Some(wrench) = &mut self.wrench else {
            return;
        };
        let mut any = false;
        given
            .iter()
            .flatten()
            .for_each(|impulse| any |= *impulse != 0.0);
        if !any {
            return;
        }
        let layout = &self.window.layout;
        // Each component, and that times each coordinate of its place in nodes.
        let (mut sums, mut moments) = ([0.0; N], [[0.0; D]; N]);
        for line in 0..found {
            let node = starts[line] + self.window.first;
            let mut place = layout.row_coordinates(node / layout.row_length);
            place[D - 1] = node % layout.row_length;
            for k in 0..N {
                let (parts, _) = given[k].as_chunks::<SIDE_BY_SIDE>();
                let (mut sum, mut along) = (parts[line], parts[line]);
                if SIDE_BY_SIDE > 1 {
                    (0..SIDE_BY_SIDE).for_each(|step| along[step] *= step as f32);
                    let mut half = SIDE_BY_SIDE / 2;
                    while half > 0 {
                        for step in 0..half {
                            sum[step] += sum[step + half];
                            along[step] += along[step + half];
                        }
                        half /= 2;
                    }
                }
                let sum = f64::from(sum[0]);
                sums[k] += sum;
                for axis in 0..D {
                    moments[k][axis] += place[axis] as f64 * sum;
                }
                if SIDE_BY_SIDE > 1 {
                    moments[k][D - 1] += f64::from(along[0]);
                }
            }
        }
        let dx = 1.0 / layout.resolution as f64;
        for (k, &axis) in axes.iter().enumerate() {
            wrench.impulse[axis] += sums[k];
            for across in (0..D).filter(|across| *across != axis) {
                let moment = if across == self.wall.axis {
                    self.wall.position * sums[k]
                } else {
                    (moments[k][across] - PADDING as f64 * sums[k]) * dx
                };
                // The sign of e_across x e_axis.
                let about = &mut wrench.moment[3 - across - axis];
                *about += if (across + 1) % 3 == axis {
                    moment
                } else {
                    -moment
                };
            }
        }
    }
}

/// The outer, middle and inner nodes of `LANES` lines, with N components of their velocities, the one across the wall first.
struct ManyLines<const N: usize> {
    mass: [Lanes; 3],
    v: [[Lanes; 3]; N],
}

impl<const N: usize> ManyLines<N> {
    /// Takes the masses of lines away that have no material at the wall, or that are not among the first `count`. Returns
    /// whether any are left.
    #[inline(always)]
    fn leave_out_what_does_not_touch(&mut self, touching: Touch, count: usize) -> bool {
        let [_, middle, inner] = self.mass;
        let mut any = false;
        let mut touches = [false; LANES];
        for i in 0..LANES {
            touches[i] =
                (middle[i] > SMALLEST_MASS) & touching.touches(middle[i], inner[i]) & (i < count);
            any |= touches[i];
        }
        for mass in &mut self.mass {
            let mut kept = [0.0; LANES];
            for i in 0..LANES {
                kept[i] = if touches[i] { mass[i] } else { 0.0 };
            }
            *mass = kept;
        }
        any
    }

    /// Speeds at which the material may come nearer [m/s].
    #[inline(always)]
    fn closing_speeds(&self, touching: Touch, dt: f32) -> Lanes {
        let mut speeds = [0.0; LANES];
        if touching.distance > 0.0 {
            let [_, middle, inner] = self.mass;
            for i in 0..LANES {
                speeds[i] = touching.closing(middle[i], inner[i], dt);
            }
        }
        speeds
    }

    /// Holds the material at the wall; see `shear`. Returns the impulses, by components.
    #[inline(always)]
    fn hold(&mut self, heights: [f32; 3]) -> [Lanes; N] {
        let mut given = [[0.0; LANES]; N];
        for i in 0..LANES {
            let mass = self.mass.map(|mass| mass[i]);
            for k in 0..N {
                let v = self.v[k].map(|v| v[i]);
                let after = shear(mass, heights, v);
                for step in 0..3 {
                    given[k][i] += mass[step] * (after[step] - v[step]);
                    self.v[k][step][i] = after[step];
                }
            }
        }
        given
    }

    /// Changes velocities so that the material at the wall obeys the contact in a substep of `dt` [s]. Returns the impulses, by
    /// components.
    #[inline(always)]
    fn apply(&mut self, wall: &Wall, touching: Touch, mu: &Lanes, dt: f32) -> [Lanes; N] {
        if wall.contact.kind == ContactKind::Sticky {
            return self.hold(heights(wall.weights));
        }
        let (closing, resting) = (
            self.closing_speeds(touching, dt),
            touching.resting_speed(dt),
        );
        let mut given = [[0.0; LANES]; N];
        let separates = wall.contact.kind == ContactKind::Separating;
        if touching.may_be_light() {
            for i in 0..LANES {
                // It would take most of the change, and material would creep off by a quarter of a cell before it is held. It
                // stays with the wall, as an empty one does.
                let [outer, middle, _] = self.mass;
                let light =
                    touching.is_light([outer[i], middle[i]], [wall.weights[0], wall.weights[1]]);
                self.mass[0][i] = if light { 0.0 } else { outer[i] };
                let leaves = separates & (self.v[0][0][i] * wall.inward >= 0.0);
                for k in 0..N {
                    let held = light & !leaves & (!separates | (k == 0));
                    let momentum = outer[i] * self.v[k][0][i];
                    given[k][i] = if held { -momentum } else { 0.0 };
                    self.v[k][0][i] = if held { 0.0 } else { self.v[k][0][i] };
                }
            }
        }
        // Read in the loop they would be gathered, lane by lane.
        let (weights, inward) = (wall.weights, wall.inward);
        for i in 0..LANES {
            let mut mobility = [0.0; 3];
            let mut at_wall = [0.0; N];
            let (mut total, mut held) = (0.0, 0.0);
            for step in 0..3 {
                // Empty nodes have no velocity to speak of and take no impulse.
                let mass = self.mass[step][i];
                let there = mass > SMALLEST_MASS;
                let weight = if there { weights[step] } else { 0.0 };
                mobility[step] = weight / if there { mass } else { 1.0 };
                total += mobility[step] * weight;
                held += weight;
                for k in 0..N {
                    at_wall[k] += weight * self.v[k][step][i];
                }
            }
            let approach = 0.0 - at_wall[0] * inward;
            let approach = approach - if approach > resting { closing[i] } else { 0.0 };
            let none = separates & (approach <= 0.0) | (total <= 0.0);
            // Impulse per change of the velocity at the wall; each node takes its share.
            let impulse = if none { 0.0 } else { 1.0 } / if none { 1.0 } else { total };
            let mut change = [approach * inward; N];
            if N > 1 {
                let slip_squared: f32 = at_wall[1..].iter().map(|slip| slip * slip).sum();
                // Coulomb friction takes at most this part of the slip.
                let lost = 1.0 - remaining_slip(slip_squared.sqrt(), mu[i] * approach);
                let lost = if separates { lost } else { 0.0 };
                for k in 1..N {
                    change[k] = -at_wall[k] * lost;
                }
            }
            for k in 0..N {
                given[k][i] += change[k] * impulse * held;
                for step in 0..3 {
                    self.v[k][step][i] += change[k] * impulse * mobility[step];
                }
            }
        }
        given
    }
}
