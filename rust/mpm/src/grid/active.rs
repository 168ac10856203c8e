//! Which nodes particles can touch before they are sorted again.

use std::ops::Range;

use super::layout::{CHUNK, Layout, MARGIN, Place, Span};

/// Active spans, ordered by row and then along it.
#[derive(Debug, Clone)]
pub struct ActiveSpans {
    spans: Vec<Span>,
    /// Where those of each plane begin, and behind the last plane their number.
    starts: Vec<usize>,
}

impl ActiveSpans {
    pub fn none<const D: usize>(layout: &Layout<D>) -> Self {
        Self {
            spans: Vec::new(),
            starts: vec![0; layout.planes() + 1],
        }
    }

    /// All of them.
    pub fn all(&self) -> &[Span] {
        &self.spans
    }

    /// Those of some planes.
    pub fn of_planes(&self, planes: Range<usize>) -> &[Span] {
        &self.spans[self.starts[planes.start]..self.starts[planes.end]]
    }

    /// Number of active nodes in some planes.
    pub fn nodes(&self, planes: Range<usize>) -> usize {
        let spans = self.of_planes(planes);
        spans.iter().map(|span| span.hi - span.lo).sum()
    }

    /// Puts together the spans of bands of planes that follow each other.
    pub fn gather(&mut self, bands: &[Band]) {
        self.spans.clear();
        self.starts.clear();
        for band in bands {
            let before = self.spans.len();
            self.starts
                .extend(band.starts.iter().map(|start| before + start));
            self.spans.extend_from_slice(&band.spans);
        }
        self.starts.push(self.spans.len());
    }
}

/// The active spans of consecutive planes.
#[derive(Debug, Clone, Default)]
pub struct Band {
    spans: Vec<Span>,
    /// Where those of each plane begin.
    starts: Vec<usize>,
    /// The nodes of one row, one bit each; scratch.
    row: Vec<u64>,
}

/// Nodes in reach of particles along the planes where their stencils start.
#[derive(Debug, Clone, Default)]
pub struct Reach {
    /// One bit a node, rows padded to whole words.
    nodes: Vec<u64>,
    /// One bit for each row that has such nodes, planes padded to whole words.
    rows: Vec<u64>,
    words_per_row: usize,
    words_per_plane: usize,
    rows_per_plane: usize,
}

/// That of consecutive planes, to be written by one thread.
pub struct ReachOfPlanes<'a> {
    first_plane: usize,
    nodes: &'a mut [u64],
    rows: &'a mut [u64],
    words_per_row: usize,
    words_per_plane: usize,
    rows_per_plane: usize,
}

impl Reach {
    pub fn new<const D: usize>(layout: &Layout<D>) -> Self {
        let words_per_row = layout.row_length.div_ceil(64);
        let words_per_plane = layout.rows_per_plane().div_ceil(64);
        Self {
            nodes: vec![0; layout.row_count() * words_per_row],
            rows: vec![0; layout.planes() * words_per_plane],
            words_per_row,
            words_per_plane,
            rows_per_plane: layout.rows_per_plane(),
        }
    }

    /// Cuts it into bands of planes.
    pub fn split(&mut self, bands: &[Range<usize>]) -> Vec<ReachOfPlanes<'_>> {
        let (mut nodes, mut rows) = (&mut self.nodes[..], &mut self.rows[..]);
        let mut parts = Vec::with_capacity(bands.len());
        for planes in bands {
            let words = planes.len() * self.rows_per_plane * self.words_per_row;
            let my_nodes = nodes.split_at_mut(words);
            let my_rows = rows.split_at_mut(planes.len() * self.words_per_plane);
            parts.push(ReachOfPlanes {
                first_plane: planes.start,
                nodes: my_nodes.0,
                rows: my_rows.0,
                words_per_row: self.words_per_row,
                words_per_plane: self.words_per_plane,
                rows_per_plane: self.rows_per_plane,
            });
            (nodes, rows) = (my_nodes.1, my_rows.1);
        }
        parts
    }
}

