//! Velocities of bodies that meet: one field for each, kept only where several of them reach the same nodes.
//!
//! Elsewhere the nodes of the grid carry the one body that reaches them. A *slot* is one field on one chunk of nodes.
//! Slots are found at each sort, for all nodes in reach before the next, so they are a function of the particles alone.
//! On chunks with slots nothing is written to the grid itself; its nodes stay empty there.

use std::marker::PhantomData;

use wide::f32x4;

use super::field_map::{FieldMap, Holder, Slot};
use super::field_window::SharedFields;
use super::layout::{CHUNK, Layout, MARGIN, Place};

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
    /// See `Slopes`.
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
            holders: vec![Holder::Nobody; chunks],
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

    /// Where the slots are.
    pub fn map(&self) -> FieldMap<'_> {
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
            self.holders[chunk as usize] = Holder::Nobody;
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
        match self.holders[chunk] {
            Holder::One(only) if only == field => {}
            Holder::Nobody => {
                self.holders[chunk] = Holder::One(field);
                self.held.push(chunk as u32);
            }
            _ => {
                self.share(chunk);
                self.push(chunk, field);
            }
        }
    }

    /// Gives the only field of a chunk a slot there.
    fn share(&mut self, chunk: usize) {
        if let Holder::One(field) = self.holders[chunk] {
            self.holders[chunk] = Holder::Several { first_slot: 0 };
            self.push(chunk, field);
        }
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
            let first_slot = index as u32;
            self.holders[chunk] = Holder::Several { first_slot };
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
        let (nodes, slopes) = (self.nodes.as_mut_ptr(), self.slopes.as_mut_ptr());
        let kept = |numbers: &mut Vec<f32>| (!numbers.is_empty()).then_some(numbers.as_mut_ptr());
        let friction_mass = kept(&mut self.friction_mass);
        let (volume, old) = (kept(&mut self.volume), kept(&mut self.old));
        SharedFields {
            layout: &self.layout,
            map: self.map(),
            starts: &self.starts,
            nodes,
            slopes,
            friction_mass,
            volume,
            old,
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
