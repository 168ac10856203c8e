//! Who reaches which nodes: nobody, one field, or several.

use super::layout::CHUNK;

/// Who reaches a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Holder {
    Nobody,
    One(u16),
    /// They have slots.
    Several {
        first_slot: u32,
    },
}

impl Holder {
    /// The field, where there is one alone.
    fn alone(self) -> Option<u16> {
        match self {
            Self::One(field) => Some(field),
            _ => None,
        }
    }

    #[inline(always)]
    fn first_slot(self) -> Option<usize> {
        match self {
            Self::Several { first_slot } => Some(first_slot as usize),
            _ => None,
        }
    }
}

/// One field on one chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Slot {
    pub chunk: u32,
    pub field: u16,
}

/// Where the slots are.
#[derive(Clone, Copy)]
pub struct FieldMap<'a> {
    /// Whether the first field is that of what flows; the others are elastic bodies.
    pub(super) flows: bool,
    /// By chunk; empty where the scene has a single field.
    pub(super) holders: &'a [Holder],
    /// By chunk, bit by bit: whether a stencil that starts at that node touches a slot.
    pub(super) near: &'a [u8],
    /// In ascending order.
    pub(super) slots: &'a [Slot],
}

/// Where a node of one field is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NodePlace {
    Grid,
    /// Number of the node among those of slots.
    Slot(usize),
    /// The field does not reach it.
    Nowhere,
}

/// Where three nodes of one field side by side are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowPlace {
    Grid,
    /// Number of the first node among those of slots; the others follow it.
    Slot(usize),
    /// Numbers of nodes among those of slots; None for one on the grid.
    Parts([Option<usize>; 3]),
}

impl RowPlace {
    /// The same with each number less by `first`.
    #[inline(always)]
    pub(super) fn from(self, first: usize) -> Self {
        match self {
            Self::Grid => Self::Grid,
            Self::Slot(node) => Self::Slot(node - first),
            Self::Parts(nodes) => Self::Parts(nodes.map(|node| node.map(|node| node - first))),
        }
    }

    /// Each node: its number among those of slots; None on the grid.
    #[inline(always)]
    pub fn each(self) -> [Option<usize>; 3] {
        match self {
            Self::Grid => [None; 3],
            Self::Slot(node) => [0, 1, 2].map(|step| Some(node + step)),
            Self::Parts(nodes) => nodes,
        }
    }
}

impl<'a> FieldMap<'a> {
    /// Whether a field is that of an elastic body.
    pub fn is_elastic(&self, field: u16) -> bool {
        !self.flows || field > 0
    }

    /// Whether there may be elastic bodies.
    pub fn any_elastic(&self) -> bool {
        !self.flows || !self.holders.is_empty()
    }

    /// Whether nothing that flows reaches a chunk.
    pub fn only_elastic(&self, chunk: usize) -> bool {
        let elastic = |holder: &Holder| holder.alone().is_some_and(|field| field > 0);
        !self.flows || self.holders.get(chunk).is_some_and(elastic)
    }

    /// The elastic body that reaches a chunk, where nothing else does.
    #[inline(always)]
    pub fn elastic_alone(&self, chunk: usize) -> Option<u16> {
        if self.holders.is_empty() {
            return (!self.flows).then_some(0);
        }
        let alone = self.holders[chunk].alone();
        alone.filter(|field| self.is_elastic(*field))
    }

    /// Whether a chunk has slots.
    pub fn is_shared(&self, chunk: usize) -> bool {
        self.holders[chunk].first_slot().is_some()
    }

    /// Whether the nodes of some chunks belong to one field alone, or to nobody.
    pub fn is_one<const N: usize>(&self, chunks: [usize; N]) -> bool {
        let mut holders = chunks.map(|chunk| self.holders[chunk]).into_iter();
        let Some(first) = holders.find(|holder| *holder != Holder::Nobody) else {
            return true;
        };
        let same = |holder: Holder| holder == Holder::Nobody || holder == first;
        first.first_slot().is_none() && holders.all(same)
    }

    /// The fields that reach a chunk. Where nobody is known, something may lie that flows.
    pub fn fields_of(&self, chunk: usize) -> impl Iterator<Item = u16> + use<'a> {
        let alone = match self.holders[chunk] {
            Holder::Nobody => Some(0),
            holder => holder.alone(),
        };
        let shared = self.slots_of(chunk).map(|(_, field)| field);
        alone.into_iter().chain(shared)
    }

    /// The slots of a chunk: their numbers, and their fields.
    fn slots_of(&self, chunk: usize) -> impl Iterator<Item = (usize, u16)> + use<'a> {
        let first = self.holders[chunk].first_slot();
        let slots = self.slots.iter().enumerate();
        let mine = slots.skip(first.unwrap_or(self.slots.len()));
        mine.take_while(move |(_, slot)| slot.chunk as usize == chunk)
            .map(|(number, slot)| (number, slot.field))
    }

    /// Where a field has its node that stands for one of the grid.
    pub fn place(&self, index: usize, field: u16) -> NodePlace {
        let chunk = index / CHUNK;
        match self.holders[chunk] {
            Holder::Several { .. } => {
                let slot = self.slots_of(chunk).find(|(_, other)| *other == field);
                slot.map_or(NodePlace::Nowhere, |(number, _)| {
                    NodePlace::Slot(number * CHUNK + index % CHUNK)
                })
            }
            Holder::One(other) if other != field => NodePlace::Nowhere,
            _ => NodePlace::Grid,
        }
    }

    /// Whether a stencil that starts at this node may touch a slot.
    #[inline(always)]
    pub(super) fn near(&self, start: usize) -> bool {
        self.near[start / CHUNK] >> (start % CHUNK) & 1 != 0
    }

    /// The node of a field that stands for a node of the grid; None where the grid's own node does. The field reaches it.
    #[inline(always)]
    fn node(&self, index: usize, field: u16) -> Option<usize> {
        let chunk = index / CHUNK;
        let mut slot = self.holders[chunk].first_slot()?;
        while self.slots[slot].field != field {
            slot += 1;
        }
        debug_assert_eq!(self.slots[slot].chunk as usize, chunk);
        Some(slot * CHUNK + index % CHUNK)
    }

    /// The same for three nodes side by side.
    #[inline(always)]
    pub(super) fn row(&self, index: usize, field: u16) -> RowPlace {
        let first = self.node(index, field);
        // Nodes of the first one's chunk follow it.
        let left = CHUNK - index % CHUNK;
        if left >= 3 {
            return first.map_or(RowPlace::Grid, RowPlace::Slot);
        }
        let next = self.node(index + left, field);
        if first.is_none() && next.is_none() {
            return RowPlace::Grid;
        }
        RowPlace::Parts(std::array::from_fn(|step| {
            if step < left {
                first.map(|node| node + step)
            } else {
                next.map(|node| node + step - left)
            }
        }))
    }
}
