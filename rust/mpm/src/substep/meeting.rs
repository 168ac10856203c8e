//! Contact of bodies that meet: an elastic body with another, or with what flows.
//!
//! Each has a velocity of its own at nodes that several reach (Bardenhagen et al. 2001, doi:10.1016/S0045-7825(00)00338-2).
//! There the two may part, but not go through each other, with Coulomb friction between them. A node alone would stop them
//! as soon as their stencils overlap, two cells apart. So the gap between them follows from how full both leave the node,
//! and they close until it is `TOUCH`, or `TOUCH_FLOW` where one of them flows.

use crate::boundary::{MaterialFriction, remaining_slip};
use crate::grid::{
    CHUNK, FieldMap, FieldView, FieldWindow, SMALLEST_MASS, Slopes, Slot, View, Window,
};
use crate::linalg::{Vector, exp, lanes, ln};
use crate::particles::{MaterialGroup, with_group};
use wide::f32x4;

/// Gap at which contact begins [cells]: faces are rough by as much, because particles are jittered.
const TOUCH: f32 = 0.15;
/// The same for an elastic body and what flows, which fills the roughness. With 0.15 a body floats as if it were larger by
/// as much all round; with 0 it sinks slowly.
const TOUCH_FLOW: f32 = 0.07;
/// Distance of a plane face from a node in cells, for each unit of the logarithm of the empty over the full part of its
/// spline. Within a cell on both sides the error is below 0.06 cells.
const CELLS_PER_LOG: f32 = 0.2757;

/// More than rounding changes a product of openings.
const ROUNDING: f32 = 1.01;

/// Constants of contact between bodies.
#[derive(Debug, Clone)]
pub struct Meeting {
    /// Coulomb coefficient; None takes the smaller wall friction of the two.
    friction: Option<f32>,
    /// For each field the part of a node's volume that a kilogram fills [1/kg].
    fill_per_mass: Vec<f32>,
    /// For each field the wall friction of its material; of the first one a material's, where several flow.
    wall_friction: Vec<f32>,
    /// Reciprocal of the volume of a cell [1/m^D].
    cells_per_volume: f32,
    /// Bounds on the product of the empty over the full parts of two bodies that touch [-]: of elastic ones, and where one flows.
    most_open: [f32; 2],
    /// Whether something flows; all that does shares the first field.
    flows: bool,
    /// Whether materials of several densities share that field.
    mixes_densities: bool,
}

impl Meeting {
    /// For the groups of a scene with these densities [kg/m^3] of the materials, on cells of this volume [m^D].
    pub fn new<const D: usize>(
        groups: &[MaterialGroup<D>],
        densities: &[f32],
        cell: f32,
        friction: Option<f32>,
    ) -> Self {
        let mut meeting = Self {
            friction,
            fill_per_mass: Vec::new(),
            wall_friction: Vec::new(),
            cells_per_volume: 1.0 / cell,
            most_open: [TOUCH, TOUCH_FLOW].map(|touch| ROUNDING * exp(touch / CELLS_PER_LOG)),
            flows: groups.iter().any(|group| !group.is_elastic()),
            mixes_densities: false,
        };
        for group in groups {
            let (field, index, friction) = with_group!(
                group,
                group => (usize::from(group.field), group.index, group.wall_friction)
            );
            let fill = 1.0 / (densities[usize::from(index)] * cell);
            let count = meeting.fill_per_mass.len().max(field + 1);
            meeting.fill_per_mass.resize(count, 0.0);
            meeting.wall_friction.resize(count, 0.0);
            meeting.wall_friction[field] = friction;
            let of_field = &mut meeting.fill_per_mass[field];
            meeting.mixes_densities |= *of_field != 0.0 && *of_field != fill;
            *of_field = fill;
        }
        meeting
    }

    /// Whether materials of several densities share the first field.
    pub fn mixes_densities(&self) -> bool {
        self.mixes_densities
    }

    /// Number of fields.
    pub fn fields(&self) -> usize {
        self.fill_per_mass.len()
    }

    /// Sets the wall friction at nodes of elastic bodies, where materials differ in it; that of what flows is summed up by
    /// particles.
    pub fn set_friction<const D: usize>(
        &self,
        window: &mut Window<'_, D>,
        fields: Option<&mut FieldWindow<'_, D>>,
        kinds: FieldMap<'_>,
    ) {
        if window.friction_mass.is_empty() || !kinds.any_elastic() {
            return;
        }
        let set = |field: u16, nodes: &[f32x4], friction_mass: &mut [f32]| {
            let friction = self.wall_friction[usize::from(field)];
            for (sum, node) in friction_mass.iter_mut().zip(nodes) {
                *sum = friction * node.as_array()[3];
            }
        };
        for chunk in window.chunks(window.planes.clone()) {
            if let Some(field) = kinds.elastic_alone(window.first / CHUNK + chunk) {
                let nodes = chunk * CHUNK..(chunk + 1) * CHUNK;
                let friction_mass = &mut window.friction_mass[nodes.clone()];
                set(field, &window.nodes[nodes], friction_mass);
            }
        }
        let Some(fields) = fields else { return };
        for (number, slot) in fields.slots.iter().enumerate() {
            if kinds.is_elastic(slot.field) {
                let nodes = number * CHUNK..(number + 1) * CHUNK;
                let friction_mass = &mut fields.friction_mass[nodes.clone()];
                set(slot.field, &fields.nodes[nodes], friction_mass);
            }
        }
    }

