//! The nodes of slots, for threads that work side by side.

use std::marker::PhantomData;
use std::ops::Range;
use std::slice;

use wide::f32x4;

use super::field_map::{FieldMap, Holder, NodePlace, RowPlace, Slot};
use super::layout::{CHUNK, Layout};
use super::view::View;

/// Fields that several threads read and write, each time on other planes.
pub struct SharedFields<'a, const D: usize> {
    pub(super) layout: &'a Layout<D>,
    pub(super) map: FieldMap<'a>,
    pub(super) starts: &'a [usize],
    pub(super) nodes: *mut f32x4,
    pub(super) slopes: *mut f32x4,
    pub(super) friction_mass: Option<*mut f32>,
    pub(super) volume: Option<*mut f32>,
    pub(super) old: Option<*mut f32>,
    /// The fields cannot be used otherwise meanwhile.
    pub(super) borrowed: PhantomData<&'a mut f32x4>,
}

// SAFETY: the pointers lead to plain numbers, and callers of `window`, `slopes` and `view` keep threads apart.
unsafe impl<const D: usize> Sync for SharedFields<'_, D> {}

impl<const D: usize> SharedFields<'_, D> {
    pub fn map(&self) -> FieldMap<'_> {
        self.map
    }

    /// The slots of some planes, without slopes.
    ///
    /// # Safety
    /// While they are in use, no other window and no view has a plane of them.
    pub unsafe fn window(&self, planes: Range<usize>) -> FieldWindow<'_, D> {
        // SAFETY: as above.
        unsafe { self.with_slopes(planes, 0..0) }
    }

    /// The slots of some planes, with the slopes around them.
    ///
    /// # Safety
    /// As for `window`, and nobody writes slopes of the planes up to `AROUND` before and behind.
    pub unsafe fn meeting(&self, planes: Range<usize>) -> FieldWindow<'_, D> {
        let around = planes.start.saturating_sub(AROUND)..planes.end + AROUND;
        // SAFETY: as above.
        unsafe { self.with_slopes(planes, around) }
    }

    /// # Safety
    /// As for `window`, and nobody writes slopes of the planes `around`.
    unsafe fn with_slopes(&self, planes: Range<usize>, around: Range<usize>) -> FieldWindow<'_, D> {
        let (nodes, slopes) = (self.nodes_of(planes), self.nodes_of(around));
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
                layout: self.layout,
                first_slope: slopes.start,
                slopes: slice::from_raw_parts(self.slopes.add(slopes.start), slopes.len()),
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
            volume: self.volume.map_or(&[], |all| unsafe {
                slice::from_raw_parts(all.add(nodes.start), nodes.len())
            }),
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

/// How far around a node the direction of contact there is found [nodes].
const AROUND: usize = 2;

/// The slots of some planes, and to be written for their nodes that several fields reach: the gradient of the distance of the
/// field's face where it may matter [-], and in lane 3 the part of the node that the field fills. All are zero at other nodes.
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
    layout: &'a Layout<D>,
    /// Number of the first node with slopes.
    first_slope: usize,
    /// See `Slopes`; also of planes around.
    slopes: &'a [f32x4],
    /// Empty unless materials differ in wall friction.
    pub friction_mass: &'a mut [f32],
    /// Rest volume; empty unless materials of one field differ in density.
    pub volume: &'a mut [f32],
    /// See `Grid`.
    pub old: &'a mut [f32],
}

impl<const D: usize> FieldWindow<'_, D> {
    /// Whether a stencil that starts at this node of the grid may touch a slot.
    #[inline(always)]
    pub fn near(&self, start: usize) -> bool {
        self.map.near(start)
    }

    /// Where in `nodes` those are that stand for three nodes of the grid side by side.
    #[inline(always)]
    pub fn row(&self, index: usize, field: u16) -> RowPlace {
        self.map.row(index, field).from(self.first)
    }

    /// That of a node of `nodes`; see `Slopes`.
    pub fn slope(&self, node: usize) -> &f32x4 {
        &self.slopes[node + self.first - self.first_slope]
    }

    /// Calls back with the slopes of two fields at each node around one of the grid where both have slots; see `Slopes`.
    pub fn slopes_around(&self, index: usize, of: [u16; 2], mut call: impl FnMut(&f32x4, &f32x4)) {
        let rows = if D == 3 { 2 * AROUND + 1 } else { 1 };
        let (plane, row) = (self.layout.stride(0), self.layout.stride(1) * (D - 2));
        let first = index - AROUND * (plane + row + 1);
        for start in (0..(2 * AROUND + 1) * rows).map(|k| first + k / rows * plane + k % rows * row)
        {
            let mut node = start;
            while node <= start + 2 * AROUND {
                let count = (CHUNK - node % CHUNK).min(start + 2 * AROUND + 1 - node);
                let places = of.map(|field| self.map.place(node, field));
                if let [NodePlace::Slot(one), NodePlace::Slot(other)] = places {
                    let slopes = |first: usize| &self.slopes[first - self.first_slope..][..count];
                    let pairs = slopes(one).iter().zip(slopes(other));
                    pairs.for_each(|(one, other)| call(one, other));
                }
                node += count;
            }
        }
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
    pub nodes: &'a [f32x4],
    volume: &'a [f32],
    /// See `Grid`.
    pub old: &'a [f32],
}

impl<const D: usize> FieldView<'_, D> {
    /// Whether a stencil that starts at this node of the grid may touch a slot.
    #[inline(always)]
    pub fn near(&self, start: usize) -> bool {
        self.map.near(start)
    }

    /// Where in `nodes` those are that stand for three nodes of the grid side by side.
    #[inline(always)]
    pub fn row(&self, index: usize, field: u16) -> RowPlace {
        self.map.row(index, field).from(self.first)
    }

    /// Rest volumes of a field on a chunk where it has a slot [m^D].
    pub fn volumes(&self, chunk: usize, field: u16) -> &[f32] {
        match self.map.place(chunk * CHUNK, field) {
            NodePlace::Slot(node) => &self.volume[node - self.first..][..CHUNK],
            _ => &[],
        }
    }

    /// Masses of a field on a chunk [kg]; none where it does not reach.
    pub fn masses(&self, grid: View<'_, D>, chunk: usize, field: u16) -> [f32; CHUNK] {
        let nodes = match self.map.place(chunk * CHUNK, field) {
            NodePlace::Slot(node) => Some(&self.nodes[node - self.first..]),
            NodePlace::Grid if self.map.holders[chunk] != Holder::Nobody => {
                Some(&grid.nodes[chunk * CHUNK - grid.first..])
            }
            _ => None,
        };
        nodes.map_or([0.0; CHUNK], |nodes| {
            std::array::from_fn(|step| nodes[step].as_array()[3])
        })
    }
}
