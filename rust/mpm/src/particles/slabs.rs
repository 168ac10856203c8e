//! Slabs of the grid that may be scattered to side by side.

use crate::grid::{Grid, Layout, MARGIN, PADDING, Place, Window};
use threads::Team;

/// Planes `lo..hi` of the grid; the particles whose stencil starts there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slab {
    pub lo: usize,
    pub hi: usize,
}

/// Thinner slabs of one colour would touch the same nodes: a stencil reaches two planes beyond its
/// base, and the base moves by one in either direction between sorts.
const MIN_PLANES: usize = 4;
/// More than eight threads gain nothing at the sizes that are interactive.
const MAX_SLABS: usize = 16;
/// Smaller slabs waste too many lanes of their last blocks.
const SMALLEST_SLAB: usize = 256;

/// Cuts the planes into slabs with about equal numbers of particles, from their number in each plane.
pub fn cut(per_plane: &[usize]) -> Vec<Slab> {
    let total: usize = per_plane.iter().sum();
    let share = total.div_ceil(MAX_SLABS).max(SMALLEST_SLAB);
    let end = per_plane.len() - PADDING + 1;
    let mut slabs = Vec::new();
    let (mut lo, mut held) = (0, 0);
    for (plane, &count) in per_plane.iter().enumerate().take(end) {
        held += count;
        if held >= share && plane + 1 - lo >= MIN_PLANES && slabs.len() + 1 < MAX_SLABS {
            slabs.push(Slab { lo, hi: plane + 1 });
            (lo, held) = (plane + 1, 0);
        }
    }
    match slabs.last_mut() {
        // What is left over joins the last slab if it is too thin to stand alone.
        Some(last) if end - lo < MIN_PLANES || held == 0 => last.hi = end,
        _ => slabs.push(Slab { lo, hi: end }),
    }
    slabs
}

/// Number of particles whose stencil starts in each plane.
pub fn count_planes<const D: usize>(places: &[Place], layout: &Layout<D>) -> Vec<usize> {
    let mut per_row = vec![0u32; layout.row_count()];
    for place in places {
        per_row[place.row as usize] += 1;
    }
    let planes = per_row.chunks(layout.rows_per_plane());
    planes
        .map(|rows| rows.iter().sum::<u32>() as usize)
        .collect()
}

/// Calls `scatter` for each slab, by its index, with the nodes that its particles touch.
///
/// Slabs of one colour touch different nodes and may run at once; colours follow each other, so each node
/// sums in the same order whatever the number of threads.
pub fn for_each_slab<const D: usize>(
    slabs: &[Slab],
    grid: &mut Grid<D>,
    team: &Team,
    scatter: impl Fn(usize, &mut Window<'_, D>) + Sync,
) {
    for colour in 0..2 {
        let of_colour = slabs.iter().enumerate().skip(colour).step_by(2);
        let reach = |slab: &Slab| slab.lo.saturating_sub(MARGIN)..slab.hi + MARGIN + 2;
        let windows = grid.windows(of_colour.clone().map(|(_, slab)| reach(slab)));
        let mut parts: Vec<_> = of_colour.map(|(index, _)| index).zip(windows).collect();
        team.for_each(&mut parts, |(slab, window)| scatter(*slab, window));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn slabs_tile_the_planes_and_are_never_thin(counts in prop::collection::vec(0usize..300, 20..140)) {
            let slabs = cut(&counts);
            prop_assert_eq!(slabs[0].lo, 0);
            prop_assert_eq!(slabs.last().unwrap().hi, counts.len() - PADDING + 1);
            for pair in slabs.windows(2) {
                prop_assert_eq!(pair[0].hi, pair[1].lo);
            }
            prop_assert!(slabs.len() == 1 || slabs.iter().all(|s| s.hi - s.lo >= MIN_PLANES));
            prop_assert!(slabs.len() <= MAX_SLABS);
        }
    }
}