    /// Finds how full each of several fields leaves the nodes of slots, and the directions of their faces where these may matter;
    /// see `Slopes`.
    pub fn find_slopes<const D: usize>(
        &self,
        slopes: Slopes<'_>,
        grid: View<'_, D>,
        fields: FieldView<'_, D>,
    ) {
        let Slopes { slots, values } = slopes;
        let mut values = values.as_chunks_mut::<CHUNK>().0;
        for of_chunk in slots.chunk_by(|one, next| one.chunk == next.chunk) {
            let (mine, others) = values.split_at_mut(of_chunk.len());
            values = others;
            self.find_fullness(of_chunk, mine, grid, fields);
            for (number, slot) in of_chunk.iter().enumerate() {
                let matters = self.matters(of_chunk, mine, number);
                if matters != [false; CHUNK] {
                    self.find_directions(*slot, &mut mine[number], matters, grid, fields);
                }
            }
        }
    }

    /// Finds how full the fields of a chunk leave its nodes, where several reach one.
    fn find_fullness<const D: usize>(
        &self,
        slots: &[Slot],
        values: &mut [[f32x4; CHUNK]],
        grid: View<'_, D>,
        fields: FieldView<'_, D>,
    ) {
        let mut holders = [0; CHUNK];
        for (slot, of_slot) in slots.iter().zip(&mut *values) {
            let mass = fields.masses(grid, slot.chunk as usize, slot.field);
            for step in 0..CHUNK {
                holders[step] += u32::from(mass[step] > SMALLEST_MASS);
                of_slot[step] = f32x4::from([0.0, 0.0, 0.0, mass[step]]);
            }
        }
        for (slot, of_slot) in slots.iter().zip(values) {
            for step in 0..CHUNK {
                let mass = of_slot[step].as_array()[3];
                let fill = if holders[step] > 1 && mass > SMALLEST_MASS {
                    mass * self.per_mass(fields, *slot, step, mass)
                } else {
                    0.0
                };
                of_slot[step] = f32x4::from([0.0, 0.0, 0.0, fill]);
            }
        }
    }

    /// Part of the volume of a node that a kilogram of the field of a slot fills there, which has this mass [1/kg].
    fn per_mass<const D: usize>(
        &self,
        fields: FieldView<'_, D>,
        slot: Slot,
        step: usize,
        mass: f32,
    ) -> f32 {
        if self.mixes_densities && slot.field == 0 {
            fields.volumes(slot.chunk as usize, 0)[step] * self.cells_per_volume / mass
        } else {
            self.fill_per_mass[usize::from(slot.field)]
        }
    }

    /// At which nodes of a chunk the direction of the face of one of its slots may matter: where the other body is elastic, too, or
    /// may touch.
    fn matters(&self, slots: &[Slot], values: &[[f32x4; CHUNK]], number: usize) -> [bool; CHUNK] {
        let fill = |number: usize, step: usize| values[number][step].as_array()[3];
        let mut matters = [false; CHUNK];
        for other in (0..slots.len()).filter(|other| *other != number) {
            let flows = self.flows && slots[other.min(number)].field == 0;
            for (step, matters) in matters.iter_mut().enumerate() {
                let fill = [fill(number, step), fill(other, step)];
                let both = fill[0] > 0.0 && fill[1] > 0.0;
                *matters |= both && (!flows || self.may_touch(fill, flows));
            }
        }
        matters
    }

