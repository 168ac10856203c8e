//! Carried particles stay between the walls and outside of obstacles.

use super::block::Block;
use crate::boundary::{Obstacles, Walls};
use crate::grid::{Layout, Stencils};
use crate::linalg::{LANES, Vector};

/// What is put back behind a wall lies within a layer of so many cells.
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
    /// Puts back what has passed a wall, the farther inside the farther it had passed.
    ///
    /// Put onto the wall itself, all that passes two walls at once would end in one point, where no density parts it.
    pub fn keep_between_walls(&self, block: &mut Block<D>) {
        let mut outside = false;
        for axis in 0..D {
            let (lower, upper) = (self.walls.lower[axis], self.walls.upper[axis]);
            for x in block.x[axis] {
                outside |= !(x >= lower && x <= upper);
            }
        }
        if outside {
            for lane in 0..LANES {
                self.put_back(block, lane);
            }
        }
    }

    #[cold]
    fn put_back(&self, block: &mut Block<D>, lane: usize) {
        let mut particle = block.get(lane);
        for axis in 0..D {
            let (lower, upper) = (self.walls.lower[axis], self.walls.upper[axis]);
            // A velocity without bound, as of a network gone wrong, must not make a position that is no number.
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

    /// Moves what got into an obstacle back to its surface.
    pub fn push_out(&self, block: &mut Block<D>) {
        if !self.obstacles.any() {
            return;
        }
        let stencils = Stencils::at(&block.x, &self.layout);
        for lane in 0..LANES {
            if self.obstacles.near(stencils.start[lane] as usize) {
                let mut particle = block.get(lane);
                let friction = self.frictions[usize::from(particle.material)];
                self.obstacles
                    .push_out(&mut particle.x, &mut particle.v, friction);
                block.set(lane, &particle.x, &particle.v);
            }
        }
    }

    /// Both, for all particles of some blocks.
    pub fn hold(&self, block: &mut Block<D>) {
        self.keep_between_walls(block);
        if self.obstacles.any() {
            self.push_out(block);
            // What lay between an obstacle and a wall.
            self.keep_between_walls(block);
        }
    }
}
