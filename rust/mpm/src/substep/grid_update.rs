//! Grid momentum to velocity, with gravity, contact between bodies, obstacles and walls (Hu et al. 2018, eq. 21).

use wide::f32x4;

use super::meeting::Meeting;
use crate::boundary::{ContactNodes, Lines, MaterialFriction, Obstacles, WallContact};
use crate::grid::{CHUNK, FieldMap, FieldWindow, Layout, SMALLEST_MASS, Window};
use crate::linalg::{Kernel, Quad, Vector, lanes, run_wide};

/// Everything that acts on grid velocities.
pub struct GridForces<'a, const D: usize> {
    pub gravity: Vector<D>,
    pub walls: &'a WallContact,
    pub obstacles: &'a Obstacles<D>,
    pub material_friction: MaterialFriction,
    pub meeting: &'a Meeting,
    /// Duration of the substep [s].
    pub dt: f32,
    /// Whether there are rigid bodies: `accelerate` has come before.
    pub bodies: bool,
}

/// Turns the momentum of a window of planes into velocity, with gravity and contact between bodies.
pub fn accelerate_nodes<const D: usize>(
    window: &mut Window<'_, D>,
    fields: &mut Option<FieldWindow<'_, D>>,
    kinds: FieldMap<'_>,
    forces: &GridForces<'_, D>,
) {
    let gain = lanes(&(forces.gravity * forces.dt), 0.0);
    run_wide(Accelerate { window, gain });
    (forces.meeting).set_friction(window, fields.as_mut(), kinds);
    if let Some(fields) = fields {
        run_wide(AccelerateSlots::<D> {
            nodes: fields.nodes,
            old: fields.old,
            gain,
        });
        (forces.meeting).resolve::<D>(fields, &forces.material_friction);
    }
}

/// Turns the momentum of a window of planes into the velocity at the end of a substep, independently of other
/// planes. Returns the work of moving obstacles there [J]. Lines across surfaces along the first axis are left to `across`
/// where obstacles have some.
pub fn grid_update<const D: usize>(
    nodes: &mut ContactNodes<'_, D>,
    forces: &GridForces<'_, D>,
) -> f64 {
    if !forces.bodies {
        accelerate_nodes(&mut nodes.window, &mut nodes.fields, nodes.kinds, forces);
    }
    let work = forces.obstacles.apply(nodes);
    let axes: &[bool] = if forces.obstacles.act_across() {
        &[false]
    } else {
        &[false, true]
    };
    act_by_walls(nodes, forces, axes);
    work
}

/// Contact with walls, with those across the first axis, the others, or one after the other.
pub fn act_by_walls<const D: usize>(
    nodes: &mut ContactNodes<'_, D>,
    forces: &GridForces<'_, D>,
    across_first: &[bool],
) {
    let ContactNodes {
        window,
        fields,
        kinds,
        friction,
        reactions,
    } = nodes;
    let lines = Lines {
        own: None,
        across_first,
        dt: forces.dt,
    };
    forces.walls.apply(window, friction, lines, reactions);
    let Some(fields) = fields else { return };
    if !forces.walls.has_shared_lines(window) {
        return;
    }
    // Field by field, each takes its place on the grid for a while, which is empty there.
    let mut order: Vec<usize> = (0..fields.slots.len()).collect();
    order.sort_by_key(|&slot| fields.slots[slot].field);
    let same_field = |a: &usize, b: &usize| fields.slots[*a].field == fields.slots[*b].field;
    for slots in order.chunk_by(same_field) {
        let own = Some(kinds.is_elastic(fields.slots[slots[0]].field));
        for there in [true, false] {
            for &slot in slots {
                swap(window, fields, slot);
                window.dirty[fields.slots[slot].chunk as usize - window.first / CHUNK] = there;
            }
            if there {
                let lines = Lines { own, ..lines };
                forces.walls.apply(window, friction, lines, reactions);
            }
        }
    }
}

