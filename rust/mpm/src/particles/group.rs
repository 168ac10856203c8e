//! Particles grouped by material, so that the loops over them have no branches.

use std::ops::Range;

use super::block::Block;
use super::particle::{Activity, Particle};
use crate::linalg::LANES;
use crate::material::{Constitutive, Elastic, Liquid, Sand, State, Water};

/// Blocks in the order of grid rows.
#[derive(Debug, Clone)]
pub struct Sorted<const D: usize, S: State> {
    pub blocks: Vec<Block<D, S>>,
    /// The other half of each sort; its content means nothing.
    pub(super) scratch: Vec<Block<D, S>>,
    /// Whether the latest sort moved something; else it left `blocks` as they were.
    pub(super) moved: bool,
    /// Where the particles of each slab are; empty before the first sort.
    pub(super) runs: Vec<Run>,
}

impl<const D: usize, S: State> Sorted<D, S> {
    const EMPTY: Self = Self {
        blocks: Vec::new(),
        scratch: Vec::new(),
        moved: false,
        runs: Vec::new(),
    };

    /// The blocks slab by slab.
    pub fn by_slab(&mut self) -> Vec<&mut [Block<D, S>]> {
        let mut rest = &mut self.blocks[..];
        let cut = |run: &Run| {
            let (mine, others) = std::mem::take(&mut rest).split_at_mut(run.blocks().len());
            rest = others;
            mine
        };
        self.runs.iter().map(cut).collect()
    }

    /// Gives the memory of these blocks to the next sort of `to`, and takes over where its particles are in its own.
    fn lend(&mut self, to: &mut Self) {
        std::mem::swap(&mut self.blocks, &mut to.scratch);
        self.runs.clone_from(&to.runs);
    }

    /// Takes the blocks that the sort of `sorted` has read from.
    fn take_unsorted(&mut self, sorted: &mut Self) {
        if sorted.moved {
            std::mem::swap(&mut self.blocks, &mut sorted.scratch);
        } else {
            self.blocks.clone_from(&sorted.blocks);
        }
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

/// Bodies with this number and above come out of the emitters, in their order.
pub const EMITTED: u32 = 1 << 31;

/// All particles of one material; of elastic solids, all of one body.
#[derive(Debug, Clone)]
pub struct Group<const D: usize, M: Constitutive<D>> {
    /// Number of the material in the scene.
    pub index: u8,
    /// Number of the body; 0 for materials that flow.
    pub body: u32,
    /// Number of the velocity field: all that flows shares the first one, each elastic body has its own.
    pub field: u16,
    pub material: M,
    pub wall_friction: f32,
    pub awake: Sorted<D, M::State>,
    pub border: Sorted<D, M::State>,
    /// Sleeping particles far from awake ones, in no order.
    pub asleep: Vec<Block<D, M::State>>,
}

impl<const D: usize, M: Constitutive<D>> Group<D, M> {
    pub fn new(material: M, wall_friction: f32, particles: &[Particle<D, M::State>]) -> Self {
        let mut group = Self {
            index: 0,
            body: 0,
            field: 0,
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

    /// All blocks, with the activity of their particles.
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
        self.material.volume_ratios(&particle.state.splat())[0]
    }

    /// Pressure of the Cauchy stress, -tr(tau) / (D J) [Pa]: above 0 where the particle is compressed.
    pub fn pressure(&self, particle: &Particle<D, M::State>) -> f32 {
        let states = particle.state.splat();
        let stress = self.material.kirchhoff_stress(&states).diagonal;
        let trace: f32 = stress.iter().map(|along| along[0]).sum();
        // Without stress plus zero, not minus zero.
        0.0 - trace / (D as f32 * self.material.volume_ratios(&states)[0])
    }

    pub fn corrects_volume(&self) -> bool {
        self.material.corrects_volume()
    }

    /// Stored elastic energy [J].
    pub fn elastic_energy(&self, particle: &Particle<D, M::State>) -> f32 {
        self.material.energy_density(&particle.state) * particle.volume
    }
}

/// A group of any material.
#[derive(Debug, Clone)]
pub enum MaterialGroup<const D: usize> {
    Water(Group<D, Water>),
    Sand(Group<D, Sand>),
    Elastic(Group<D, Elastic>),
    Liquid(Group<D, Liquid>),
}

/// Runs one expression on two groups of the same material.
macro_rules! with_both {
    ($one:expr, $other:expr, ($a:ident, $b:ident) => $body:expr) => {
        match ($one, $other) {
            (MaterialGroup::Water($a), MaterialGroup::Water($b)) => $body,
            (MaterialGroup::Sand($a), MaterialGroup::Sand($b)) => $body,
            (MaterialGroup::Elastic($a), MaterialGroup::Elastic($b)) => $body,
            (MaterialGroup::Liquid($a), MaterialGroup::Liquid($b)) => $body,
            _ => unreachable!("the groups of a solver keep their order"),
        }
    };
}

impl<const D: usize> MaterialGroup<D> {
    /// Whether it is a body of its own.
    pub fn is_elastic(&self) -> bool {
        matches!(self, Self::Elastic(_))
    }

    /// Takes over the particles of a group of the same material without allocating.
    pub fn copy_particles(&mut self, from: &Self) {
        with_both!(self, from, (to, from) => to.copy_from(from));
    }

    /// Gives memory to the next sort of another group, to be followed by `take_unsorted`.
    pub fn lend(&mut self, to: &mut Self) {
        with_both!(self, to, (lender, to) => {
            lender.awake.lend(&mut to.awake);
            lender.border.lend(&mut to.border);
        });
    }

    /// Takes the particles as they were before the sort of another group: a copy that costs nothing.
    pub fn take_unsorted(&mut self, sorted: &mut Self) {
        with_both!(self, sorted, (to, sorted) => {
            to.awake.take_unsorted(&mut sorted.awake);
            to.border.take_unsorted(&mut sorted.border);
            to.asleep.clone_from(&sorted.asleep);
        });
    }
}

/// Runs one expression on the group of whichever material.
macro_rules! with_group {
    ($any:expr, $group:ident => $body:expr) => {
        match $any {
            $crate::particles::MaterialGroup::Water($group) => $body,
            $crate::particles::MaterialGroup::Sand($group) => $body,
            $crate::particles::MaterialGroup::Elastic($group) => $body,
            $crate::particles::MaterialGroup::Liquid($group) => $body,
        }
    };
}
pub(crate) use with_group;
