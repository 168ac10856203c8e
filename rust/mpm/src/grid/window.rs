//! Parts of the grid, for threads that work side by side.

use std::marker::PhantomData;
use std::ops::Range;
use std::slice;

use wide::f32x4;

use super::active::ActiveSpans;
use super::field_window::SharedFields;
use super::layout::{CHUNK, Layout, Span};
use super::view::View;

/// Some planes of the grid, which one thread may write while others write other planes.
#[derive(Debug)]
pub struct Window<'a, const D: usize> {
    pub layout: Layout<D>,
    /// Memory index of the first node.
    pub first: usize,
    pub nodes: &'a mut [f32x4],
    /// Empty unless materials differ in wall friction.
    pub friction_mass: &'a mut [f32],
    /// See `Grid`.
    pub old: &'a mut [f32],
    /// See `Grid`.
    pub dirty: &'a mut [bool],
    /// The planes.
    pub planes: Range<usize>,
    pub(super) active: &'a ActiveSpans,
}

impl<'a, const D: usize> Window<'a, D> {
    /// The active spans.
    pub fn active(&self) -> &'a [Span] {
        self.active.of_planes(self.planes.clone())
    }

    /// Those of some planes.
    pub fn active_in(&self, planes: Range<usize>) -> &'a [Span] {
        self.active.of_planes(planes)
    }

    /// The active chunks of some of the planes, counted from the first node.
    pub fn chunks(&self, planes: Range<usize>) -> impl Iterator<Item = usize> + use<'a, D> {
        let (row_length, first) = (self.layout.row_length, self.first);
        let of_span = move |span: &Span| {
            let start = span.row * row_length - first;
            (start + span.lo) / CHUNK..(start + span.hi) / CHUNK
        };
        self.active.of_planes(planes).iter().flat_map(of_span)
    }

    /// Zeroes the active nodes of some of the planes.
    pub fn clear(&mut self, planes: Range<usize>) {
        for span in self.active.of_planes(planes) {
            let start = span.row * self.layout.row_length - self.first;
            for chunk in (start + span.lo) / CHUNK..(start + span.hi) / CHUNK {
                if self.dirty[chunk] {
                    self.dirty[chunk] = false;
                    let nodes = chunk * CHUNK..(chunk + 1) * CHUNK;
                    self.nodes[nodes.clone()].fill(f32x4::ZERO);
                    if !self.old.is_empty() {
                        let numbers = Layout::<D>::OLD;
                        self.old[nodes.start * numbers..nodes.end * numbers].fill(0.0);
                    }
                    if !self.friction_mass.is_empty() {
                        self.friction_mass[nodes].fill(0.0);
                    }
                }
            }
        }
    }
}

/// A grid that several threads read and write, each time other planes. Whose turn it is the compiler cannot see.
pub struct SharedGrid<'a, const D: usize> {
    pub(super) layout: Layout<D>,
    pub(super) nodes: *mut f32x4,
    /// None where all materials share one coefficient.
    pub(super) friction_mass: Option<*mut f32>,
    /// None where it is not kept.
    pub(super) old: Option<*mut f32>,
    pub(super) dirty: *mut bool,
    pub(super) active: &'a ActiveSpans,
    pub fields: SharedFields<'a, D>,
    /// The grid cannot be used otherwise meanwhile.
    pub(super) borrowed: PhantomData<&'a mut f32x4>,
}

// SAFETY: the pointers lead to plain numbers, and callers of `window` and `view` keep threads apart.
unsafe impl<const D: usize> Sync for SharedGrid<'_, D> {}

impl<const D: usize> SharedGrid<'_, D> {
    /// A window onto some planes.
    ///
    /// # Safety
    /// While it is in use, no other window and no view has a plane of it.
    pub unsafe fn window(&self, planes: Range<usize>) -> Window<'_, D> {
        let (planes, first, count) = self.nodes_of(planes);
        // SAFETY: these are the nodes of the planes; the caller excludes other windows and views of them.
        unsafe {
            Window {
                layout: self.layout,
                first,
                nodes: slice::from_raw_parts_mut(self.nodes.add(first), count),
                friction_mass: self.friction_mass.map_or(&mut [], |all| {
                    slice::from_raw_parts_mut(all.add(first), count)
                }),
                old: self.old.map_or(&mut [], |all| {
                    let numbers = Layout::<D>::OLD;
                    slice::from_raw_parts_mut(all.add(first * numbers), count * numbers)
                }),
                dirty: slice::from_raw_parts_mut(self.dirty.add(first / CHUNK), count / CHUNK),
                planes,
                active: self.active,
            }
        }
    }

    /// The nodes of some planes.
    ///
    /// # Safety
    /// While they are in use, no window has a plane of them.
    pub unsafe fn view(&self, planes: Range<usize>) -> View<'_, D> {
        let (_, first, count) = self.nodes_of(planes);
        View {
            layout: self.layout,
            first,
            // SAFETY: these are the nodes of the planes; the caller excludes windows of them.
            nodes: unsafe { slice::from_raw_parts(self.nodes.add(first), count) },
            // SAFETY: as above.
            old: self.old.map_or(&[], |all| unsafe {
                let numbers = Layout::<D>::OLD;
                slice::from_raw_parts(all.add(first * numbers), count * numbers)
            }),
        }
    }

    /// The planes that exist, the memory index of their first node, and the number of their nodes.
    fn nodes_of(&self, planes: Range<usize>) -> (Range<usize>, usize, usize) {
        let end = planes.end.min(self.layout.planes());
        let planes = planes.start.min(end)..end;
        let in_plane = self.layout.nodes_per_plane();
        (
            planes.clone(),
            planes.start * in_plane,
            planes.len() * in_plane,
        )
    }
}
