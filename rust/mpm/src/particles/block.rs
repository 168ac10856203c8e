//! Particles that are computed together.

use super::particle::{Activity, Particle};
use crate::linalg::{LANES, Lanes, Matrix, Vector};
use crate::material::State;

/// Up to `LANES` particles, one array for each of their numbers.
///
/// Lanes from `count` on contain a particle without mass, at rest at the initial position of the first one. They are
/// computed like the others, touch no node, and stay finite.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub struct Block<const D: usize, S: State> {
    pub x: [Lanes; D],
    pub v: [Lanes; D],
    /// By row and column.
    pub affine: [[Lanes; D]; D],
    pub mass: Lanes,
    pub volume: Lanes,
    pub id: [u32; LANES],
    pub calm: Lanes,
    pub state: S::Block,
    pub count: usize,
    /// Whether one of them may touch an obstacle before the next sort; false without obstacles.
    pub near_solid: bool,
}

impl<const D: usize, S: State> Block<D, S> {
    /// A block without particles; its lanes have the position and state of `like`.
    pub fn empty(like: &Particle<D, S>) -> Self {
        let mut block = Self {
            x: [[0.0; LANES]; D],
            v: [[0.0; LANES]; D],
            affine: [[[0.0; LANES]; D]; D],
            mass: [0.0; LANES],
            volume: [0.0; LANES],
            id: [u32::MAX; LANES],
            calm: [0.0; LANES],
            state: like.state.splat(),
            count: 0,
            near_solid: false,
        };
        for axis in 0..D {
            block.x[axis] = [like.x[axis]; LANES];
        }
        block
    }

    /// `activity` is where the block stands in its group.
    #[inline(always)]
    pub fn get(&self, lane: usize, activity: Activity) -> Particle<D, S> {
        Particle {
            x: self.position(lane),
            v: Vector::from_fn(|axis, _| self.v[axis][lane]),
            affine: Matrix::from_fn(|row, column| self.affine[row][column][lane]),
            mass: self.mass[lane],
            volume: self.volume[lane],
            id: self.id[lane],
            calm: self.calm[lane],
            activity,
            state: S::load(&self.state, lane),
        }
    }

    #[inline(always)]
    pub fn set(&mut self, lane: usize, particle: &Particle<D, S>) {
        for row in 0..D {
            self.x[row][lane] = particle.x[row];
            self.v[row][lane] = particle.v[row];
            for column in 0..D {
                self.affine[row][column][lane] = particle.affine[(row, column)];
            }
        }
        self.mass[lane] = particle.mass;
        self.volume[lane] = particle.volume;
        self.id[lane] = particle.id;
        self.calm[lane] = particle.calm;
        particle.state.store(&mut self.state, lane);
    }

    #[inline(always)]
    pub fn position(&self, lane: usize) -> Vector<D> {
        Vector::from_fn(|axis, _| self.x[axis][lane])
    }
}
