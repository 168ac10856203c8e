//! Slabs of the grid that may be scattered to side by side.

use std::ops::Range;

use crate::grid::{MARGIN, PADDING};
use threads::Step;

/// Planes `lo..hi` of the grid; the particles whose stencil starts there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slab {
    pub lo: usize,
    pub hi: usize,
    /// Cost of a substep, in that of a particle: what threads share out.
    pub cost: usize,
}

impl Slab {
    /// The planes that its particles touch before the next sort.
    pub fn reach(self) -> Range<usize> {
        self.lo.saturating_sub(MARGIN)..self.hi + MARGIN + 2
    }
}

/// The planes that no slab has touched before the one with this index in the order of `COLOURS`.
pub fn fresh_planes(slabs: &[Slab], index: usize) -> Range<usize> {
    let Range { mut start, mut end } = slabs[index].reach();
    // Those of the first colour come before both of their neighbours, those of the second after both.
    if index % 2 == 1 {
        start = slabs[index - 1].reach().end;
        end = slabs.get(index + 1).map_or(end, |next| next.reach().start);
    }
    start..end
}

/// Thinner slabs of one colour would touch the same nodes: a stencil reaches two planes beyond its
/// base, and the base moves by one in either direction between sorts.
const MIN_PLANES: usize = 4;
/// More than eight threads gain nothing at the sizes that are interactive.
pub const MAX_SLABS: usize = 16;
/// Smaller slabs waste too many lanes of their last blocks.
const SMALLEST_SLAB: usize = 256;

/// Cuts the planes into slabs with about equal numbers of particles, from their number in each plane.
///
/// No cut parts one of `walls` from the planes before and behind it: contact across the first axis stays within a slab.
pub fn cut(per_plane: &[usize], walls: &[usize]) -> Vec<Slab> {
    let total: usize = per_plane.iter().sum();
    let share = total.div_ceil(MAX_SLABS).max(SMALLEST_SLAB);
    let end = per_plane.len() - PADDING + 1;
    let mut slabs = Vec::new();
    let (mut lo, mut held) = (0, 0);
    for (plane, &count) in per_plane.iter().enumerate().take(end) {
        held += count;
        let hi = plane + 1;
        let at_wall = walls.iter().any(|&wall| hi == wall || hi == wall + 1);
        if held >= share && hi - lo >= MIN_PLANES && slabs.len() + 1 < MAX_SLABS && !at_wall {
            slabs.push(Slab { lo, hi, cost: held });
            (lo, held) = (hi, 0);
        }
    }
    match slabs.last_mut() {
        // The remainder joins the last slab if it is too thin for one of its own.
        Some(last) if end - lo < MIN_PLANES || held == 0 => {
            last.hi = end;
            last.cost += held;
        }
        _ => slabs.push(Slab {
            lo,
            hi: end,
            cost: held,
        }),
    }
    slabs
}

/// The planes of a grid with this extent, cut as the slabs are. These tile the planes where stencils start, which end on
/// later ones.
pub fn bands(slabs: &[Slab], extent: usize) -> Vec<Range<usize>> {
    let last = slabs.len().saturating_sub(1);
    let hi = |index: usize, slab: &Slab| if index == last { extent } else { slab.hi };
    let numbered = slabs.iter().enumerate();
    numbered
        .map(|(index, slab)| slab.lo..hi(index, slab))
        .collect()
}

/// Slabs of one colour touch different nodes and may be scattered side by side. Those of the second colour follow their
/// neighbours, so each node sums in the same order whatever the number of threads.
pub const COLOURS: [Step; 2] = [Step::EVEN, Step::ODD];

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn slabs_tile_the_planes_and_are_never_thin(
            counts in prop::collection::vec(0usize..300, 20..140), wall in 5usize..15,
        ) {
            let walls = [wall, counts.len() - wall];
            let slabs = cut(&counts, &walls);
            prop_assert_eq!(slabs[0].lo, 0);
            prop_assert_eq!(slabs.last().unwrap().hi, counts.len() - PADDING + 1);
            for pair in slabs.windows(2) {
                prop_assert_eq!(pair[0].hi, pair[1].lo);
                prop_assert!(walls.iter().all(|&wall| pair[0].hi != wall && pair[0].hi != wall + 1));
            }
            prop_assert!(slabs.len() == 1 || slabs.iter().all(|s| s.hi - s.lo >= MIN_PLANES));
            prop_assert!(slabs.len() <= MAX_SLABS);
        }

        #[test]
        fn each_plane_is_fresh_once_and_before_anybody_touches_it(counts in prop::collection::vec(0usize..300, 20..140)) {
            let slabs = cut(&counts, &[]);
            let mut cleared = vec![false; counts.len() + MARGIN + 2];
            for index in (0..slabs.len()).step_by(2).chain((1..slabs.len()).step_by(2)) {
                for plane in fresh_planes(&slabs, index) {
                    prop_assert!(!std::mem::replace(&mut cleared[plane], true));
                }
                prop_assert!(slabs[index].reach().all(|plane| cleared[plane]));
            }
        }
    }
}
