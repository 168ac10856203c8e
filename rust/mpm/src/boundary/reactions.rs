//! Impulses of the material on walls and obstacles, and their moments, over some time.
//!
//! Each slab of the grid has sums of its own, so that their order does not depend on threads.

use super::edge::EdgeLine;
use super::lines::{Line, Probe};
use crate::linalg::Vector;

/// An impulse and its moment about the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrench<const D: usize> {
    /// [kg m/s]; in 2D per metre of depth.
    pub impulse: [f64; D],
    /// [kg m^2/s]; in 2D the last component alone.
    pub moment: [f64; 3],
}

impl<const D: usize> Wrench<D> {
    pub const NONE: Self = Self {
        impulse: [0.0; D],
        moment: [0.0; 3],
    };

    /// Adds an impulse that acts at `x` [m].
    #[inline(always)]
    pub fn add(&mut self, x: &[f64; D], impulse: &[f64; D]) {
        let cross = |a: usize, b: usize| x[a] * impulse[b] - x[b] * impulse[a];
        self.moment[2] += cross(0, 1);
        if D == 3 {
            self.moment[0] += cross(1, 2);
            self.moment[1] += cross(2, 0);
        }
        for axis in 0..D {
            self.impulse[axis] += impulse[axis];
        }
    }

    pub fn join(&mut self, other: &Self) {
        let sums = self.impulse.iter_mut().chain(&mut self.moment);
        let parts = other.impulse.iter().chain(&other.moment);
        sums.zip(parts).for_each(|(sum, part)| *sum += part);
    }
}

/// The impulses that walls and obstacles give to the material; those on them are opposite.
#[derive(Debug, Clone)]
pub struct Reactions<const D: usize> {
    /// Of the lower and the upper wall across each axis.
    pub walls: [[Wrench<D>; 2]; D],
    pub obstacles: Vec<Wrench<D>>,
    /// Of rigid bodies, which always follow them.
    pub bodies: Vec<Wrench<D>>,
    /// Where material touches rigid bodies.
    pub probes: Vec<Probe<D>>,
    pub(super) found: Found<D>,
    /// Else nothing is added, but of rigid bodies.
    pub kept: bool,
}

impl<const D: usize> Reactions<D> {
    /// Nothing, in a scene with so many obstacles and rigid bodies.
    pub fn none(obstacles: usize, bodies: usize) -> Self {
        Self {
            walls: [[Wrench::NONE; 2]; D],
            obstacles: vec![Wrench::NONE; obstacles],
            bodies: vec![Wrench::NONE; bodies],
            probes: Vec::new(),
            found: Found::default(),
            kept: true,
        }
    }

    /// Forgets all impulses.
    pub fn clear(&mut self) {
        self.walls = [[Wrench::NONE; 2]; D];
        self.obstacles.fill(Wrench::NONE);
    }

    /// Forgets those of rigid bodies.
    pub fn clear_bodies(&mut self) {
        self.bodies.fill(Wrench::NONE);
        self.probes.clear();
    }

    /// Adds an impulse of an obstacle, or of a rigid body, at `x` [m].
    #[inline(always)]
    pub fn push(&mut self, obstacle: usize, x: &Vector<D>, impulse: &Vector<D>) {
        let count = self.obstacles.len();
        if !self.kept && obstacle < count {
            return;
        }
        let double = |v: &Vector<D>| std::array::from_fn(|axis| f64::from(v[axis]));
        let sum = if obstacle < count {
            &mut self.obstacles[obstacle]
        } else {
            &mut self.bodies[obstacle - count]
        };
        sum.add(&double(x), &double(impulse));
    }

    /// Adds the impulses of walls that changed the velocity of a particle at `x`, by components.
    pub fn hold(&mut self, x: &Vector<D>, mass: f32, change: &Vector<D>) {
        if !self.kept {
            return;
        }
        let x = std::array::from_fn(|axis| f64::from(x[axis]));
        for axis in 0..D {
            if change[axis] != 0.0 {
                let mut impulse = [0.0; D];
                impulse[axis] = f64::from(mass) * f64::from(change[axis]);
                self.walls[axis][usize::from(change[axis] < 0.0)].add(&x, &impulse);
            }
        }
    }

    /// Adds those of another part of the grid.
    pub fn join(&mut self, other: &Self) {
        let sums = self.walls.iter_mut().flatten().chain(&mut self.obstacles);
        let parts = other.walls.iter().flatten().chain(&other.obstacles);
        sums.zip(parts).for_each(|(sum, part)| sum.join(part));
    }

    /// The mean forces on walls and obstacles over some time [s]: a row for each wall, the lower one across the first axis
    /// first, and for each obstacle; D components [N], then the torque about the origin, 1 or 3 components [N m].
    pub fn forces(&self, time: f64) -> Vec<f64> {
        let rows = self.walls.iter().flatten().chain(&self.obstacles);
        let row = |wrench: &Wrench<D>| {
            let torque = if D == 3 { 0 } else { 2 };
            let numbers = wrench.impulse.into_iter();
            let numbers = numbers.chain(wrench.moment.into_iter().skip(torque));
            numbers
                .map(|number| 0.0 - number / time)
                .collect::<Vec<_>>()
        };
        rows.flat_map(row).collect()
    }
}

/// The lines across moving solids that a substep has found in some planes.
#[derive(Debug, Clone)]
pub struct Found<const D: usize> {
    /// By the axis along which they lie.
    pub lines: [Vec<Line<D>>; D],
    /// Those at edges of rigid bodies, which are not among the others.
    pub edges: Vec<EdgeLine<D>>,
}

impl<const D: usize> Default for Found<D> {
    fn default() -> Self {
        Self {
            lines: std::array::from_fn(|_| Vec::new()),
            edges: Vec::new(),
        }
    }
}

impl<const D: usize> Found<D> {
    pub fn clear(&mut self) {
        self.lines.iter_mut().for_each(Vec::clear);
        self.edges.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torques_follow_the_right_hand_rule() {
        let mut reactions = Reactions::<2>::none(1, 0);
        reactions.push(0, &Vector::<2>::new(2.0, 1.0), &Vector::<2>::new(0.0, -3.0));
        reactions.hold(
            &Vector::<2>::new(0.5, 0.0),
            2.0,
            &Vector::<2>::new(0.0, 4.0),
        );
        let mut sum = Reactions::none(1, 0);
        sum.join(&reactions);
        let forces = sum.forces(0.5);
        assert_eq!(forces[6..9], [0.0, -16.0, -8.0]);
        assert_eq!(forces[12..], [0.0, 6.0, 12.0]);
        let mut wrench = Wrench::<3>::NONE;
        wrench.add(&[0.0, 0.0, 2.0], &[1.0, 0.0, 0.0]);
        assert_eq!(wrench.moment, [0.0, 2.0, 0.0]);
    }
}
