//! Rows of neighbours as threads find them, and as one array.

use threads::Pool;

use crate::error::GraphError;
use crate::settings::GraphSettings;

/// The neighbours of all points, in the parts that threads wrote.
#[derive(Debug, Default)]
pub(crate) struct Rows {
    /// The row of point i has its place at `starts[i]..starts[i + 1]` of the whole.
    pub starts: Vec<u32>,
    places: Vec<Place>,
    parts: Vec<Part>,
}

/// Where the row of a point begins.
#[derive(Debug, Clone, Copy, Default)]
struct Place {
    part: u32,
    first: u32,
}

/// Rows one after the other.
#[derive(Debug, Default)]
pub(crate) struct Part {
    found: Vec<u32>,
    len: usize,
}

impl Part {
    /// Space for a row of at most `most` entries behind the others; `keep` then takes its length.
    pub fn room(&mut self, most: usize) -> &mut [u32] {
        let needed = self.len + most;
        if needed > self.found.len() {
            self.found.resize(needed.max(2 * self.found.len()), 0);
        }
        &mut self.found[self.len..needed]
    }

    pub fn keep(&mut self, count: usize) {
        self.len += count;
    }

    pub fn len(&self) -> usize {
        self.len
    }
}

impl Rows {
    /// Empty parts, `count` of them; others keep their memory for a call with more.
    pub fn empty_parts(&mut self, count: usize) -> &mut [Part] {
        if self.parts.len() < count {
            self.parts.resize_with(count, Part::default);
        }
        self.parts.iter_mut().for_each(|part| part.len = 0);
        &mut self.parts[..count]
    }

    /// Entries that there is memory for.
    pub fn capacity(&self) -> usize {
        self.parts.iter().map(|part| part.found.capacity()).sum()
    }

    /// Fails where there are more entries than the settings allow.
    pub fn check_size(&self, points: usize, settings: &GraphSettings) -> Result<(), GraphError> {
        let limit = settings.max_edges as usize;
        if self.parts.iter().map(Part::len).sum::<usize>() > limit {
            let radius = settings.radius;
            return Err(GraphError::Edges {
                points,
                radius,
                limit,
            });
        }
        Ok(())
    }

    /// Notes where rows are: for each part the points of its rows, in order, with the lengths of these.
    ///
    /// Returns the number of all entries.
    pub fn locate<'a>(
        &mut self,
        points: usize,
        rows: impl Iterator<Item = (&'a [u32], &'a [u32])>,
    ) -> usize {
        self.starts.clear();
        self.starts.resize(points + 1, 0);
        self.places.resize(points, Place::default());
        for (part, (owners, lengths)) in (0u32..).zip(rows) {
            let mut first = 0;
            for (&owner, &length) in owners.iter().zip(lengths) {
                self.places[owner as usize] = Place { part, first };
                self.starts[owner as usize + 1] = length;
                first += length;
            }
        }
        let mut total = 0usize;
        for start in &mut self.starts[1..] {
            total += *start as usize;
            *start = total as u32;
        }
        total
    }

    /// Writes all rows in the order of their points.
    pub fn write(&self, into: &mut [u32], pool: &Pool) {
        let points = self.places.len();
        let pieces = if into.len() < WORTH_SHARING_COPIES {
            1
        } else {
            pieces(points, pool)
        };
        let share = points.div_ceil(pieces).max(1);
        let mut rest = into;
        let mut jobs: Vec<(usize, &mut [u32])> = (0..points)
            .step_by(share)
            .map(|first| {
                let end = (first + share).min(points);
                let length = self.starts[end] - self.starts[first];
                let (mine, others) = std::mem::take(&mut rest).split_at_mut(length as usize);
                rest = others;
                (first, mine)
            })
            .collect();
        pool.for_each(&mut jobs, |(first, into)| self.write_from(*first, into));
    }

    /// Writes rows of the points from `first` on, up to the length of `into`.
    fn write_from(&self, first: usize, mut into: &mut [u32]) {
        for (place, start) in self.places[first..]
            .iter()
            .zip(self.starts[first..].windows(2))
        {
            let length = (start[1] - start[0]) as usize;
            if length > into.len() {
                break;
            }
            let (mine, others) = into.split_at_mut(length);
            let found = &self.parts[place.part as usize].found;
            mine.copy_from_slice(&found[place.first as usize..][..length]);
            into = others;
        }
    }
}

/// Fewer points than this are searched by the calling thread: in a quarter of a millisecond, of which the pool would
/// need a good part to wake its threads.
const WORTH_SHARING: usize = 4096;

/// Fewer entries than this are copied by the calling thread, for the same reason.
const WORTH_SHARING_COPIES: usize = 1 << 18;

/// Pieces of work for `points` points: several a thread, so that a slow one does not keep the others waiting.
pub(crate) fn pieces(points: usize, pool: &Pool) -> usize {
    if pool.size() == 1 || points < WORTH_SHARING {
        1
    } else {
        (points / 128).clamp(1, 8 * pool.size())
    }
}
