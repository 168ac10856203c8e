//! Candidates that serve for several frames (Verlet 1967, doi:10.1103/PhysRev.159.98).

use std::ops::Range;

use threads::Pool;

use crate::error::GraphError;
use crate::filter::Filter;
use crate::rows::{Part, Rows, pieces};
use crate::scan::{Reach, Tile, room};
use crate::search::Search;
use crate::settings::{GraphSettings, check_fixed, check_length};

/// Graphs of points that move little from one to the next; they are the same as those of `Search`.
///
/// Pairs within the radius and a skin are found once. They hold until some point has moved by half the skin.
#[derive(Debug)]
pub struct VerletList<const D: usize> {
    settings: GraphSettings,
    skin: f32,
    search: Search<D>,
    /// Where the points were when the candidates were found; nothing before that.
    origin: Vec<f32>,
    /// The candidates of point i are `candidates[starts[i]..starts[i + 1]]`, ascending.
    starts: Vec<u32>,
    candidates: Vec<u32>,
    rows: Rows,
    owners: Vec<u32>,
    lengths: Vec<u32>,
    rebuilds: u64,
}

/// Distances are computed with errors of 1e-16, single precision rounds with 6e-8: this is beyond all of that.
const MARGIN: f64 = 1.0e-6;

impl<const D: usize> VerletList<D> {
    /// `skin` [m] is what is added to the radius.
    pub fn new(settings: GraphSettings, skin: f32) -> Result<Self, GraphError> {
        check_length("radius", settings.radius)?;
        check_length("skin", skin)?;
        check_length("radius + skin", settings.radius + skin)?;
        Ok(Self {
            settings,
            skin,
            search: Search::new(),
            origin: Vec::new(),
            starts: Vec::new(),
            candidates: Vec::new(),
            rows: Rows::default(),
            owners: Vec::new(),
            lengths: Vec::new(),
            rebuilds: 0,
        })
    }

    /// How often the candidates were found anew.
    pub fn rebuilds(&self) -> u64 {
        self.rebuilds
    }

    /// Finds the edges as `Search::find` does.
    pub fn find(
        &mut self,
        points: &[f32],
        fixed: Option<&[bool]>,
        pool: &Pool,
    ) -> Result<usize, GraphError> {
        check_fixed(fixed, points.len() / D)?;
        if !self.still_valid(points) {
            self.rebuild(points, pool)?;
        }
        let count = points.len() / D;
        let share = count.div_ceil(pieces(count, pool)).max(1);
        let ranges = (0..count).step_by(share);
        let ranges = ranges.map(|first| first..(first + share).min(count));
        let parts = self.rows.empty_parts(ranges.len());
        self.lengths.resize(count, 0);
        let sweep = Sweep::<D> {
            starts: &self.starts,
            candidates: &self.candidates,
            filter: Filter {
                points,
                fixed,
                reach: Reach::new(self.settings.radius, self.settings.inclusive),
            },
        };
        let lengths = self.lengths.chunks_mut(share);
        let mut jobs: Vec<_> = ranges.zip(parts).zip(lengths).collect();
        pool.for_each(&mut jobs, |((range, part), lengths)| {
            sweep.run(range.clone(), part, lengths);
        });
        self.rows.check_size(count, &self.settings)?;
        let found = (self.owners.chunks(share)).zip(self.lengths.chunks(share));
        Ok(self.rows.locate(count, found))
    }

    /// The edges into point i are `starts[i]` to `starts[i + 1]`, as in `Search::starts`.
    pub fn starts(&self) -> &[u32] {
        &self.rows.starts
    }

    /// Writes the senders of all edges, as `Search::write_senders` does.
    pub fn write_senders(&self, into: &mut [u32], pool: &Pool) {
        self.rows.write(into, pool);
    }

    /// Whether no point has moved so far that an edge could be missing among the candidates.
    fn still_valid(&self, points: &[f32]) -> bool {
        let most = (f64::from(self.skin) / 2.0 * (1.0 - MARGIN)).powi(2);
        let pairs = points.chunks_exact(D).zip(self.origin.chunks_exact(D));
        // A point that is no number has moved too far: the search then says which.
        points.len() == self.origin.len()
            && self.rebuilds > 0
            && pairs.fold(true, |near, (x, origin)| {
                let moved = (0..D).fold(0.0, |sum, axis| {
                    sum + (f64::from(x[axis]) - f64::from(origin[axis])).powi(2)
                });
                near & (moved <= most)
            })
    }

    fn rebuild(&mut self, points: &[f32], pool: &Pool) -> Result<(), GraphError> {
        // Should the search fail, the next call starts afresh.
        self.origin.clear();
        let wide = f64::from(self.settings.radius) + f64::from(self.skin);
        let settings = GraphSettings {
            radius: (wide * (1.0 + MARGIN)) as f32,
            inclusive: true,
            max_edges: u32::MAX,
            ..self.settings
        };
        let count = self.search.find(points, None, &settings, pool)?;
        self.candidates.resize(count, 0);
        self.search.write_senders(&mut self.candidates, pool);
        self.starts.clear();
        self.starts.extend_from_slice(self.search.starts());
        self.owners.clear();
        self.owners.extend(0..(points.len() / D) as u32);
        self.origin.extend_from_slice(points);
        self.rebuilds += 1;
        Ok(())
    }
}

/// What all threads read.
struct Sweep<'a, const D: usize> {
    starts: &'a [u32],
    candidates: &'a [u32],
    filter: Filter<'a, D>,
}

impl<const D: usize> Sweep<'_, D> {
    fn run(&self, range: Range<usize>, part: &mut Part, lengths: &mut [u32]) {
        let mut tile = Tile::<D>::new();
        let (points, _) = self.filter.points.as_chunks::<D>();
        for (own, length) in range.zip(lengths) {
            let row = self.starts[own] as usize..self.starts[own + 1] as usize;
            tile.gather(&self.candidates[row], self.filter.points);
            let row = part.room(room(tile.room()));
            let found = tile.scan_around(&points[own], &self.filter.reach, row);
            let count = self.filter.keep(own, found, row);
            part.keep(count);
            *length = count as u32;
        }
    }
}
