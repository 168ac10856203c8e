//! Momentum to velocity, gravity, and contact.

use wide::f32x4;

use crate::grid::Grid;
use crate::math::Vector;
use crate::obstacle::{MaterialFriction, Obstacles};
use crate::walls::WallContact;

/// Lighter nodes [kg] count as empty: the inverse of their mass would leave the range of float32.
pub const SMALLEST_MASS: f32 = 1.0e-30;

/// Everything that acts on grid velocities.
pub struct GridForces<'a, const D: usize> {
    pub gravity: Vector<D>,
    pub walls: &'a WallContact,
    pub obstacles: &'a Obstacles<D>,
    pub material_friction: MaterialFriction,
}

/// Turns the grid's momentum into the velocity at the end of the substep.
pub fn grid_update<const D: usize>(grid: &mut Grid<D>, forces: &GridForces<'_, D>, dt: f32) {
    let mut gain = [0.0; 4];
    gain[..D].copy_from_slice((forces.gravity * dt).as_slice());
    let gain = f32x4::from(gain);
    for k in 0..grid.active.len() {
        let span = grid.active[k];
        let start = span.row * grid.layout.extent;
        for node in &mut grid.nodes[start + span.lo..start + span.hi] {
            // Without a branch: spray leaves every other node empty. An empty node gets a velocity that
            // nobody reads, and keeps its mass of zero.
            let mass = node.to_array()[3];
            let inverse = 1.0 / mass.max(SMALLEST_MASS);
            // The mass lane is multiplied by one and gains nothing.
            *node = *node * f32x4::from([inverse, inverse, inverse, 1.0]) + gain;
        }
        forces
            .obstacles
            .apply(grid, span, &forces.material_friction);
    }
    forces.walls.apply(grid, &forces.material_friction);
}
