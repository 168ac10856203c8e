//! Velocities of bodies that meet: one field for each, kept only where several of them reach the same nodes.
//!
//! Elsewhere the nodes of the grid carry the one body that reaches them. A *slot* is one field on one chunk of nodes.
//! Slots are found at each sort, for all nodes in reach before the next, so they are a function of the particles alone.
//! On chunks with slots nothing is written to the grid itself; its nodes stay empty there.

use std::marker::PhantomData;
use std::ops::Range;
use std::slice;

use wide::f32x4;

use super::layout::{CHUNK, Layout, MARGIN, Place};
use super::view::View;

/// Who reaches a chunk: nobody, one field, or several, which then have slots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Holder(u32);

impl Holder {
    const NOBODY: Self = Self(u32::MAX);
    const SHARED: u32 = 1 << 31;

    fn one(field: u16) -> Self {
        Self(u32::from(field))
    }

    fn shared(first_slot: usize) -> Self {
        Self(first_slot as u32 | Self::SHARED)
    }

    fn is_shared(self) -> bool {
        self != Self::NOBODY && self.0 & Self::SHARED != 0
    }

    /// The field, where there is one alone.
    fn alone(self) -> Option<u16> {
        (self.0 & Self::SHARED == 0).then_some(self.0 as u16)
    }

    fn first_slot(self) -> Option<usize> {
        self.is_shared()
            .then_some((self.0 & !Self::SHARED) as usize)
    }
}

/// One field on one chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Slot {
    pub chunk: u32,
    pub field: u16,
}

/// Additional quantities of the nodes of slots.
#[derive(Debug, Clone, Copy)]
pub struct FieldSums {
    /// Wall friction times mass: where materials differ in friction.
    pub friction: bool,
    /// Rest volume: where materials of one field differ in density.
    pub volume: bool,
}

/// The fields of a scene.
#[derive(Debug, Clone)]
pub struct Fields<const D: usize> {
    layout: Layout<D>,
    sums: FieldSums,
    /// Whether the first field is that of what flows; the others are elastic bodies.
    flows: bool,
    /// By chunk; empty where the scene has a single field.
    holders: Vec<Holder>,
    /// By chunk, bit by bit: whether a stencil that starts at that node touches a slot.
    near: Vec<u8>,
    /// Chunks with a holder.
    held: Vec<u32>,
    /// In ascending order.
    slots: Vec<Slot>,
    /// The first slot of each plane, and behind the last plane their number.
    starts: Vec<usize>,
    /// As those of the grid.
    nodes: Vec<f32x4>,
    /// Gradients of the masses [kg/cell] in lanes 0..D.
    slopes: Vec<f32x4>,
    friction_mass: Vec<f32>,
    volume: Vec<f32>,
    /// See `Grid`.
    old: Vec<f32>,
    keeps_old: bool,
}

impl<const D: usize> Fields<D> {
    /// For a grid on which so many fields may meet, the first of which is what flows or else an elastic body.
    pub fn new(layout: Layout<D>, count: usize, flows: bool, sums: FieldSums) -> Self {
        let chunks = if count < 2 {
            0
        } else {
            layout.row_count() * layout.row_length / CHUNK
        };
        Self {
            layout,
            sums,
            flows,
            holders: vec![Holder::NOBODY; chunks],
            near: vec![0; chunks],
            held: Vec::new(),
            slots: Vec::new(),
            starts: vec![0; layout.planes() + 1],
            nodes: Vec::new(),
            slopes: Vec::new(),
            friction_mass: Vec::new(),
            volume: Vec::new(),
            old: Vec::new(),
            keeps_old: false,
        }
    }

    /// Keeps the velocities before forces from now on.
    pub(super) fn keep_old(&mut self) {
        self.keeps_old = true;
    }

    /// Whether several fields can meet at all.
    pub fn any(&self) -> bool {
        !self.holders.is_empty()
    }

    /// Whether some meet before the next sort.
    pub fn meet(&self) -> bool {
        !self.slots.is_empty()
    }

    /// Whether a chunk has slots.
    pub fn is_shared(&self, chunk: usize) -> bool {
        self.holders
            .get(chunk)
            .is_some_and(|holder| holder.is_shared())
    }

