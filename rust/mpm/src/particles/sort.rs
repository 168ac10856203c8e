//! Sorting particles by cell.

use super::block::Block;
use super::group::{MaterialGroup, Run, Sorted, with_group};
use super::particle::Activity;
use super::slabs::{Slab, count_planes, cut};
use crate::grid::{Layout, Place, Stencils};
use crate::linalg::LANES;
use crate::material::State;
use threads::Team;

/// Sorts all particles that carry by the cell where their stencils start, and cuts the grid into slabs of about equal numbers of them.
///
/// The cut depends on the particles alone, never on the number of threads. Writes where these particles are,
/// in no order, to `places`. No cut parts the planes of `walls` from their neighbours.
pub fn sort<const D: usize>(
    groups: &mut [MaterialGroup<D>],
    layout: &Layout<D>,
    walls: &[usize],
    places: &mut Vec<Place>,
    team: &Team,
) -> Vec<Slab> {
    places.clear();
    let mut ends = Vec::with_capacity(2 * groups.len());
    for group in groups.iter() {
        with_group!(group, group => for blocks in [&group.awake.blocks, &group.border.blocks] {
            find_places(blocks, layout, places);
            ends.push(places.len());
        });
    }
    let slabs = cut(&count_planes(places, layout), walls);
    let mut start = 0;
    let mut ends = ends.into_iter();
    for group in groups {
        with_group!(group, group => {
            let vacant = group.particles().next().map(|first| group.vacant_like(&first));
            for (sorted, activity) in [
                (&mut group.awake, Activity::Awake),
                (&mut group.border, Activity::Border),
            ] {
                let end = ends.next().expect("one end for each");
                sort_blocks(sorted, activity, &places[start..end], &slabs, layout, vacant.as_ref(), team);
                start = end;
            }
        });
    }
    slabs
}

fn find_places<const D: usize, S: State>(
    blocks: &[Block<D, S>],
    layout: &Layout<D>,
    places: &mut Vec<Place>,
) {
    for block in blocks {
        let base = Stencils::at(&block.x, layout).base;
        places.extend((0..block.count).map(|lane| Place {
            row: (0..D - 1).fold(0, |row, axis| row * layout.extent as u32 + base[axis][lane]),
            column: base[D - 1][lane],
        }));
    }
}

/// Stable counting sort, first by column and then by row; the order within a cell is the previous one. Each slab
/// begins with a new block.
fn sort_blocks<const D: usize, S: State>(
    sorted: &mut Sorted<D, S>,
    activity: Activity,
    places: &[Place],
    slabs: &[Slab],
    layout: &Layout<D>,
    vacant: Option<&Block<D, S>>,
    team: &Team,
) {
    let mut next = vec![0u32; layout.row_count()];
    for place in places {
        next[place.row as usize] += 1;
    }
    let rows_per_plane = layout.rows_per_plane();
    let (mut slot, mut runs) = (0, Vec::with_capacity(slabs.len()));
    for slab in slabs {
        let first = slot;
        for row in &mut next[slab.lo * rows_per_plane..slab.hi * rows_per_plane] {
            slot += std::mem::replace(row, slot);
        }
        runs.push(Run {
            first_block: first as usize / LANES,
            particles: (slot - first) as usize,
        });
        slot = slot.next_multiple_of(LANES as u32);
    }
    let in_place = runs == sorted.runs && places.is_sorted();
    sorted.runs = runs;
    let Some(vacant) = vacant.filter(|_| !in_place) else {
        return;
    };
    // Which particle goes to which slot, first as numbers; then each new block fetches its own.
    let mut sources = vec![VACANT; slot as usize];
    for (source, row) in by_column(&sorted.blocks, places, layout) {
        let slot = &mut next[row as usize];
        sources[*slot as usize] = source;
        *slot += 1;
    }
    sorted.scratch.resize(sources.len() / LANES, *vacant);
    let blocks = &sorted.blocks;
    let mut targets: Vec<_> = sorted
        .scratch
        .iter_mut()
        .zip(sources.chunks(LANES))
        .collect();
    let share = targets.len().div_ceil(4 * team.size()).max(1);
    let mut parts: Vec<_> = targets.chunks_mut(share).collect();
    team.for_each(&mut parts, |part| {
        part.iter_mut()
            .for_each(|(target, sources)| fetch(target, sources, blocks, activity, vacant));
    });
    std::mem::swap(&mut sorted.blocks, &mut sorted.scratch);
}

/// The number and the row of each particle, in the order of columns.
fn by_column<const D: usize, S: State>(
    blocks: &[Block<D, S>],
    places: &[Place],
    layout: &Layout<D>,
) -> Vec<(u32, u32)> {
    let mut next = vec![0u32; layout.extent];
    for place in places {
        next[place.column as usize] += 1;
    }
    let mut slot = 0;
    for column in &mut next {
        slot += std::mem::replace(column, slot);
    }
    let mut ordered = vec![(0, 0); places.len()];
    let numbers = blocks.iter().enumerate().flat_map(|(index, block)| {
        (index * LANES..index * LANES + block.count).map(|number| number as u32)
    });
    for (number, place) in numbers.zip(places) {
        let slot = &mut next[place.column as usize];
        ordered[*slot as usize] = (number, place.row);
        *slot += 1;
    }
    ordered
}

fn fetch<const D: usize, S: State>(
    target: &mut Block<D, S>,
    sources: &[u32],
    blocks: &[Block<D, S>],
    activity: Activity,
    vacant: &Block<D, S>,
) {
    let count = sources
        .iter()
        .take_while(|&&source| source != VACANT)
        .count();
    if count < LANES {
        *target = *vacant;
    }
    target.count = count;
    for (lane, &source) in sources.iter().enumerate().take(count) {
        let source = source as usize;
        target.set(lane, &blocks[source / LANES].get(source % LANES, activity));
    }
}

/// A slot behind the last particle of a slab.
const VACANT: u32 = u32::MAX;
