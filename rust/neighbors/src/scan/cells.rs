//! Points sorted into the cells of a grid.

use std::ops::Range;

use crate::error::GraphError;

/// Points that are tested at once.
pub(crate) const LANES: usize = 8;

/// Points in the order of their cells, each cell at least as wide as the radius.
#[derive(Debug)]
pub(crate) struct CellList<const D: usize> {
    extent: [usize; D],
    /// Points of cell c are in the slots `starts[c]..starts[c + 1]`; there is one entry more than needed.
    starts: Vec<u32>,
    /// Point in each slot, followed by `LANES` unused entries.
    pub order: Vec<u32>,
    /// Coordinates by slot, axis by axis, and `LANES` more.
    pub x: [Vec<f32>; D],
    keys: Vec<u32>,
}

/// Width of a cell over the radius: rounding of a coordinate must not lose a neighbour.
const WIDER: f64 = 1.0 + 1.0e-5;
/// Most cells a point. For a radius that needs more, cells are wider: memory stays linear in the points.
const MOST_CELLS: usize = 4;

impl<const D: usize> CellList<D> {
    pub fn new() -> Self {
        Self {
            extent: [0; D],
            starts: vec![0; 2],
            order: Vec::new(),
            x: std::array::from_fn(|_| Vec::new()),
            keys: Vec::new(),
        }
    }

    /// Takes new points, N times D coordinates.
    pub fn sort(&mut self, points: &[f32], radius: f32) -> Result<(), GraphError> {
        let (lower, upper) = bounds::<D>(points)?;
        let count = points.len() / D;
        let span: [f64; D] = std::array::from_fn(|a| f64::from(upper[a]) - f64::from(lower[a]));
        let mut size = f64::from(radius) * WIDER;
        let cells = |size: f64| span.map(|s| (s / size).floor() + 1.0);
        while cells(size).iter().product::<f64>() > (MOST_CELLS * count + 64) as f64 {
            size *= 1.25;
        }
        self.extent = cells(size).map(|cells| cells as usize);
        self.count(points, lower.map(f64::from), 1.0 / size);
        self.place(points);
        Ok(())
    }

    /// The key of each point, and where the slots of each cell begin.
    fn count(&mut self, points: &[f32], lower: [f64; D], per_metre: f64) {
        self.starts.clear();
        self.starts
            .resize(self.extent.iter().product::<usize>() + 2, 0);
        let (starts, extent) = (&mut self.starts, self.extent);
        let last = extent.map(|cells| cells as i32 - 1);
        self.keys.clear();
        self.keys.extend(points.chunks_exact(D).map(|x| {
            let key = (0..D).fold(0, |key, axis| {
                let cell = ((f64::from(x[axis]) - lower[axis]) * per_metre) as i32;
                key * extent[axis] + cell.min(last[axis]) as usize
            });
            // Two further than its own place, so that `place` can count up what is one further.
            starts[key + 2] += 1;
            key as u32
        }));
        let mut before = 0;
        for start in &mut starts[2..] {
            before += *start;
            *start = before;
        }
    }

    /// Points of a cell keep their order.
    fn place(&mut self, points: &[f32]) {
        let count = self.keys.len() + LANES;
        self.order.resize(count, 0);
        for axis in &mut self.x {
            axis.resize(count, 0.0);
        }
        for ((point, x), &key) in (0u32..).zip(points.chunks_exact(D)).zip(&self.keys) {
            let next = &mut self.starts[key as usize + 1];
            let slot = *next as usize;
            *next += 1;
            self.order[slot] = point;
            for axis in 0..D {
                self.x[axis][slot] = x[axis];
            }
        }
    }

    pub fn points(&self) -> usize {
        self.keys.len()
    }

    pub fn cells(&self) -> usize {
        self.starts.len() - 2
    }

    /// Slots of a range of cells.
    pub fn slots(&self, cells: Range<usize>) -> Range<usize> {
        self.starts[cells.start] as usize..self.starts[cells.end] as usize
    }

    /// The first cell whose slots do not begin before `slot`.
    pub fn cell_from(&self, slot: usize) -> usize {
        self.starts[..=self.cells()].partition_point(|&start| (start as usize) < slot)
    }

    /// Writes the slots of the 3^D cells around a cell as runs, which are those of three cells along the last axis.
    pub fn runs_around(&self, cell: usize, runs: &mut Vec<Range<usize>>) {
        let mut centre = [0; D];
        let mut rest = cell;
        for axis in (0..D).rev() {
            centre[axis] = rest % self.extent[axis];
            rest /= self.extent[axis];
        }
        let last = self.extent[D - 1];
        let (low, high) = (
            centre[D - 1].saturating_sub(1),
            (centre[D - 1] + 1).min(last - 1),
        );
        runs.clear();
        for flat in 0..3usize.pow(D as u32 - 1) {
            let mut rest = flat;
            let row = (0..D - 1).try_fold(0, |row, axis| {
                let cell = (centre[axis] + rest % 3).wrapping_sub(1);
                rest /= 3;
                (cell < self.extent[axis]).then(|| row * self.extent[axis] + cell)
            });
            if let Some(row) = row {
                let run = self.slots(row * last + low..row * last + high + 1);
                if !run.is_empty() {
                    runs.push(run);
                }
            }
        }
    }
}

/// The smallest and the largest coordinates.
fn bounds<const D: usize>(points: &[f32]) -> Result<([f32; D], [f32; D]), GraphError> {
    let mut low = [[f32::INFINITY; D]; 8];
    let mut high = [[f32::NEG_INFINITY; D]; 8];
    let mut finite = true;
    let (points, _) = points.as_chunks::<D>();
    for group in points.chunks(8) {
        // Comparisons that the compiler turns into the minimum and maximum of vectors; no NaN stays unseen.
        for ((x, low), high) in group.iter().zip(&mut low).zip(&mut high) {
            for axis in 0..D {
                low[axis] = if x[axis] < low[axis] {
                    x[axis]
                } else {
                    low[axis]
                };
                high[axis] = if x[axis] > high[axis] {
                    x[axis]
                } else {
                    high[axis]
                };
                finite &= x[axis].abs() < f32::INFINITY;
            }
        }
    }
    if !finite {
        let bad = |x: &[f32; D]| !x.iter().all(|s| s.is_finite());
        let index = points.iter().position(bad).unwrap_or_default();
        return Err(GraphError::Position {
            index,
            position: points[index].to_vec(),
        });
    }
    if points.is_empty() {
        return Ok(([0.0; D], [0.0; D]));
    }
    Ok((
        std::array::from_fn(|axis| low.iter().map(|x| x[axis]).fold(f32::INFINITY, f32::min)),
        std::array::from_fn(|axis| {
            high.iter()
                .map(|x| x[axis])
                .fold(f32::NEG_INFINITY, f32::max)
        }),
    ))
}
