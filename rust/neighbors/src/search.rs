//! The neighbours of all points at one instant.

use std::ops::Range;

use threads::{Pool, interrupted};

use crate::error::GraphError;
use crate::filter::Filter;
use crate::rows::{Part, Rows, pieces};
use crate::scan::{CellList, Reach, Tile, room, write_sorted};
use crate::settings::{GraphSettings, check_fixed, check_length, check_points};

/// Cells that are searched between two looks at whether the search is interrupted: less than a millisecond.
const LOOK_EVERY: usize = 256;

/// Finds graphs; its memory is reused for the next one.
#[derive(Debug)]
pub struct Search<const D: usize> {
    cells: CellList<D>,
    rows: Rows,
    /// Neighbours of the point in each slot.
    lengths: Vec<u32>,
}

impl<const D: usize> Default for Search<D> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const D: usize> Search<D> {
    pub fn new() -> Self {
        Self {
            cells: CellList::new(),
            rows: Rows::default(),
            lengths: Vec::new(),
        }
    }

    /// Edges that memory is kept for, about.
    pub fn capacity(&self) -> usize {
        self.rows.capacity()
    }

    /// Finds the edges between points, N times D coordinates, and returns their number.
    ///
    /// Points that are `fixed`, N flags, are not joined to each other. Fails where the search is `interrupted`.
    pub fn find(
        &mut self,
        points: &[f32],
        fixed: Option<&[bool]>,
        settings: &GraphSettings,
        pool: &Pool,
    ) -> Result<usize, GraphError> {
        check_length("radius", settings.radius)?;
        check_points(points.len() / D)?;
        check_fixed(fixed, points.len() / D)?;
        self.cells.sort(points, settings.radius)?;
        let Self {
            cells,
            rows,
            lengths,
        } = self;
        let parts = slabs(cells, pieces(cells.points(), pool));
        lengths.resize(cells.points(), 0);
        let sweep = Sweep {
            cells,
            filter: Filter {
                points,
                fixed,
                reach: Reach::new(settings.radius, settings.inclusive),
            },
            settings,
        };
        let mut rest = lengths.as_mut_slice();
        let mut jobs: Vec<_> = (parts.iter().cloned().zip(rows.empty_parts(parts.len())))
            .map(|(range, part)| {
                let slots = cells.slots(range.clone());
                let (mine, others) = std::mem::take(&mut rest).split_at_mut(slots.len());
                rest = others;
                (range, part, mine)
            })
            .collect();
        pool.for_each(&mut jobs, |(range, part, lengths)| {
            sweep.run(range.clone(), part, lengths);
        });
        if interrupted() {
            return Err(GraphError::Interrupted);
        }
        rows.check_size(cells.points(), settings)?;
        let slots = parts.into_iter().map(|range| cells.slots(range));
        let found = slots.map(|slots| (&cells.order[slots.clone()], &lengths[slots]));
        Ok(rows.locate(cells.points(), found))
    }

    /// The edges into point i that `find` found are `starts[i]` to `starts[i + 1]`; N + 1 numbers.
    pub fn starts(&self) -> &[u32] {
        &self.rows.starts
    }

    /// Writes the senders of all edges, by receiver, then ascending; `into` has as many places as `find` returned.
    pub fn write_senders(&self, into: &mut [u32], pool: &Pool) {
        self.rows.write(into, pool);
    }
}

/// Ranges of cells with about equally many points.
fn slabs<const D: usize>(cells: &CellList<D>, count: usize) -> Vec<Range<usize>> {
    let cut = |slab| match slab {
        0 => 0,
        _ if slab == count => cells.cells(),
        _ => cells.cell_from(slab * cells.points() / count),
    };
    (0..count).map(|slab| cut(slab)..cut(slab + 1)).collect()
}

/// Inputs of all threads.
struct Sweep<'a, const D: usize> {
    cells: &'a CellList<D>,
    filter: Filter<'a, D>,
    settings: &'a GraphSettings,
}

impl<const D: usize> Sweep<'_, D> {
    /// Finds the rows of the points in a range of cells.
    fn run(&self, range: Range<usize>, part: &mut Part, lengths: &mut [u32]) {
        let (mut tile, mut runs, mut row) = (Tile::new(), Vec::new(), Vec::new());
        let mut lengths = lengths.iter_mut();
        for (number, cell) in range.enumerate() {
            if number.is_multiple_of(LOOK_EVERY) && interrupted() {
                return;
            }
            let slots = self.cells.slots(cell..cell + 1);
            if slots.is_empty() {
                continue;
            }
            self.cells.runs_around(cell, &mut runs);
            tile.fill(self.cells, &runs, slots.start);
            row.resize(row.len().max(room(tile.room())), 0);
            for (n, (slot, length)) in slots.zip(&mut lengths).enumerate() {
                let own = self.cells.order[slot] as usize;
                let with_self = self.settings.self_edges;
                let found = tile.scan(n, with_self, &self.filter.reach, &mut row);
                let count = self.filter.keep(own, found, &mut row);
                write_sorted(&row, count, part.room(count));
                part.keep(count);
                *length = count as u32;
            }
            if part.len() > self.settings.max_edges as usize {
                return;
            }
        }
    }
}
