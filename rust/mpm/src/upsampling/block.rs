//! Blocks of shown particles for vector instructions.

use crate::linalg::{LANES, Lanes, Vector};

/// A shown particle.
#[derive(Debug, Clone, Copy)]
pub struct Shown<const D: usize> {
    /// Position [m].
    pub x: Vector<D>,
    /// Mean velocity since the update before [m/s]; that of free flight away from coarse particles.
    pub v: Vector<D>,
    /// [kg]
    pub mass: f32,
    /// Rest volume over that of a cell of the scene's grid [-].
    pub volume: f32,
    /// Index into the materials.
    pub material: u8,
}

/// Up to `LANES` shown particles, one array for each component.
///
/// Lanes behind the last particle repeat the position of the first with mass and volume 0.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub struct Block<const D: usize> {
    pub x: [Lanes; D],
    pub v: [Lanes; D],
    pub mass: Lanes,
    pub volume: Lanes,
    pub material: [u8; LANES],
}

impl<const D: usize> Block<D> {
    /// `particles` are 1 to `LANES`.
    pub fn new(particles: &[Shown<D>]) -> Self {
        let first = Shown {
            v: Vector::zeros(),
            mass: 0.0,
            volume: 0.0,
            ..particles[0]
        };
        let at = |lane: usize| particles.get(lane).unwrap_or(&first);
        Self {
            x: std::array::from_fn(|axis| std::array::from_fn(|lane| at(lane).x[axis])),
            v: std::array::from_fn(|axis| std::array::from_fn(|lane| at(lane).v[axis])),
            mass: std::array::from_fn(|lane| at(lane).mass),
            volume: std::array::from_fn(|lane| at(lane).volume),
            material: std::array::from_fn(|lane| at(lane).material),
        }
    }

    pub fn get(&self, lane: usize) -> Shown<D> {
        Shown {
            x: self.position(lane),
            v: self.velocity(lane),
            mass: self.mass[lane],
            volume: self.volume[lane],
            material: self.material[lane],
        }
    }

    #[inline(always)]
    pub fn position(&self, lane: usize) -> Vector<D> {
        Vector::from_fn(|axis, _| self.x[axis][lane])
    }

    #[inline(always)]
    pub fn velocity(&self, lane: usize) -> Vector<D> {
        Vector::from_fn(|axis, _| self.v[axis][lane])
    }

    #[inline(always)]
    pub fn set(&mut self, lane: usize, x: &Vector<D>, v: &Vector<D>) {
        for axis in 0..D {
            self.x[axis][lane] = x[axis];
            self.v[axis][lane] = v[axis];
        }
    }
}

/// Groups particles into blocks, in order.
pub fn blocks<const D: usize>(particles: &[Shown<D>]) -> Vec<Block<D>> {
    particles.chunks(LANES).map(Block::new).collect()
}

/// Returns the first `count` particles of blocks.
pub fn particles<const D: usize>(blocks: &[Block<D>], count: usize) -> Vec<Shown<D>> {
    (0..count)
        .map(|index| blocks[index / LANES].get(index % LANES))
        .collect()
}
