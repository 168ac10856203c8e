//! The background grid, and which part of it particles touch.

use std::ops::Range;

use wide::f32x4;

use super::layout::{CHUNK, Layout, Place, Span};

/// Lighter nodes [kg] count as empty: the inverse of their mass would leave the range of float32.
pub const SMALLEST_MASS: f32 = 1.0e-30;
/// Cells that a particle may move between two sorts without leaving the active rows.
pub const MARGIN: usize = 1;

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
    pub dirty: &'a mut [bool],
    /// Active spans of the planes.
    pub active: &'a [Span],
}

impl<const D: usize> Window<'_, D> {
    /// Zeroes the active nodes of some planes.
    pub fn clear(&mut self, planes: Range<usize>) {
        let rows = self.layout.rows_per_plane();
        let place = |plane: usize| self.active.partition_point(|span| span.row < plane * rows);
        for span in &self.active[place(planes.start)..place(planes.end)] {
            let start = span.row * self.layout.row_length - self.first;
            for chunk in (start + span.lo) / CHUNK..(start + span.hi) / CHUNK {
                if self.dirty[chunk] {
                    self.dirty[chunk] = false;
                    let nodes = chunk * CHUNK..(chunk + 1) * CHUNK;
                    self.nodes[nodes.clone()].fill(f32x4::ZERO);
                    if !self.friction_mass.is_empty() {
                        self.friction_mass[nodes].fill(0.0);
                    }
                }
            }
        }
    }
}

/// Mass and momentum after P2G; velocity after the grid update.
#[derive(Debug, Clone)]
pub struct Grid<const D: usize> {
    pub layout: Layout<D>,
    /// Lanes 0..D hold momentum [kg m/s], then velocity [m/s]; lane 3 holds mass [kg].
    pub nodes: Vec<f32x4>,
    /// Sum of mass times wall friction; empty when all materials share one coefficient.
    pub friction_mass: Vec<f32>,
    /// Whether something has been written to a chunk of nodes since it was cleared; the others are zero.
    dirty: Vec<bool>,
    /// Ordered by row, then along it.
    pub active: Vec<Span>,
    /// Scratch of `activate`: one bit a node, rows padded to whole words; zero between calls.
    occupied: Vec<u64>,
    /// One bit for each active node, gaps of the spans left out.
    touched: Vec<u64>,
}

impl<const D: usize> Grid<D> {
    pub fn new(resolution: usize, mixed_friction: bool) -> Self {
        let layout = Layout::new(resolution);
        let count = layout.row_count() * layout.row_length;
        let words = layout.row_count() * layout.row_length.div_ceil(64);
        Self {
            layout,
            nodes: vec![f32x4::ZERO; count],
            friction_mass: if mixed_friction {
                vec![0.0; count]
            } else {
                Vec::new()
            },
            dirty: vec![false; count / CHUNK],
            active: Vec::new(),
            occupied: vec![0; words],
            touched: vec![0; words],
        }
    }

    /// Recomputes the active spans from the lowest stencil nodes of all particles.
    ///
    /// Nodes that leave them are zeroed: contact with a wall looks one node beyond the spans, and what
    /// it finds there must not depend on the past.
    pub fn activate(&mut self, places: &[Place]) {
        let words = self.layout.row_length.div_ceil(64);
        self.clear();
        for span in self.active.drain(..) {
            self.touched[span.row * words..][..words].fill(0);
        }
        let rows = self.occupy(places, words);
        let reached = self.spread(&rows, words);
        for row in reached {
            let bits = &self.touched[row * words..][..words];
            let mut column = 0;
            while let Some(lo) = next_bit(bits, column, true) {
                let hi = next_bit(bits, lo, false).unwrap_or(words * 64);
                let (lo, hi) = (lo / CHUNK * CHUNK, hi.next_multiple_of(CHUNK));
                match self.active.last_mut() {
                    Some(last) if last.row == row && lo <= last.hi => last.hi = hi,
                    _ => self.active.push(Span { row, lo, hi }),
                }
                column = hi;
            }
        }
    }

