//! Walls and obstacles for shown particles.

use super::block::Block;
use crate::boundary::{Obstacles, Walls};
use crate::grid::{Layout, Stencils};
use crate::linalg::{LANES, Vector};

/// Thickness [cells] of the layer inside a wall to which particles are put back.
const LAYER: f32 = 0.5;

/// All surfaces of a scene, for single particles.
#[derive(Debug, Clone)]
pub struct Surfaces<const D: usize> {
    pub walls: Walls<D>,
    pub obstacles: Obstacles<D>,
    /// Grid that the obstacles were prepared for.
    pub layout: Layout<D>,
    /// Wall friction of each material.
    pub frictions: Vec<f32>,
}

impl<const D: usize> Surfaces<D> {
    /// Puts back particles that have passed a wall; depth inside grows with the distance passed.
    ///
    /// Put onto the walls themselves, particles that pass two walls at once would end in one point, and density
    /// relaxation could not separate them.
    pub fn keep_between_walls(&self, block: &mut Block<D>) {
        let mut outside = [false; LANES];
        for axis in 0..D {
            let (lower, upper) = (self.walls.lower[axis], self.walls.upper[axis]);
            for i in 0..LANES {
                let x = block.x[axis][i];
                outside[i] |= !(x >= lower && x <= upper);
            }
        }
        if outside.iter().fold(false, |any, &out| any | out) {
            for lane in 0..LANES {
                if outside[lane] {
                    self.put_back(block, lane);
                }
            }
        }
    }

    #[cold]
    fn put_back(&self, block: &mut Block<D>, lane: usize) {
        let mut particle = block.get(lane);
        for axis in 0..D {
            let (lower, upper) = (self.walls.lower[axis], self.walls.upper[axis]);
            // An unbounded velocity, such as a diverging network gives, must not make a position of NaN.
            let wall = particle.x[axis].max(lower).min(upper);
            if wall.to_bits() != particle.x[axis].to_bits() {
                let side = if wall > lower { -1.0 } else { 1.0 };
                let mut normal = Vector::zeros();
                normal[axis] = side;
                let passed = (particle.x[axis] - wall).abs();
                let layer = LAYER * self.layout.dx();
                let inside = if passed < f32::MAX {
                    passed * (layer / (passed + layer))
                } else {
                    0.0
                };
                let friction = self.frictions[usize::from(particle.material)];
                let contact = self.walls.contacts[axis][usize::from(side < 0.0)];
                particle.x[axis] = wall + side * inside;
                particle.v = contact.resolve(&particle.v, &normal, friction);
            }
        }
        block.set(lane, &particle.x, &particle.v);
    }

    /// Moves particles inside an obstacle to its surface.
    pub fn push_out(&self, block: &mut Block<D>) {
        if !self.obstacles.any() {
            return;
        }
        let stencils = Stencils::at(&block.x, &self.layout);
        for lane in 0..LANES {
            if self.obstacles.near_stencil(stencils.start[lane] as usize) {
                let mut particle = block.get(lane);
                let friction = self.frictions[usize::from(particle.material)];
                let (x, v) = (&mut particle.x, &mut particle.v);
                self.obstacles.push_out(x, v, friction, |_, _, _| ());
                block.set(lane, &particle.x, &particle.v);
            }
        }
    }

    /// Does both for the particles of a block.
    pub fn confine(&self, block: &mut Block<D>) {
        self.keep_between_walls(block);
        if self.obstacles.any() {
            self.push_out(block);
            // Particles between an obstacle and a wall may have been pushed past the wall.
            self.keep_between_walls(block);
        }
    }
}