    /// Whether nothing that flows reaches a chunk.
    pub fn only_elastic(&self, chunk: usize) -> bool {
        self.map().only_elastic(chunk)
    }

    fn map(&self) -> FieldMap<'_> {
        FieldMap {
            flows: self.flows,
            holders: &self.holders,
            near: &self.near,
            slots: &self.slots,
        }
    }

    /// Forgets all slots.
    pub fn clear(&mut self) {
        for chunk in self.held.drain(..) {
            self.holders[chunk as usize] = Holder::NOBODY;
        }
        for slot in self.slots.drain(..) {
            for (start, _) in starts_near(&self.layout, slot.chunk as usize) {
                if let Some(near) = self.near.get_mut(start) {
                    *near = 0;
                }
            }
        }
    }

    /// Adds the stencils of a field that start at some places, with all nodes that they reach before the next sort.
    pub fn add(&mut self, field: u16, places: impl Iterator<Item = Place>) {
        let mut previous = None;
        for place in places {
            if previous != Some(place) {
                previous = Some(place);
                self.add_place(field, place);
            }
        }
    }

    fn add_place(&mut self, field: u16, place: Place) {
        let around = |first: u16| first as usize - MARGIN..first as usize + MARGIN + 3;
        let rows = if D == 3 { around(place.row) } else { 0..1 };
        let columns = around(place.column);
        let chunks_per_row = self.layout.row_length / CHUNK;
        for plane in around(place.plane) {
            for row in rows.clone() {
                let row = plane * self.layout.rows_per_plane() + row;
                for chunk in columns.start / CHUNK..=(columns.end - 1) / CHUNK {
                    self.hold(row * chunks_per_row + chunk, field);
                }
            }
        }
    }

    #[inline(always)]
    fn hold(&mut self, chunk: usize, field: u16) {
        let holder = self.holders[chunk];
        if holder == Holder::one(field) {
            return;
        }
        if holder == Holder::NOBODY {
            self.holders[chunk] = Holder::one(field);
            self.held.push(chunk as u32);
            return;
        }
        self.share(chunk);
        self.push(chunk, field);
    }

    /// Gives the only field of a chunk a slot there.
    fn share(&mut self, chunk: usize) -> bool {
        let Some(field) = self.holders[chunk].alone() else {
            return false;
        };
        self.holders[chunk] = Holder::shared(0);
        self.push(chunk, field);
        true
    }

    fn push(&mut self, chunk: usize, field: u16) {
        let slot = Slot {
            chunk: chunk as u32,
            field,
        };
        if self.slots.last() != Some(&slot) {
            self.slots.push(slot);
        }
    }

    /// Makes the slots ready, after all fields were added. Where one node of a line across a wall has slots, all have:
    /// `lines` returns the chunks of the other nodes of such lines.
    pub fn finish(&mut self, lines: impl Fn(usize, &mut Vec<usize>)) {
        let mut others = Vec::new();
        let mut next = 0;
        while next < self.slots.len() {
            others.clear();
            lines(self.slots[next].chunk as usize, &mut others);
            for &chunk in &others {
                self.share(chunk);
            }
            next += 1;
        }
        self.slots.sort_unstable();
        self.slots.dedup();
        let chunks_per_plane = self.layout.nodes_per_plane() / CHUNK;
        for plane in 0..=self.layout.planes() {
            let first = (plane * chunks_per_plane) as u32;
            self.starts[plane] = self.slots.partition_point(|slot| slot.chunk < first);
        }
        for index in (0..self.slots.len()).rev() {
            let chunk = self.slots[index].chunk as usize;
            self.holders[chunk] = Holder::shared(index);
            for (start, nodes) in starts_near(&self.layout, chunk) {
                if let Some(near) = self.near.get_mut(start) {
                    *near |= nodes;
                }
            }
        }
        let count = self.slots.len() * CHUNK;
        let resize = |numbers: &mut Vec<f32>, of_node: usize| {
            numbers.clear();
            numbers.resize(count * of_node, 0.0);
        };
        resize(&mut self.friction_mass, usize::from(self.sums.friction));
        resize(&mut self.volume, usize::from(self.sums.volume));
        resize(
            &mut self.old,
            usize::from(self.keeps_old) * Layout::<D>::OLD,
        );
        for nodes in [&mut self.nodes, &mut self.slopes] {
            nodes.clear();
            nodes.resize(count, f32x4::ZERO);
        }
    }

    /// Lends the fields to threads that take turns on their planes.
    pub(super) fn shared(&mut self) -> SharedFields<'_, D> {
        SharedFields {
            map: FieldMap {
                flows: self.flows,
                holders: &self.holders,
                near: &self.near,
                slots: &self.slots,
            },
            starts: &self.starts,
            nodes: self.nodes.as_mut_ptr(),
            slopes: self.slopes.as_mut_ptr(),
            friction_mass: (!self.friction_mass.is_empty())
                .then_some(self.friction_mass.as_mut_ptr()),
            volume: (!self.volume.is_empty()).then_some(self.volume.as_mut_ptr()),
            old: (!self.old.is_empty()).then_some(self.old.as_mut_ptr()),
            borrowed: PhantomData,
        }
    }
}

