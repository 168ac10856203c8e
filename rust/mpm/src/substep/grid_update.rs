//! Grid momentum to velocity, with gravity, contact between bodies, obstacles and walls (Hu et al. 2018, eq. 21).

use wide::f32x4;

use super::meeting::Meeting;
use crate::boundary::{MaterialFriction, Obstacles, WallContact};
use crate::grid::{CHUNK, FieldWindow, SMALLEST_MASS, Span, Window};
use crate::linalg::{Kernel, Quad, Vector, lanes, run_wide};

/// Everything that acts on grid velocities.
pub struct GridForces<'a, const D: usize> {
    pub gravity: Vector<D>,
    pub walls: &'a WallContact,
    pub obstacles: &'a Obstacles<D>,
    pub material_friction: MaterialFriction,
    pub meeting: &'a Meeting,
}

/// Turns the momentum of a window of planes into the velocity at the end of a substep of `dt` [s], independently of other
/// planes. Returns the work of moving obstacles there [J].
pub fn grid_update<const D: usize>(
    window: &mut Window<'_, D>,
    fields: Option<&mut FieldWindow<'_>>,
    forces: &GridForces<'_, D>,
    dt: f32,
) -> f64 {
    let gain = lanes(&(forces.gravity * dt), 0.0);
    run_wide(Accelerate { window, gain });
    let mut work = act(window, window.active(), forces, false);
    if let Some(fields) = fields {
        run_wide(AccelerateSlots {
            nodes: fields.nodes,
            gain,
        });
        forces
            .meeting
            .resolve::<D>(fields, &forces.material_friction);
        if forces.obstacles.any() || forces.walls.has_shared_lines(window) {
            work += act_on_slots(window, fields, forces);
        }
    }
    work
}

/// Contact with obstacles on some spans of nodes, and with walls.
fn act<const D: usize>(
    window: &mut Window<'_, D>,
    spans: &[Span],
    forces: &GridForces<'_, D>,
    shared: bool,
) -> f64 {
    let friction = &forces.material_friction;
    let work = forces.obstacles.apply(window, spans, friction);
    forces.walls.apply(window, friction, shared);
    work
}

/// The same for slots, field by field: each takes its place on the grid for a while, which is empty there.
fn act_on_slots<const D: usize>(
    window: &mut Window<'_, D>,
    fields: &mut FieldWindow<'_>,
    forces: &GridForces<'_, D>,
) -> f64 {
    let mut order: Vec<usize> = (0..fields.slots.len()).collect();
    order.sort_by_key(|&slot| fields.slots[slot].field);
    let mut spans = Vec::new();
    let mut work = 0.0;
    let same_field = |a: &usize, b: &usize| fields.slots[*a].field == fields.slots[*b].field;
    for slots in order.chunk_by(same_field) {
        let row_length = window.layout.row_length;
        spans.clear();
        spans.extend(slots.iter().map(|&slot| {
            let node = fields.slots[slot].chunk as usize * CHUNK;
            let (row, lo) = (node / row_length, node % row_length);
            let hi = lo + CHUNK;
            Span { row, lo, hi }
        }));
        for &slot in slots {
            swap(
                window,
                fields.slots[slot].chunk,
                fields.nodes,
                fields.friction_mass,
                slot,
            );
            window.dirty[fields.slots[slot].chunk as usize - window.first / CHUNK] = true;
        }
        work += act(window, &spans, forces, true);
        for &slot in slots {
            swap(
                window,
                fields.slots[slot].chunk,
                fields.nodes,
                fields.friction_mass,
                slot,
            );
            window.dirty[fields.slots[slot].chunk as usize - window.first / CHUNK] = false;
        }
    }
    work
}

/// Exchanges the nodes of a slot with those of the grid.
fn swap<const D: usize>(
    window: &mut Window<'_, D>,
    chunk: u32,
    nodes: &mut [f32x4],
    friction_mass: &mut [f32],
    slot: usize,
) {
    let at = chunk as usize * CHUNK - window.first;
    let (on_grid, mine) = (at..at + CHUNK, slot * CHUNK..(slot + 1) * CHUNK);
    window.nodes[on_grid.clone()].swap_with_slice(&mut nodes[mine.clone()]);
    if !friction_mass.is_empty() {
        window.friction_mass[on_grid].swap_with_slice(&mut friction_mass[mine]);
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
            dirty,
            ..
        } = self.window;
        for span in active {
            let start = span.row * layout.row_length - *first;
            for chunk in (start + span.lo) / CHUNK..(start + span.hi) / CHUNK {
                // Most nodes around spray are empty; their velocity is not read.
                if dirty[chunk] {
                    accelerate::<Q>(&mut nodes[chunk * CHUNK..(chunk + 1) * CHUNK], self.gain);
                }
            }
        }
    }
}

/// The same for all nodes of slots.
struct AccelerateSlots<'a> {
    nodes: &'a mut [f32x4],
    gain: f32x4,
}

impl Kernel for AccelerateSlots<'_> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        accelerate::<Q>(self.nodes, self.gain);
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
