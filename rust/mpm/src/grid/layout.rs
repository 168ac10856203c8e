//! Where the nodes of the grid lie, in space and in memory.

use crate::linalg::Vector;

/// Nodes outside of the world on each side. A particle may be one cell past a wall that lies on the box,
/// and between two sorts it may move one cell further; its stencil reaches one node beyond.
pub const PADDING: usize = 4;
/// Nodes that are swept together; spans consist of them.
pub const CHUNK: usize = 8;

/// Cells that a particle may move between two sorts without leaving the active rows.
pub const MARGIN: usize = 1;

/// Positions of nodes in memory. The last axis is contiguous; a *row* is one line of nodes along it,
/// a *plane* all rows that share the first coordinate.
#[derive(Debug, Clone, Copy)]
pub struct Layout<const D: usize> {
    /// Cells per metre.
    pub resolution: usize,
    /// Nodes along each axis, padding included.
    pub extents: [usize; D],
    /// Nodes that a row takes in memory: whole chunks.
    pub row_length: usize,
}

impl<const D: usize> Layout<D> {
    /// Numbers of each node beside those of momentum and mass that its momentum before forces takes. In 2D its first
    /// component is the third number of the node; in 3D nodes have none to spare.
    pub const OLD: usize = if D == 2 { 1 } else { 4 };

    /// For a world of `cells` along each axis, from the origin on.
    pub fn new(resolution: usize, cells: [usize; D]) -> Self {
        let extents = cells.map(|cells| cells + 1 + 2 * PADDING);
        Self {
            resolution,
            extents,
            row_length: extents[D - 1].next_multiple_of(CHUNK),
        }
    }

    /// For the world [0, 1]^D.
    #[cfg(test)]
    pub fn unit(resolution: usize) -> Self {
        Self::new(resolution, [resolution; D])
    }

    /// The corner of the world with the largest coordinates [m].
    pub fn upper(&self) -> Vector<D> {
        let metres = |cells: usize| (cells as f64 / self.resolution as f64) as f32;
        Vector::from_fn(|axis, _| metres(self.extents[axis] - 1 - 2 * PADDING))
    }

    /// Nodes along the first axis.
    pub fn planes(&self) -> usize {
        self.extents[0]
    }

    /// Nodes along the last axis.
    pub fn columns(&self) -> usize {
        self.extents[D - 1]
    }

    /// Cell size [m].
    pub fn dx(&self) -> f32 {
        1.0 / self.resolution as f32
    }

    /// Position of a node [m].
    pub fn position(&self, node: [usize; D]) -> Vector<D> {
        Vector::from_fn(|axis, _| (node[axis] as f32 - PADDING as f32) * self.dx())
    }

    pub fn row_count(&self) -> usize {
        self.extents[..D - 1].iter().product()
    }

    pub fn rows_per_plane(&self) -> usize {
        self.extents[1..D - 1].iter().product()
    }

    pub fn nodes_per_plane(&self) -> usize {
        self.rows_per_plane() * self.row_length
    }

    /// Row of a node.
    #[inline(always)]
    #[cfg(test)]
    pub fn row(&self, node: [usize; D]) -> usize {
        let axes = node[..D - 1].iter().zip(&self.extents);
        axes.fold(0, |row, (&coordinate, &extent)| row * extent + coordinate)
    }

    /// Coordinates of a row, the last axis left at 0.
    pub fn row_coordinates(&self, row: usize) -> [usize; D] {
        let mut node = [0; D];
        let mut rest = row;
        for axis in (0..D - 1).rev() {
            node[axis] = rest % self.extents[axis];
            rest /= self.extents[axis];
        }
        node
    }

    /// Distance in memory between neighbours along an axis.
    pub fn stride(&self, axis: usize) -> usize {
        match D - 1 - axis {
            0 => 1,
            _ => self.extents[axis + 1..D - 1].iter().product::<usize>() * self.row_length,
        }
    }

    /// Memory offsets of the 3^(D-1) rows of a stencil from its lowest node, first axis fastest.
    #[inline(always)]
    pub fn stencil_row(&self, step: [usize; 2]) -> usize {
        match D {
            2 => step[0] * self.row_length,
            _ => (step[0] * self.extents[1] + step[1]) * self.row_length,
        }
    }

    /// Memory offset of the middle node of a stencil from its lowest one.
    #[inline(always)]
    pub fn stencil_middle(&self) -> usize {
        self.stencil_row([1, 1]) + 1
    }
}

/// The part `lo..hi` of a row that some particle may touch before the next sort, in whole chunks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Span {
    pub row: usize,
    pub lo: usize,
    pub hi: usize,
}

/// Lowest stencil node of a particle: its plane, its row within the plane, and its place on the row.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    pub plane: u16,
    pub row: u16,
    pub column: u16,
}

impl Place {
    /// The lower one along each axis.
    pub fn lowest(self, other: Self) -> Self {
        Self {
            plane: self.plane.min(other.plane),
            row: self.row.min(other.row),
            column: self.column.min(other.column),
        }
    }

    /// The higher one along each axis.
    pub fn highest(self, other: Self) -> Self {
        Self {
            plane: self.plane.max(other.plane),
            row: self.row.max(other.row),
            column: self.column.max(other.column),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_coordinates_agree() {
        let layout = Layout::<3>::new(16, [16, 21, 9]);
        assert_eq!(layout.row_coordinates(layout.row([5, 11, 3])), [5, 11, 0]);
        let memory = |node| layout.row(node) * layout.row_length + node[2];
        for axis in 0..3 {
            let mut next = [5, 11, 3];
            next[axis] += 1;
            assert_eq!(memory(next) - memory([5, 11, 3]), layout.stride(axis));
        }
        assert_eq!(layout.upper(), Vector::<3>::new(1.0, 1.3125, 0.5625));
    }
}