    /// Finds the directions of the faces of a slot at some of its nodes, in which fullness is known.
    fn find_directions<const D: usize>(
        &self,
        slot: Slot,
        values: &mut [f32x4; CHUNK],
        at: [bool; CHUNK],
        grid: View<'_, D>,
        fields: FieldView<'_, D>,
    ) {
        let chunk = slot.chunk as usize;
        let mass = |chunk: usize| fields.masses(grid, chunk, slot.field);
        let mut half = [[0.0; CHUNK]; D];
        for axis in 0..D - 1 {
            let along = grid.layout.stride(axis) / CHUNK;
            let (before, after) = (mass(chunk - along), mass(chunk + along));
            half[axis] = std::array::from_fn(|step| 0.5 * (after[step] - before[step]));
        }
        let (before, here, after) = (mass(chunk - 1), mass(chunk), mass(chunk + 1));
        for step in 0..CHUNK {
            let low = if step == 0 {
                before[CHUNK - 1]
            } else {
                here[step - 1]
            };
            let high = if step == CHUNK - 1 {
                after[0]
            } else {
                here[step + 1]
            };
            half[D - 1][step] = 0.5 * (high - low);
        }
        for step in (0..CHUNK).filter(|step| at[*step]) {
            let per_mass = self.per_mass(fields, slot, step, here[step]);
            let slope = Vector::<D>::from_fn(|axis, _| half[axis][step] * per_mass);
            let fill = values[step].as_array()[3];
            values[step] = lanes(&distance_slope(&slope, fill), fill);
        }
    }

    /// Whether the gap between two bodies that leave a node so full may be one at which they touch; quicker than to find the gap.
    fn may_touch(&self, fill: [f32; 2], flows: bool) -> bool {
        let [one, other] = fill.map(clamped);
        (1.0 - one) * (1.0 - other) <= self.most_open[usize::from(flows)] * one * other
    }

    /// Changes the velocities of the nodes of some planes.
    pub fn resolve<const D: usize>(
        &self,
        fields: &mut FieldWindow<'_, D>,
        wall_friction: &MaterialFriction,
    ) {
        for first in 0..fields.slots.len() {
            for second in first + 1..fields.slots.len() {
                if fields.slots[second].chunk != fields.slots[first].chunk {
                    break;
                }
                for step in 0..CHUNK {
                    let node = fields.slots[first].chunk as usize * CHUNK + step;
                    let nodes = [first * CHUNK + step, second * CHUNK + step];
                    let of = [fields.slots[first].field, fields.slots[second].field];
                    self.resolve_node::<D>(fields, (node, nodes), of, wall_friction);
                }
            }
        }
    }

    /// The same for one node of the grid and its nodes of two fields, whose numbers are in ascending order.
    fn resolve_node<const D: usize>(
        &self,
        fields: &mut FieldWindow<'_, D>,
        (node, nodes): (usize, [usize; 2]),
        of: [u16; 2],
        wall_friction: &MaterialFriction,
    ) {
        let mass = nodes.map(|node| fields.nodes[node].as_array()[3]);
        if mass.iter().any(|mass| *mass <= SMALLEST_MASS) {
            return;
        }
        let flows = self.flows && of[0] == 0;
        let touch = if flows { TOUCH_FLOW } else { TOUCH };
        let fill = nodes.map(|node| fields.slope(node).as_array()[3]);
        if !self.may_touch(fill, flows) || gap(fill[0]) + gap(fill[1]) > touch {
            return;
        }
        let vector = |four: &[f32; 4]| Vector::<D>::from_fn(|axis, _| four[axis]);
        let toward = if flows {
            let slope = |i: usize| vector(fields.slope(nodes[i]).as_array());
            slope(1) - slope(0)
        } else {
            direction(fields, node, of)
        };
        let length = toward.norm();
        // False for what is in the midst of both, where no direction leads apart.
        if length <= SMALLEST_SLOPE {
            return;
        }
        let normal = toward / length;
        let v = |i: usize| vector(fields.nodes[nodes[i]].as_array());
        let closing = v(0) - v(1);
        let speed = closing.dot(&normal);
        if speed <= 0.0 {
            return;
        }
        let friction = |i: usize| match wall_friction {
            MaterialFriction::Uniform(friction) => *friction,
            MaterialFriction::Mixed => fields.friction_mass[nodes[i]] / mass[i],
        };
        let friction = self
            .friction
            .unwrap_or_else(|| friction(0).min(friction(1)));
        let slip = closing - normal * speed;
        let lost = 1.0 - remaining_slip(slip.norm(), friction * speed);
        let change = normal * speed + slip * lost;
        let total = mass[0] + mass[1];
        for (i, share) in [(0, -mass[1] / total), (1, mass[0] / total)] {
            fields.nodes[nodes[i]] += lanes(&(change * share), 0.0);
        }
    }
}