/// The chunks where stencils start that touch a chunk, and bit by bit the nodes where they do.
fn starts_near<const D: usize>(
    layout: &Layout<D>,
    chunk: usize,
) -> impl Iterator<Item = (usize, u8)> + use<D> {
    let offsets: [[usize; 3]; 3] = std::array::from_fn(|a| {
        std::array::from_fn(|b| {
            let b = if D == 3 { b } else { 0 };
            layout.stencil_row([a, b]) / CHUNK
        })
    });
    const { assert!(CHUNK == u8::BITS as usize) };
    // Of three nodes side by side, the last two may lie in the next chunk.
    let last_two = 0b11 << (CHUNK - 2);
    let both = move |offset: usize| {
        let before = |by: usize, nodes: u8| Some((chunk.checked_sub(offset + by)?, nodes));
        [before(0, u8::MAX), before(1, last_two)]
    };
    offsets.into_iter().flatten().flat_map(both).flatten()
}

/// Where the slots are.
#[derive(Clone, Copy)]
pub struct FieldMap<'a> {
    flows: bool,
    holders: &'a [Holder],
    near: &'a [u8],
    slots: &'a [Slot],
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
        self.holders[chunk].is_shared()
    }

    /// Whether the nodes of some chunks belong to one field alone, or to nobody.
    pub fn is_one<const N: usize>(&self, chunks: [usize; N]) -> bool {
        let holders = chunks.map(|chunk| self.holders[chunk]);
        let first = holders.iter().find(|holder| **holder != Holder::NOBODY);
        let same = |holder: &Holder| *holder == Holder::NOBODY || Some(holder) == first;
        holders.iter().all(same) && !first.is_some_and(|holder| holder.is_shared())
    }

    /// The fields that reach a chunk. Where nobody is known, something may lie that flows.
    pub fn fields_of(&self, chunk: usize) -> impl Iterator<Item = u16> + use<'a> {
        let holder = self.holders[chunk];
        let first = holder.first_slot().unwrap_or(self.slots.len());
        let mine = self.slots[first..].iter();
        let mine = mine.take_while(move |slot| slot.chunk as usize == chunk);
        let alone = if holder == Holder::NOBODY {
            Some(0)
        } else {
            holder.alone()
        };
        alone.into_iter().chain(mine.map(|slot| slot.field))
    }

    /// Where a field has its node that stands for one of the grid.
    pub fn place(&self, index: usize, field: u16) -> NodePlace {
        let chunk = index / CHUNK;
        let holder = self.holders[chunk];
        if let Some(first) = holder.first_slot() {
            let mine = self.slots[first..].iter();
            let mut mine = mine.take_while(|slot| slot.chunk as usize == chunk);
            let number = mine.position(|slot| slot.field == field);
            return number.map_or(NodePlace::Nowhere, |number| {
                NodePlace::Slot((first + number) * CHUNK + index % CHUNK)
            });
        }
        if holder == Holder::NOBODY || holder.alone() == Some(field) {
            NodePlace::Grid
        } else {
            NodePlace::Nowhere
        }
    }

    /// Whether a stencil that starts at this node may touch a slot.
    #[inline(always)]
    fn near(&self, start: usize) -> bool {
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
    fn nodes(&self, index: usize, field: u16) -> [Option<usize>; 3] {
        let first = self.node(index, field);
        // Nodes of the first one's chunk follow it.
        let left = CHUNK - index % CHUNK;
        let next = if left < 3 {
            self.node(index + left, field)
        } else {
            None
        };
        std::array::from_fn(|step| {
            if step < left {
                first.map(|node| node + step)
            } else {
                next.map(|node| node + step - left)
            }
        })
    }
}

