//! Where the stencils of particles start, by plane of the grid.

use std::ops::Range;

use super::block::Block;
use crate::grid::{Layout, Place, Stencils};
use crate::linalg::{Kernel, LANES, Quad, run_wide};
use crate::material::State;

/// A particle, and where its stencil starts.
#[derive(Debug, Clone, Copy, Default)]
pub struct Located {
    /// Its number among the lanes of all blocks of its shelf.
    pub number: u32,
    pub place: Place,
}

/// The particles of consecutive blocks, plane by plane and within a plane in their order.
#[derive(Debug, Clone, Default)]
pub struct Places {
    located: Vec<Located>,
    /// Where the particles of each plane begin, and behind the last plane their number.
    starts: Vec<u32>,
    /// The same particles in the order of the blocks; scratch.
    found: Vec<Located>,
    /// Whether they lie in the blocks in the order of cells.
    in_order: bool,
}

impl Places {
    /// Finds the particles of some blocks; `first` is the number of their first lane.
    pub fn find<const D: usize, S: State>(
        &mut self,
        blocks: &[Block<D, S>],
        first: usize,
        layout: &Layout<D>,
    ) {
        self.found.clear();
        run_wide(FindPlaces {
            blocks,
            first,
            layout,
            found: &mut self.found,
        });
        self.in_order = self.found.is_sorted_by_key(|located| located.place);
        self.starts.clear();
        self.starts.resize(layout.planes() + 1, 0);
        for located in &self.found {
            self.starts[located.place.plane as usize + 1] += 1;
        }
        for plane in 0..layout.planes() {
            self.starts[plane + 1] += self.starts[plane];
        }
        self.located.resize(self.found.len(), Located::default());
        // Each start moves to the end of its plane, where the next one starts.
        for located in &self.found {
            let start = &mut self.starts[located.place.plane as usize];
            self.located[*start as usize] = *located;
            *start += 1;
        }
        self.starts.copy_within(..layout.planes(), 1);
        self.starts[0] = 0;
    }

    /// The particles whose stencils start in some planes.
    pub fn of_planes(&self, planes: Range<usize>) -> &[Located] {
        &self.located[self.starts[planes.start] as usize..self.starts[planes.end] as usize]
    }

    /// Where the stencils of all start, plane by plane.
    pub fn all(&self) -> impl Iterator<Item = Place> {
        self.located.iter().map(|located| located.place)
    }

    /// The lowest and the highest place along each axis; None without particles.
    pub fn bounds(&self) -> Option<[Place; 2]> {
        let both = |place| [place, place];
        let union = |a: [Place; 2], b: Place| [a[0].lowest(b), a[1].highest(b)];
        let first = self.located.first()?.place;
        Some(self.all().fold(both(first), union))
    }

    /// Whether particles lie in the blocks of all parts, one after the other, in the order of cells.
    pub fn all_in_order(parts: &[Self]) -> bool {
        let filled = || parts.iter().filter(|part| !part.located.is_empty());
        let ends = |part: &Self| part.located.last().map(|located| located.place);
        let begins = |part: &Self| part.located.first().map(|located| located.place);
        let mut pairs = filled().zip(filled().skip(1));
        filled().all(|part| part.in_order) && pairs.all(|(one, next)| ends(one) <= begins(next))
    }
}

struct FindPlaces<'a, const D: usize, S: State> {
    blocks: &'a [Block<D, S>],
    first: usize,
    layout: &'a Layout<D>,
    found: &'a mut Vec<Located>,
}

impl<const D: usize, S: State> Kernel for FindPlaces<'_, D, S> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        self.found.reserve(self.blocks.len() * LANES);
        for (index, block) in self.blocks.iter().enumerate() {
            let base = Stencils::at(&block.x, self.layout).base;
            let number = (self.first + index * LANES) as u32;
            self.found.extend((0..block.count.min(LANES)).map(|lane| {
                let place = Place {
                    plane: base[0][lane] as u16,
                    row: if D == 3 { base[1][lane] as u16 } else { 0 },
                    column: base[D - 1][lane] as u16,
                };
                let number = number + lane as u32;
                Located { number, place }
            }));
        }
    }
}