impl ReachOfPlanes<'_> {
    /// Replaces the nodes in reach.
    pub fn replace(&mut self, places: impl Iterator<Item = Place>) {
        self.clear();
        // Neighbours in the order share rows: their bits are collected and written together.
        let mut row = None;
        let (mut word, mut bits) = (0, [0u64; 2]);
        places.for_each(|place| {
            let first = place.column as usize - MARGIN;
            let of_place = Some((place.plane, place.row));
            if (row, word) != (of_place, first / 64) {
                self.mark(row, word, bits);
                (row, word, bits) = (of_place, first / 64, [0; 2]);
            }
            bits[0] |= REACHED << (first % 64);
            // Bits beyond the word; two shifts, because a shift by 64 does nothing.
            bits[1] |= REACHED >> 1 >> (63 - first % 64);
        });
        self.mark(row, word, bits);
    }

    fn clear(&mut self) {
        let planes = self.rows.chunks_exact_mut(self.words_per_plane);
        for (plane, rows) in planes.enumerate() {
            for (index, word) in rows.iter_mut().enumerate() {
                for bit in set_bits(std::mem::take(word)) {
                    let row = plane * self.rows_per_plane + 64 * index + bit;
                    self.nodes[row * self.words_per_row..][..self.words_per_row].fill(0);
                }
            }
        }
    }

    /// Adds two words of bits to all rows within reach of one along its plane.
    fn mark(&mut self, row: Option<(u16, u16)>, word: usize, bits: [u64; 2]) {
        let Some((plane, row)) = row else {
            return;
        };
        let plane = plane as usize - self.first_plane;
        let rows = if self.rows_per_plane == 1 {
            0..1
        } else {
            row as usize - MARGIN..row as usize + MARGIN + 3
        };
        for row in rows {
            self.rows[plane * self.words_per_plane + row / 64] |= 1 << (row % 64);
            let row = plane * self.rows_per_plane + row;
            let nodes = &mut self.nodes[row * self.words_per_row..][..self.words_per_row];
            nodes[word] |= bits[0];
            if bits[1] > 0 {
                nodes[word + 1] |= bits[1];
            }
        }
    }
}

/// One bit for each node along an axis that a stencil reaches before the next sort.
const REACHED: u64 = (1 << (2 * MARGIN + 3)) - 1;

impl Band {
    /// Finds the spans of some planes: within reach along the first axis, too.
    pub fn find(&mut self, reach: &Reach, planes: &Range<usize>) {
        self.spans.clear();
        self.starts.clear();
        let (words, words_per_plane) = (reach.words_per_row, reach.words_per_plane);
        let last = reach.rows.len() / words_per_plane;
        self.row.resize(words, 0);
        for plane in planes.clone() {
            self.starts.push(self.spans.len());
            // The planes where stencils start that reach this one.
            let around = plane.saturating_sub(MARGIN + 2)..(plane + MARGIN + 1).min(last);
            for index in 0..words_per_plane {
                let rows = |plane: usize| reach.rows[plane * words_per_plane + index];
                let any = around.clone().fold(0, |any, plane| any | rows(plane));
                for bit in set_bits(any) {
                    let row = 64 * index + bit;
                    self.row.fill(0);
                    for plane in around.clone() {
                        let row = plane * reach.rows_per_plane + row;
                        let nodes = &reach.nodes[row * words..][..words];
                        let pairs = self.row.iter_mut().zip(nodes);
                        pairs.for_each(|(all, nodes)| *all |= nodes);
                    }
                    self.push_spans(plane * reach.rows_per_plane + row);
                }
            }
        }
    }

    /// Adds the spans of a row: whole chunks around its bits.
    fn push_spans(&mut self, row: usize) {
        let first = self.spans.len();
        let mut column = 0;
        while let Some(lo) = next_bit(&self.row, column, true) {
            let hi = next_bit(&self.row, lo, false).unwrap_or(self.row.len() * 64);
            let (lo, hi) = (lo / CHUNK * CHUNK, hi.next_multiple_of(CHUNK));
            match self.spans[first..].last_mut() {
                Some(last) if lo <= last.hi => last.hi = hi,
                _ => self.spans.push(Span { row, lo, hi }),
            }
            column = hi;
        }
    }
}

fn set_bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (word != 0).then(|| word.trailing_zeros() as usize);
        word &= word.wrapping_sub(1);
        bit
    })
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