/// Fields that several threads read and write, each time on other planes.
pub struct SharedFields<'a, const D: usize> {
    map: FieldMap<'a>,
    starts: &'a [usize],
    nodes: *mut f32x4,
    slopes: *mut f32x4,
    friction_mass: Option<*mut f32>,
    volume: Option<*mut f32>,
    old: Option<*mut f32>,
    /// The fields cannot be used otherwise meanwhile.
    borrowed: PhantomData<&'a mut f32x4>,
}

// SAFETY: the pointers lead to plain numbers, and callers of `window`, `slopes` and `view` keep threads apart.
unsafe impl<const D: usize> Sync for SharedFields<'_, D> {}

impl<const D: usize> SharedFields<'_, D> {
    pub fn map(&self) -> FieldMap<'_> {
        self.map
    }

    /// The slots of some planes.
    ///
    /// # Safety
    /// While they are in use, no other window and no view has a plane of them.
    pub unsafe fn window(&self, planes: Range<usize>) -> FieldWindow<'_, D> {
        let nodes = self.nodes_of(planes);
        let (first, count) = (nodes.start, nodes.len());
        // SAFETY: these are the nodes of the planes; the caller excludes other windows and views of them.
        unsafe {
            let numbers = |all: Option<*mut f32>, of_node: usize| {
                all.map_or(&mut [][..], |all| {
                    slice::from_raw_parts_mut(all.add(first * of_node), count * of_node)
                })
            };
            FieldWindow {
                map: self.map,
                starts: self.starts,
                first,
                slots: &self.map.slots[first / CHUNK..(first + count) / CHUNK],
                nodes: slice::from_raw_parts_mut(self.nodes.add(first), count),
                slopes: slice::from_raw_parts(self.slopes.add(first), count),
                friction_mass: numbers(self.friction_mass, 1),
                volume: numbers(self.volume, 1),
                old: numbers(self.old, Layout::<D>::OLD),
            }
        }
    }

    /// The slots of some planes, and the slopes of their nodes to be written.
    ///
    /// # Safety
    /// While they are in use, nobody else uses the slopes of these planes.
    pub unsafe fn slopes(&self, planes: Range<usize>) -> Slopes<'_> {
        let nodes = self.nodes_of(planes);
        Slopes {
            slots: &self.map.slots[nodes.start / CHUNK..nodes.end / CHUNK],
            // SAFETY: these are the slopes of the planes; the caller excludes other uses of them.
            values: unsafe { slice::from_raw_parts_mut(self.slopes.add(nodes.start), nodes.len()) },
        }
    }

    /// The nodes of the slots of some planes.
    ///
    /// # Safety
    /// While they are in use, no window has a plane of them.
    pub unsafe fn view(&self, planes: Range<usize>) -> FieldView<'_, D> {
        let nodes = self.nodes_of(planes);
        FieldView {
            map: self.map,
            first: nodes.start,
            // SAFETY: these are the nodes of the planes; the caller excludes windows of them.
            nodes: unsafe { slice::from_raw_parts(self.nodes.add(nodes.start), nodes.len()) },
            // SAFETY: as above.
            old: self.old.map_or(&[], |all| unsafe {
                let numbers = Layout::<D>::OLD;
                slice::from_raw_parts(all.add(nodes.start * numbers), nodes.len() * numbers)
            }),
        }
    }

    fn nodes_of(&self, planes: Range<usize>) -> Range<usize> {
        let last = self.starts.len() - 1;
        CHUNK * self.starts[planes.start.min(last)]..CHUNK * self.starts[planes.end.min(last)]
    }
}

/// The slots of some planes, and gradients of their nodes' masses [kg/cell] to be written.
pub struct Slopes<'a> {
    pub slots: &'a [Slot],
    pub values: &'a mut [f32x4],
}