    /// Marks the stencil bases and lists their rows.
    fn occupy(&mut self, places: &[Place], words: usize) -> Vec<usize> {
        let mut rows = Vec::new();
        for place in places {
            let (row, column) = (place.row as usize, place.column);
            let bits = &mut self.occupied[row * words..][..words];
            if bits.iter().all(|&word| word == 0) {
                rows.push(row);
            }
            bits[column as usize / 64] |= 1 << (column % 64);
        }
        rows
    }

    /// Marks all nodes within reach of the bases, clears the bases, and lists the rows in order.
    fn spread(&mut self, rows: &[usize], words: usize) -> Vec<usize> {
        let (down, up) = (MARGIN as isize, MARGIN as isize + 2);
        let second = if D == 3 { -down..=up } else { 0..=0 };
        let stride = self.layout.rows_per_plane() as isize;
        let mut reached = Vec::new();
        let mut wide = vec![0u64; words];
        for &row in rows {
            let bits = &mut self.occupied[row * words..][..words];
            for (index, word) in wide.iter_mut().enumerate() {
                let below = if index > 0 { bits[index - 1] } else { 0 };
                let above = bits.get(index + 1).copied().unwrap_or(0);
                *word = (bits[index] >> MARGIN) | (above << (64 - MARGIN)) | bits[index];
                for k in 1..=MARGIN + 2 {
                    *word |= (bits[index] << k) | (below >> (64 - k));
                }
            }
            bits.fill(0);
            for (i, j) in (-down..=up).flat_map(|i| second.clone().map(move |j| (i, j))) {
                let neighbour = (row as isize + i * stride + j) as usize;
                let bits = &mut self.touched[neighbour * words..][..words];
                if bits.iter().all(|&word| word == 0) {
                    reached.push(neighbour);
                }
                bits.iter_mut()
                    .zip(&wide)
                    .for_each(|(bit, wide)| *bit |= wide);
            }
        }
        reached.sort_unstable();
        reached
    }

    /// Windows onto ranges of planes, given in ascending order without overlap.
    pub fn windows(&mut self, planes: impl Iterator<Item = Range<usize>>) -> Vec<Window<'_, D>> {
        let layout = self.layout;
        let (mut nodes, mut friction_mass, mut dirty) = (
            &mut self.nodes[..],
            &mut self.friction_mass[..],
            &mut self.dirty[..],
        );
        let mut cut = 0;
        let mut windows = Vec::new();
        for planes in planes {
            let first = planes.start * layout.nodes_per_plane();
            let end = (planes.end * layout.nodes_per_plane()).min(cut + nodes.len());
            let rows = planes.start * layout.rows_per_plane()..planes.end * layout.rows_per_plane();
            let place = |row: usize| self.active.partition_point(|span| span.row < row);
            let mine = cut_out(nodes, first - cut, end - cut);
            let my_dirty = cut_out(dirty, (first - cut) / CHUNK, (end - cut) / CHUNK);
            let my_friction = if friction_mass.is_empty() {
                (&mut [][..], friction_mass)
            } else {
                cut_out(friction_mass, first - cut, end - cut)
            };
            (nodes, dirty, friction_mass, cut) = (mine.1, my_dirty.1, my_friction.1, end);
            windows.push(Window {
                layout,
                first,
                nodes: mine.0,
                friction_mass: my_friction.0,
                dirty: my_dirty.0,
                active: &self.active[place(rows.start)..place(rows.end)],
            });
        }
        windows
    }

    /// Memory indices of the active nodes.
    pub fn active_ranges(&self) -> impl Iterator<Item = Range<usize>> {
        let row_length = self.layout.row_length;
        self.active
            .iter()
            .map(move |span| span.row * row_length + span.lo..span.row * row_length + span.hi)
    }

    /// Changes all active nodes.
    pub fn for_each_active(&mut self, mut change: impl FnMut(&mut f32x4)) {
        let ranges: Vec<_> = self.active_ranges().collect();
        for range in ranges {
            self.nodes[range].iter_mut().for_each(&mut change);
        }
    }

    /// Makes the next `clear` zero all active nodes, also those that no P2G has marked.
    pub fn mark_dirty(&mut self) {
        let ranges: Vec<_> = self.active_ranges().collect();
        for range in ranges {
            self.dirty[range.start / CHUNK..range.end / CHUNK].fill(true);
        }
    }

    /// Zeroes the active nodes.
    pub fn clear(&mut self) {
        let planes = 0..self.layout.extent;
        for window in &mut self.windows(std::iter::once(planes.clone())) {
            window.clear(planes.clone());
        }
    }
}