/// Exchanges the nodes of a slot with those of the grid.
fn swap<const D: usize>(window: &mut Window<'_, D>, fields: &mut FieldWindow<'_, D>, slot: usize) {
    let at = fields.slots[slot].chunk as usize * CHUNK - window.first;
    let (on_grid, mine) = (at..at + CHUNK, slot * CHUNK..(slot + 1) * CHUNK);
    window.nodes[on_grid.clone()].swap_with_slice(&mut fields.nodes[mine.clone()]);
    if !fields.friction_mass.is_empty() {
        window.friction_mass[on_grid].swap_with_slice(&mut fields.friction_mass[mine]);
    }
}

/// Divides by the masses, and adds the change by gravity.
struct Accelerate<'w, 'g, const D: usize> {
    window: &'w mut Window<'g, D>,
    gain: f32x4,
}

impl<const D: usize> Kernel for Accelerate<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        let active = self.window.active();
        let Window {
            layout,
            first,
            nodes,
            old,
            dirty,
            ..
        } = self.window;
        for span in active {
            let start = span.row * layout.row_length - *first;
            for chunk in (start + span.lo) / CHUNK..(start + span.hi) / CHUNK {
                // Most nodes around spray are empty; their velocity is not read.
                if dirty[chunk] {
                    let nodes = &mut nodes[chunk * CHUNK..(chunk + 1) * CHUNK];
                    if !old.is_empty() {
                        let numbers = CHUNK * Layout::<D>::OLD;
                        divide::<Q, D>(&mut old[chunk * numbers..(chunk + 1) * numbers], nodes);
                    }
                    accelerate::<Q>(nodes, self.gain);
                }
            }
        }
    }
}

/// The same for all nodes of slots.
struct AccelerateSlots<'a, const D: usize> {
    nodes: &'a mut [f32x4],
    old: &'a mut [f32],
    gain: f32x4,
}

impl<const D: usize> Kernel for AccelerateSlots<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        if !self.old.is_empty() {
            divide::<Q, D>(self.old, self.nodes);
        }
        accelerate::<Q>(self.nodes, self.gain);
    }
}

/// Divides momentum before forces by the masses of nodes.
#[inline(always)]
fn divide<Q: Quad, const D: usize>(old: &mut [f32], nodes: &[f32x4]) {
    if D == 2 {
        for (momentum, node) in old.iter_mut().zip(nodes) {
            *momentum *= 1.0 / node.as_array()[3].max(SMALLEST_MASS);
        }
    } else {
        let (sixteens, _) = old.as_chunks_mut::<16>();
        let (fours, _) = nodes.as_chunks::<4>();
        for (momenta, four) in sixteens.iter_mut().zip(fours) {
            let mass = Q::load(four).last_numbers().max(Q::splat(SMALLEST_MASS));
            let velocities = Q::splat(1.0).div(mass).mul(Q::of_numbers(momenta)).store();
            for (numbers, velocity) in momenta.as_chunks_mut::<4>().0.iter_mut().zip(velocities) {
                *numbers = velocity.to_array();
            }
        }
    }
}

#[inline(always)]
fn accelerate<Q: Quad>(nodes: &mut [f32x4], gain: f32x4) {
    let gain = Q::repeat(gain);
    let (kept, momentum) = ([0.0, 0.0, 0.0, 1.0].into(), [1.0, 1.0, 1.0, 0.0].into());
    let (kept, momentum) = (Q::repeat(kept), Q::repeat(momentum));
    let (fours, _) = nodes.as_chunks_mut();
    for four in fours {
        let node = Q::load(four);
        let mass = node.last_numbers().max(Q::splat(SMALLEST_MASS));
        // The mass itself is multiplied by one and gains nothing.
        let factor = Q::splat(1.0).div(mass).mul_add(momentum, kept);
        *four = node.mul_add(factor, gain).store();
    }
}
