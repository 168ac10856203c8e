//! Particles, in blocks that are computed together, grouped by material so that the loops over them have no
//! branches.

use std::ops::Range;

use crate::linalg::{LANES, Lanes, Matrix, Vector};
use crate::material::{Constitutive, Elastic, Sand, State, Water};

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
    /// Frames at rest [-]; counted where regions may sleep.
    pub calm: f32,
    pub activity: Activity,
    pub state: S,
}

/// What a particle takes part in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Activity {
    #[default]
    Awake,
    /// Asleep, but near to awake particles: still carries and pushes.
    Border,
    Asleep,
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
    pub calm: Lanes,
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
            calm: [0.0; LANES],
            state: like.state.splat(),
            count: 0,
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

/// Blocks in the order of grid rows.
#[derive(Debug, Clone)]
pub struct Sorted<const D: usize, S: State> {
    pub blocks: Vec<Block<D, S>>,
    /// The other half of each sort; its content means nothing.
    pub(crate) scratch: Vec<Block<D, S>>,
    /// Where the particles of each slab are; empty before the first sort.
    pub(crate) runs: Vec<Run>,
}

impl<const D: usize, S: State> Sorted<D, S> {
    const EMPTY: Self = Self {
        blocks: Vec::new(),
        scratch: Vec::new(),
        runs: Vec::new(),
    };

    /// The blocks of one slab.
    pub fn of_slab(&self, slab: usize) -> &[Block<D, S>] {
        &self.blocks[self.runs[slab].blocks()]
    }

    fn copy_from(&mut self, from: &Self) {
        self.blocks.clone_from(&from.blocks);
        self.runs.clone_from(&from.runs);
    }
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

/// All particles of one material.
#[derive(Debug, Clone)]
pub struct Group<const D: usize, M: Constitutive<D>> {
    pub material: M,
    pub wall_friction: f32,
    pub awake: Sorted<D, M::State>,
    pub border: Sorted<D, M::State>,
    /// In no order.
    pub asleep: Vec<Block<D, M::State>>,
}

impl<const D: usize, M: Constitutive<D>> Group<D, M> {
    pub fn new(material: M, wall_friction: f32, particles: &[Particle<D, M::State>]) -> Self {
        let mut group = Self {
            material,
            wall_friction,
            awake: Sorted::EMPTY,
            border: Sorted::EMPTY,
            asleep: Vec::new(),
        };
        group.append(particles);
        group
    }

    /// Removes all particles.
    pub fn clear(&mut self) {
        (self.awake, self.border) = (Sorted::EMPTY, Sorted::EMPTY);
        self.asleep.clear();
    }

    /// Puts particles, in this order, behind the others of their activity. Needs a sort afterwards.
    pub fn append(&mut self, particles: &[Particle<D, M::State>]) {
        for activity in [Activity::Awake, Activity::Border, Activity::Asleep] {
            let mine: Vec<_> = particles
                .iter()
                .filter(|p| p.activity == activity)
                .collect();
            let blocks: Vec<_> = mine
                .chunks(LANES)
                .map(|chunk| self.block_of(chunk))
                .collect();
            match activity {
                Activity::Awake => self.awake.blocks.extend(blocks),
                Activity::Border => self.border.blocks.extend(blocks),
                Activity::Asleep => self.asleep.extend(blocks),
            }
        }
        self.awake.runs.clear();
        self.border.runs.clear();
    }

    fn block_of(&self, particles: &[&Particle<D, M::State>]) -> Block<D, M::State> {
        let mut block = self.vacant_like(particles[0]);
        (particles.iter().enumerate()).for_each(|(lane, particle)| block.set(lane, particle));
        block.count = particles.len();
        block
    }

    /// A block without particles whose lanes rest where this particle is.
    pub fn vacant_like(&self, particle: &Particle<D, M::State>) -> Block<D, M::State> {
        Block::empty(&Particle {
            state: self.material.initial_state(1.0),
            ..*particle
        })
    }

    /// All blocks, with what their particles take part in.
    pub fn blocks(&self) -> impl Iterator<Item = (&Block<D, M::State>, Activity)> {
        let awake = self
            .awake
            .blocks
            .iter()
            .map(|block| (block, Activity::Awake));
        let border = self
            .border
            .blocks
            .iter()
            .map(|block| (block, Activity::Border));
        let asleep = self.asleep.iter().map(|block| (block, Activity::Asleep));
        awake.chain(border).chain(asleep)
    }

    pub fn particles(&self) -> impl Iterator<Item = Particle<D, M::State>> + '_ {
        let of_block = |(block, activity): (&Block<D, M::State>, Activity)| {
            let block = *block;
            (0..block.count).map(move |lane| block.get(lane, activity))
        };
        self.blocks().flat_map(of_block)
    }

    pub fn len(&self) -> usize {
        self.blocks().map(|(block, _)| block.count).sum()
    }

    fn copy_from(&mut self, from: &Self) {
        self.awake.copy_from(&from.awake);
        self.border.copy_from(&from.border);
        self.asleep.clone_from(&from.asleep);
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
            (Self::Water(to), Self::Water(from)) => to.copy_from(from),
            (Self::Sand(to), Self::Sand(from)) => to.copy_from(from),
            (Self::Elastic(to), Self::Elastic(from)) => to.copy_from(from),
            _ => unreachable!("the phases of a solver keep their order"),
        }
    }
}

/// Runs one expression on the group of whichever material.
#[macro_export]
macro_rules! with_group {
    ($phase:expr, $group:ident => $body:expr) => {
        match $phase {
            $crate::particles::Phase::Water($group) => $body,
            $crate::particles::Phase::Sand($group) => $body,
            $crate::particles::Phase::Elastic($group) => $body,
        }
    };
}