/// Direction in which the second of two elastic bodies lies from the first at a node, of any length.
///
/// Particles are few, so fullness at one node gives a direction that is off by 2 to 20 degrees. A body that slides over such
/// faces rides up on each and is braked, by .02 to .09 g. So the gradients of each, by how full both leave a node, are summed over
/// the nodes around. At the edge of a body its own turn outwards. They count less, for it is less full there than what it lies on.
fn direction<const D: usize>(fields: &FieldWindow<'_, D>, node: usize, of: [u16; 2]) -> Vector<D> {
    let (mut toward, mut full) = ([f32x4::ZERO; 2], [0.0; 2]);
    fields.slopes_around(node, of, |first, second| {
        let fill = [first, second].map(|slope| slope.as_array()[3]);
        let both = fill[0] * fill[1];
        if both > 0.0 {
            toward[0] -= *first * f32x4::splat(both * (1.0 - clamped(fill[0])));
            toward[1] += *second * f32x4::splat(both * (1.0 - clamped(fill[1])));
            full[0] += fill[0];
            full[1] += fill[1];
        }
    });
    let all = full[0] * full[0] + full[1] * full[1];
    let share = full.map(|full| full * full / all);
    let sum = toward[0] * f32x4::splat(share[0]) + toward[1] * f32x4::splat(share[1]);
    Vector::from_fn(|axis, _| sum.as_array()[axis])
}

/// Smaller gradients of fullness have no direction [1/cell].
const SMALLEST_SLOPE: f32 = 1.0e-6;

/// A fullness that is neither 0 nor 1.
fn clamped(fill: f32) -> f32 {
    fill.clamp(0.005, 0.995)
}

/// How far beyond its plane face a node lies that a body fills to this part [cells]; negative inside.
fn gap(fill: f32) -> f32 {
    let fill = clamped(fill);
    CELLS_PER_LOG * ln((1.0 - fill) / fill)
}

/// Part of the differences of fullness that counts: with the spline's own form it leads directions back within 2 degrees.
const DIFFERENCE: f32 = 0.94;

/// The gradient of the distance [-] of a plane face from a node that a body fills to some part, from half the differences of that
/// between the nodes beside it.
///
/// Fullness is no linear function of distance: its differences alone turn a face that is oblique to the axes by up to 8 degrees, and
/// discs that glance off each other would spin without friction.
fn distance_slope<const D: usize>(slope: &Vector<D>, fill: f32) -> Vector<D> {
    // Where fullness is 1 / (1 + exp(d)), its difference between d - u and d + u is s = sinh(u) / (cosh(u) + cosh(d)).
    let fill = clamped(fill);
    let cosh = 0.5 / (fill * (1.0 - fill)) - 1.0;
    slope.map(|half| {
        let s = (2.0 * DIFFERENCE * half).clamp(-0.99, 0.99);
        let root = (s * s * (cosh * cosh - 1.0) + 1.0).sqrt();
        ln((s * cosh + root) / (1.0 - s))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The part of the spline of a node that lies behind a plane face at this distance, whose normal has this angle.
    fn fill(distance: f32, angle: f32) -> f32 {
        const STEPS: usize = 120;
        let spline = |x: f32| match x.abs() {
            x if x < 0.5 => 0.75 - x * x,
            x => 0.5 * (1.5 - x).powi(2),
        };
        let place = |i: usize| (i as f32 + 0.5) * 3.0 / STEPS as f32 - 1.5;
        let (mut behind, mut all) = (0.0, 0.0);
        for (x, y) in (0..STEPS * STEPS).map(|k| (place(k / STEPS), place(k % STEPS))) {
            let weight = spline(x) * spline(y);
            all += weight;
            if x * angle.cos() + y * angle.sin() + distance < 0.0 {
                behind += weight;
            }
        }
        behind / all
    }

    #[test]
    fn the_quick_test_of_gaps_leaves_out_none_that_touch() {
        let meeting = Meeting::new::<2>(&[], &[], 1.0, None);
        let fills = || (0..=1000).map(|i| i as f32 * 1.0e-3);
        for (flows, touch) in [(false, TOUCH), (true, TOUCH_FLOW)] {
            let (mut touching, mut tested) = (0, 0);
            for fill in fills().flat_map(|one| fills().map(move |other| [one, other])) {
                let may = meeting.may_touch(fill, flows);
                let touches = gap(fill[0]) + gap(fill[1]) <= touch;
                assert!(may || !touches, "{fill:?}");
                touching += i32::from(touches);
                tested += i32::from(may);
            }
            assert!(tested < touching + touching / 100);
        }
    }

    #[test]
    fn oblique_faces_keep_their_direction() {
        for degrees in [0.0f32, 10.0, 22.0, 35.0, 45.0] {
            let angle = degrees.to_radians();
            for distance in [-0.6, -0.3, 0.0, 0.3, 0.6] {
                let beside =
                    |x: f32, y: f32| fill(distance + x * angle.cos() + y * angle.sin(), angle);
                let slope = Vector::<2>::new(
                    beside(-1.0, 0.0) - beside(1.0, 0.0),
                    beside(0.0, -1.0) - beside(0.0, 1.0),
                ) * 0.5;
                let found = distance_slope(&slope, fill(distance, angle));
                let error = found[1].atan2(found[0]).to_degrees() - degrees;
                assert!(error.abs() < 2.5, "{degrees} {distance}: {error}");
            }
        }
    }
}