/// The slots of some planes, which one thread may write while others write those of other planes.
pub struct FieldWindow<'a, const D: usize> {
    map: FieldMap<'a>,
    starts: &'a [usize],
    /// Number of the first node.
    pub first: usize,
    pub slots: &'a [Slot],
    pub nodes: &'a mut [f32x4],
    /// Gradients of the nodes' masses [kg/cell].
    pub slopes: &'a [f32x4],
    /// Empty unless materials differ in wall friction.
    pub friction_mass: &'a mut [f32],
    /// Rest volume; empty unless materials of one field differ in density.
    pub volume: &'a mut [f32],
    /// See `Grid`.
    pub old: &'a mut [f32],
}

impl<'a, const D: usize> FieldWindow<'a, D> {
    pub fn map(&self) -> FieldMap<'a> {
        self.map
    }

    /// Whether a stencil that starts at this node of the grid may touch a slot.
    #[inline(always)]
    pub fn near(&self, start: usize) -> bool {
        self.map.near(start)
    }

    /// The places in `nodes` that stand for three nodes of the grid side by side; None where the grid's own do.
    #[inline(always)]
    pub fn places(&self, index: usize, field: u16) -> [Option<usize>; 3] {
        let first = self.first;
        self.map
            .nodes(index, field)
            .map(|node| node.map(|node| node - first))
    }

    /// Zeroes the nodes of some of the planes.
    pub fn clear(&mut self, planes: Range<usize>) {
        let last = self.starts.len() - 1;
        let place = |plane: usize| CHUNK * self.starts[plane.min(last)] - self.first;
        let places = place(planes.start)..place(planes.end);
        self.nodes[places.clone()].fill(f32x4::ZERO);
        for numbers in [&mut *self.friction_mass, &mut *self.volume] {
            if !numbers.is_empty() {
                numbers[places.clone()].fill(0.0);
            }
        }
        if !self.old.is_empty() {
            let numbers = Layout::<D>::OLD;
            self.old[places.start * numbers..places.end * numbers].fill(0.0);
        }
    }
}

/// The nodes of the slots of some planes, to be read.
#[derive(Clone, Copy)]
pub struct FieldView<'a, const D: usize> {
    map: FieldMap<'a>,
    /// Number of the first node.
    first: usize,
    nodes: &'a [f32x4],
    old: &'a [f32],
}

impl<const D: usize> FieldView<'_, D> {
    /// Whether a stencil that starts at this node of the grid may touch a slot.
    #[inline(always)]
    pub fn near(&self, start: usize) -> bool {
        self.map.near(start)
    }

    /// Writes three nodes side by side of a field that reaches them, its own or the grid's, and what they keep of before forces
    /// (see `Grid`). Returns whether some are its own.
    #[inline(always)]
    pub fn row(
        &self,
        grid: View<'_, D>,
        index: usize,
        field: u16,
        (to_nodes, to_old): (&mut [f32x4; 4], &mut [f32; 16]),
    ) -> bool {
        let places = self.map.nodes(index, field);
        let numbers = Layout::<D>::OLD;
        for step in 0..3 {
            let (place, nodes, old) = match places[step] {
                Some(place) => (place - self.first, self.nodes, self.old),
                None => (index + step - grid.first, grid.nodes, grid.old),
            };
            to_nodes[step] = nodes[place];
            if !old.is_empty() {
                to_old[step * numbers..(step + 1) * numbers]
                    .copy_from_slice(&old[place * numbers..(place + 1) * numbers]);
            }
        }
        places[0].is_some() | places[2].is_some()
    }

    /// Masses of a field on a chunk [kg]; none where it does not reach.
    pub fn masses(&self, grid: View<'_, D>, chunk: usize, field: u16) -> [f32; CHUNK] {
        let holder = self.map.holders[chunk];
        let nodes = match holder.first_slot() {
            Some(first) => {
                let of_chunk = |slot: &&Slot| slot.chunk as usize == chunk;
                let mut slots = self.map.slots[first..].iter().take_while(of_chunk);
                let number = slots.position(|slot| slot.field == field);
                number.map(|number| &self.nodes[(first + number) * CHUNK - self.first..])
            }
            None if holder.alone() == Some(field) => {
                Some(&grid.nodes[chunk * CHUNK - grid.first..])
            }
            None => None,
        };
        nodes.map_or([0.0; CHUNK], |nodes| {
            std::array::from_fn(|step| nodes[step].as_array()[3])
        })
    }
}
