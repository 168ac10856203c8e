//! Particles, in blocks that are computed together, grouped by material so that the loops over them have no
//! branches.

use std::ops::Range;

use crate::lanes::{LANES, Lanes};
use crate::material::{Constitutive, Elastic, Sand, State, Water};
use crate::math::{Matrix, Vector};

/// One material point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle<const D: usize, S> {
    /// Position [m].
    pub x: Vector<D>,
    /// Velocity [m/s].
    pub v: Vector<D>,
    /// APIC matrix C [1/s].
    pub affine: Matrix<D>,
    /// [kg]
    pub mass: f32,
    /// Rest volume [m^D].
    pub volume: f32,
    /// Index in the caller's order.
    pub id: u32,
    pub state: S,
}

/// Up to `LANES` particles, one array for each of their numbers.
///
/// Lanes from `count` on hold a particle without mass that rests where the first one was: they are computed
/// like the others, touch no node, and stay sound.
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
    pub state: S::Block,
    pub count: usize,
}

impl<const D: usize, S: State> Block<D, S> {
    /// A block without particles; `like` says where its lanes rest and in which state.
    pub fn empty(like: &Particle<D, S>) -> Self {
        let mut block = Self {
            x: [[0.0; LANES]; D],
            v: [[0.0; LANES]; D],
            affine: [[[0.0; LANES]; D]; D],
            mass: [0.0; LANES],
            volume: [0.0; LANES],
            id: [u32::MAX; LANES],
            state: like.state.splat(),
            count: 0,
        };
        for axis in 0..D {
            block.x[axis] = [like.x[axis]; LANES];
        }
        block
    }

    #[inline(always)]
    pub fn get(&self, lane: usize) -> Particle<D, S> {
        Particle {
            x: self.position(lane),
            v: Vector::from_fn(|axis, _| self.v[axis][lane]),
            affine: Matrix::from_fn(|row, column| self.affine[row][column][lane]),
            mass: self.mass[lane],
            volume: self.volume[lane],
            id: self.id[lane],
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
        particle.state.store(&mut self.state, lane);
    }

    #[inline(always)]
    pub fn position(&self, lane: usize) -> Vector<D> {
        Vector::from_fn(|axis, _| self.x[axis][lane])
    }
}

/// All particles of one material.
#[derive(Debug, Clone)]
pub struct Group<const D: usize, M: Constitutive<D>> {
    pub material: M,
    pub wall_friction: f32,
    pub blocks: Vec<Block<D, M::State>>,
    /// The other half of each sort; its content means nothing.
    pub(crate) scratch: Vec<Block<D, M::State>>,
    /// Where the particles of each slab are; empty before the first sort.
    pub(crate) runs: Vec<Run>,
}

/// Consecutive particles that begin with a new block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Run {
    pub first_block: usize,
    pub particles: usize,
}

impl Run {
    pub fn blocks(self) -> Range<usize> {
        self.first_block..self.first_block + self.particles.div_ceil(LANES)
    }
}

impl<const D: usize, M: Constitutive<D>> Group<D, M> {
    pub fn new(material: M, wall_friction: f32, particles: &[Particle<D, M::State>]) -> Self {
        let mut group = Self {
            material,
            wall_friction,
            blocks: Vec::new(),
            scratch: Vec::new(),
            runs: Vec::new(),
        };
        group.replace(particles);
        group
    }

    /// Puts other particles, in this order, into the place of all present ones.
    pub fn replace(&mut self, particles: &[Particle<D, M::State>]) {
        self.runs.clear();
        self.blocks.clear();
        self.blocks.extend(particles.chunks(LANES).map(|chunk| {
            let resting = Particle {
                state: self.material.initial_state(1.0),
                ..chunk[0]
            };
            let mut block = Block::empty(&resting);
            (chunk.iter().enumerate()).for_each(|(lane, particle)| block.set(lane, particle));
            block.count = chunk.len();
            block
        }));
    }

    pub fn particles(&self) -> impl Iterator<Item = Particle<D, M::State>> + '_ {
        let of_block = |block: &'_ Block<D, M::State>| {
            let block = *block;
            (0..block.count).map(move |lane| block.get(lane))
        };
        self.blocks.iter().flat_map(of_block)
    }

    pub fn len(&self) -> usize {
        self.blocks.iter().map(|block| block.count).sum()
    }

    /// J of water, det F of solids [-].
    pub fn volume_ratio(&self, particle: &Particle<D, M::State>) -> f32 {
        self.material.volume_ratio(&particle.state)
    }

    /// Stored elastic energy [J].
    pub fn elastic_energy(&self, particle: &Particle<D, M::State>) -> f32 {
        self.material.energy_density(&particle.state) * particle.volume
    }
}

/// A group of any material.
#[derive(Debug, Clone)]
pub enum Phase<const D: usize> {
    Water(Group<D, Water>),
    Sand(Group<D, Sand>),
    Elastic(Group<D, Elastic>),
}

impl<const D: usize> Phase<D> {
    /// Takes over the particles of a phase of the same material without allocating.
    pub fn copy_particles(&mut self, from: &Self) {
        match (self, from) {
            (Self::Water(to), Self::Water(from)) => to.blocks.clone_from(&from.blocks),
            (Self::Sand(to), Self::Sand(from)) => to.blocks.clone_from(&from.blocks),
            (Self::Elastic(to), Self::Elastic(from)) => to.blocks.clone_from(&from.blocks),
            _ => unreachable!("the phases of a solver keep their order"),
        }
    }
}

/// Runs one expression on the group of whichever material.
#[macro_export]
macro_rules! with_group {
    ($phase:expr, $group:ident => $body:expr) => {
        match $phase {
            $crate::particle::Phase::Water($group) => $body,
            $crate::particle::Phase::Sand($group) => $body,
            $crate::particle::Phase::Elastic($group) => $body,
        }
    };
}
