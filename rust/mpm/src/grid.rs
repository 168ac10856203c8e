//! The background grid: its layout, and which part of it particles touch.

use wide::f32x4;

use crate::math::Vector;

/// Nodes outside [0, 1] on each side. A particle may be one cell past a wall that lies on the box,
/// and between two sorts it may move one cell further; its stencil reaches one node beyond.
pub const PADDING: usize = 4;
/// Cells that a particle may move between two sorts without leaving the active rows.
pub const MARGIN: usize = 1;

/// Positions of nodes in memory. The last axis is contiguous; a *row* is one line of nodes along it,
/// a *plane* all rows that share the first coordinate.
#[derive(Debug, Clone, Copy)]
pub struct Layout<const D: usize> {
    /// Cells along each axis of [0, 1].
    pub resolution: usize,
    /// Nodes along each axis, padding included.
    pub extent: usize,
}

impl<const D: usize> Layout<D> {
    pub fn new(resolution: usize) -> Self {
        Self {
            resolution,
            extent: resolution + 1 + 2 * PADDING,
        }
    }

    /// Cell size [m].
    pub fn dx(&self) -> f32 {
        1.0 / self.resolution as f32
    }

    /// Position in cells from the first node.
    #[inline(always)]
    pub fn cells(&self, x: &Vector<D>) -> Vector<D> {
        x.map(|s| s * self.resolution as f32 + PADDING as f32)
    }

    /// Position of a node [m].
    pub fn position(&self, node: [usize; D]) -> Vector<D> {
        Vector::from_fn(|axis, _| (node[axis] as f32 - PADDING as f32) * self.dx())
    }

    pub fn row_count(&self) -> usize {
        self.extent.pow(D as u32 - 1)
    }

    pub fn rows_per_plane(&self) -> usize {
        self.extent.pow(D as u32 - 2)
    }

    pub fn nodes_per_plane(&self) -> usize {
        self.extent.pow(D as u32 - 1)
    }

    /// Row of a node.
    #[inline(always)]
    pub fn row(&self, node: [usize; D]) -> usize {
        node[..D - 1]
            .iter()
            .fold(0, |row, &coordinate| row * self.extent + coordinate)
    }

    /// Coordinates of a row, the last axis left at 0.
    pub fn row_coordinates(&self, row: usize) -> [usize; D] {
        let mut node = [0; D];
        let mut rest = row;
        for axis in (0..D - 1).rev() {
            node[axis] = rest % self.extent;
            rest /= self.extent;
        }
        node
    }

    /// Distance in memory between neighbours along an axis.
    pub fn stride(&self, axis: usize) -> usize {
        self.extent.pow((D - 1 - axis) as u32)
    }

    /// Memory offsets of the 3^(D-1) rows of a stencil from its lowest node, first axis fastest.
    #[inline(always)]
    pub fn stencil_row(&self, step: [usize; 2]) -> usize {
        match D {
            2 => step[0] * self.extent,
            _ => (step[0] * self.extent + step[1]) * self.extent,
        }
    }
}

/// The part `lo..hi` of a row that some particle may touch before the next sort.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Span {
    pub row: usize,
    pub lo: usize,
    pub hi: usize,
}

/// Mass and momentum after P2G; velocity after the grid update.
#[derive(Debug, Clone)]
pub struct Grid<const D: usize> {
    pub layout: Layout<D>,
    /// Lanes 0..D hold momentum [kg m/s], then velocity [m/s]; lane 3 holds mass [kg].
    pub nodes: Vec<f32x4>,
    /// Sum of mass times wall friction; empty when all materials share one coefficient.
    pub friction_mass: Vec<f32>,
    /// Ordered by row.
    pub active: Vec<Span>,
    /// Scratch of `activate`: per row the span of stencil bases, then of all nodes; (MAX, 0) if none.
    bounds: Vec<(u32, u32)>,
}

const EMPTY: (u32, u32) = (u32::MAX, 0);