/// Cuts `start..end` out of a slice; also what is behind.
fn cut_out<T>(slice: &mut [T], start: usize, end: usize) -> (&mut [T], &mut [T]) {
    slice[start..].split_at_mut(end - start)
}

/// The first bit from `from` on that is set, or is not set.
fn next_bit(bits: &[u64], from: usize, set: bool) -> Option<usize> {
    let mut index = from / 64;
    let mut skip = from % 64;
    while index < bits.len() {
        let word = (if set { bits[index] } else { !bits[index] }) >> skip;
        if word != 0 {
            return Some(index * 64 + skip + word.trailing_zeros() as usize);
        }
        (index, skip) = (index + 1, 0);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place<const D: usize>(grid: &Grid<D>, base: [usize; D]) -> Place {
        Place {
            row: grid.layout.row(base) as u32,
            column: base[D - 1] as u32,
        }
    }

    #[test]
    fn active_spans_cover_every_stencil_within_the_margin() {
        let mut grid = Grid::<3>::new(16, false);
        let bases = [[6, 7, 8], [6, 7, 18], [9, 7, 8], [12, 12, 5]];
        for _ in 0..2 {
            grid.activate(&bases.map(|base| place(&grid, base)));
            for base in bases {
                for (dx, dy) in (-1isize..=3).flat_map(|dx| (-1..=3).map(move |dy| (dx, dy))) {
                    let near = |axis: usize, d: isize| (base[axis] as isize + d) as usize;
                    let row = grid.layout.row([near(0, dx), near(1, dy), 0]);
                    let covered = grid
                        .active
                        .iter()
                        .any(|span| span.row == row && span.lo < base[2] && base[2] + 3 < span.hi);
                    assert!(covered, "{base:?} {row}");
                }
            }
            assert!(grid.active.is_sorted_by_key(|s| (s.row, s.lo)));
            let apart = |pair: &[Span]| pair[0].row != pair[1].row || pair[0].hi < pair[1].lo;
            assert!(grid.active.windows(2).all(apart));
            // 5 rows by 5 for each base; two planes of the third are those of the first. The columns 8 and 18 of
            // the first two lie in chunks that touch.
            assert_eq!(grid.active.len(), 25 + 15 + 25);
            assert!(
                grid.active
                    .iter()
                    .all(|s| s.lo % CHUNK == 0 && s.hi % CHUNK == 0)
            );
        }
    }

    #[test]
    fn nodes_that_are_no_longer_active_are_empty() {
        let mut grid = Grid::<2>::new(16, true);
        grid.activate(&[[6, 6], [9, 12]].map(|base| place(&grid, base)));
        for span in grid.active.clone() {
            let start = span.row * grid.layout.row_length;
            grid.nodes[start + span.lo..start + span.hi].fill(f32x4::splat(1.0));
            grid.dirty[(start + span.lo) / CHUNK..(start + span.hi) / CHUNK].fill(true);
            grid.friction_mass[start + span.lo..start + span.hi].fill(1.0);
        }
        grid.activate(&[place(&grid, [14, 14])]);
        assert!(grid.nodes.iter().all(|node| *node == f32x4::ZERO));
        assert!(grid.friction_mass.iter().all(|mass| *mass == 0.0));
    }
}