impl<const D: usize> Grid<D> {
    pub fn new(resolution: usize, mixed_friction: bool) -> Self {
        let layout = Layout::new(resolution);
        let count = layout.extent.pow(D as u32);
        Self {
            layout,
            nodes: vec![f32x4::ZERO; count],
            friction_mass: if mixed_friction {
                vec![0.0; count]
            } else {
                Vec::new()
            },
            active: Vec::new(),
            bounds: vec![EMPTY; layout.row_count()],
        }
    }

    /// Recomputes the active spans from the stencil bases of all particles.
    pub fn activate(&mut self, bases: impl Iterator<Item = [usize; D]>) {
        for span in self.active.drain(..) {
            self.bounds[span.row] = EMPTY;
        }
        let mut occupied = Vec::new();
        for base in bases {
            let bound = &mut self.bounds[self.layout.row(base)];
            if *bound == EMPTY {
                occupied.push(self.layout.row(base));
            }
            bound.0 = bound.0.min(base[D - 1] as u32);
            bound.1 = bound.1.max(base[D - 1] as u32);
        }
        occupied.sort_unstable();
        // Take the spans of bases out first: dilation writes over neighbouring rows.
        let spans: Vec<_> = occupied
            .iter()
            .map(|&row| (row, std::mem::replace(&mut self.bounds[row], EMPTY)))
            .collect();
        let reach = MARGIN..=MARGIN + 2;
        let (down, up) = (*reach.start() as isize, *reach.end() as isize);
        let mut rows = Vec::new();
        for (row, (lo, hi)) in spans {
            let (lo, hi) = (lo - down as u32, hi + up as u32 + 1);
            let second = if D == 3 { -down..=up } else { 0..=0 };
            for i in -down..=up {
                for j in second.clone() {
                    let stride = if D == 3 {
                        self.layout.extent as isize
                    } else {
                        1
                    };
                    let neighbour = (row as isize + i * stride + j) as usize;
                    let bound = &mut self.bounds[neighbour];
                    if *bound == EMPTY {
                        rows.push(neighbour);
                    }
                    *bound = (bound.0.min(lo), bound.1.max(hi));
                }
            }
        }
        rows.sort_unstable();
        self.active.extend(rows.into_iter().map(|row| {
            let (lo, hi) = self.bounds[row];
            Span {
                row,
                lo: lo as usize,
                hi: hi as usize,
            }
        }));
    }

    /// Zeroes the active nodes.
    pub fn clear(&mut self) {
        for span in &self.active {
            let start = span.row * self.layout.extent;
            self.nodes[start + span.lo..start + span.hi].fill(f32x4::ZERO);
            if !self.friction_mass.is_empty() {
                self.friction_mass[start + span.lo..start + span.hi].fill(0.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn active_spans_cover_every_stencil_within_the_margin() {
        let mut grid = Grid::<3>::new(16, false);
        let bases = [[6, 7, 8], [6, 7, 12], [9, 7, 8], [12, 12, 5]];
        for _ in 0..2 {
            grid.activate(bases.into_iter());
            for base in bases {
                for (dx, dy) in (-1isize..=3).flat_map(|dx| (-1..=3).map(move |dy| (dx, dy))) {
                    let near = |axis: usize, d: isize| (base[axis] as isize + d) as usize;
                    let row = grid.layout.row([near(0, dx), near(1, dy), 0]);
                    let span = grid
                        .active
                        .iter()
                        .find(|s| s.row == row)
                        .expect("row is active");
                    assert!(span.lo < base[2] && base[2] + 3 < span.hi);
                }
            }
            assert!(grid.active.is_sorted_by_key(|s| s.row));
        }
    }

    #[test]
    fn rows_and_coordinates_agree() {
        let layout = Layout::<3>::new(16);
        assert_eq!(layout.row_coordinates(layout.row([5, 11, 3])), [5, 11, 0]);
    }
}
