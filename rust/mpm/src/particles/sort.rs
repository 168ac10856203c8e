//! Sorting particles by cell.

use std::ops::Range;

use super::block::Block;
use super::group::{MaterialGroup, Run, Sorted, with_group};
use super::particle::Activity;
use super::places::{Located, Places};
use super::slabs::{Slab, cut};
use crate::grid::{Layout, Place};
use crate::linalg::LANES;
use crate::material::State;
use threads::Team;

/// Sorts particles; kept to reuse its memory.
#[derive(Debug, Clone, Default)]
pub struct Sorter {
    /// Shelf by shelf.
    parts: Vec<Places>,
    /// The ends of the parts of each shelf, two for each group.
    ends: Vec<usize>,
    /// One for each slab.
    orders: Vec<Order>,
}

/// Blocks of one shelf of one group.
struct Part {
    group: usize,
    awake: bool,
    blocks: Range<usize>,
}

/// Smaller parts are not worth handing out.
const SMALLEST_PART: usize = 16;

impl Sorter {
    /// Sorts all particles that carry by the cell where their stencils start, and cuts the grid into slabs of about equal
    /// numbers of them.
    ///
    /// The cut depends on the particles alone, never on the number of threads. No cut parts the planes of `walls` from
    /// their neighbours.
    pub fn sort<const D: usize>(
        &mut self,
        groups: &mut [MaterialGroup<D>],
        layout: &Layout<D>,
        walls: &[usize],
        team: &Team,
    ) -> Vec<Slab> {
        self.find(groups, layout, team);
        let count = |plane: usize| {
            let of_plane = |part: &Places| part.of_planes(plane..plane + 1).len();
            self.parts.iter().map(of_plane).sum()
        };
        let slabs = cut(&(0..layout.planes()).map(count).collect::<Vec<_>>(), walls);
        self.orders.resize_with(slabs.len(), Order::default);
        let mut start = 0;
        let mut ends = self.ends.iter().copied();
        for group in groups {
            with_group!(group, group => {
                let vacant = group.particles().next().map(|first| group.vacant_like(&first));
                for (sorted, activity) in [
                    (&mut group.awake, Activity::Awake),
                    (&mut group.border, Activity::Border),
                ] {
                    let end = ends.next().expect("one end for each");
                    let shelf = Shelf {
                        parts: &self.parts[start..end],
                        slabs: &slabs,
                        layout,
                        activity,
                        vacant: vacant.as_ref(),
                    };
                    shelf.sort(sorted, &mut self.orders, team);
                    start = end;
                }
            });
        }
        slabs
    }

    /// Where the stencils start that start in some planes, in no order.
    pub fn places(&self, planes: Range<usize>) -> impl Iterator<Item = Place> {
        let of_part = move |part| Places::of_planes(part, planes.clone());
        let located = self.parts.iter().flat_map(of_part);
        located.map(|located| located.place)
    }

    /// Where the stencils of a group start, plane by plane.
    pub fn places_of(&self, group: usize) -> impl Iterator<Item = Place> {
        self.parts_of(group).iter().flat_map(Places::all)
    }

    /// The lowest and the highest place of a group along each axis; None where it has no particles.
    pub fn bounds_of(&self, group: usize) -> Option<[Place; 2]> {
        let bounds = self.parts_of(group).iter().filter_map(Places::bounds);
        bounds.reduce(|a, b| [a[0].lowest(b[0]), a[1].highest(b[1])])
    }

    fn parts_of(&self, group: usize) -> &[Places] {
        let start = if group == 0 {
            0
        } else {
            self.ends[2 * group - 1]
        };
        &self.parts[start..self.ends[2 * group + 1]]
    }

    /// Finds all particles, on all free threads.
    fn find<const D: usize>(
        &mut self,
        groups: &[MaterialGroup<D>],
        layout: &Layout<D>,
        team: &Team,
    ) {
        let mut parts = Vec::new();
        self.ends.clear();
        for (index, group) in groups.iter().enumerate() {
            with_group!(group, group => for (awake, sorted) in [(true, &group.awake), (false, &group.border)] {
                let count = sorted.blocks.len();
                let share = if team.size() == 1 { count } else { count.div_ceil(4 * team.size()) };
                let share = share.max(SMALLEST_PART);
                parts.extend((0..count).step_by(share).map(|first| Part {
                    group: index,
                    awake,
                    blocks: first..count.min(first + share),
                }));
                self.ends.push(parts.len());
            });
        }
        self.parts.resize_with(parts.len(), Places::default);
        let mut work: Vec<_> = parts.into_iter().zip(&mut self.parts).collect();
        team.for_each(&mut work, |(part, places)| {
            with_group!(&groups[part.group], group => {
                let shelf = if part.awake { &group.awake } else { &group.border };
                places.find(&shelf.blocks[part.blocks.clone()], part.blocks.start * LANES, layout);
            });
        });
    }
}

/// The particles of one shelf, and where they are to go.
struct Shelf<'a, const D: usize, S: State> {
    parts: &'a [Places],
    slabs: &'a [Slab],
    layout: &'a Layout<D>,
    activity: Activity,
    /// None where there are no particles.
    vacant: Option<&'a Block<D, S>>,
}

impl<const D: usize, S: State> Shelf<'_, D, S> {
    /// Sorts the shelf. Each slab begins with a new block.
    fn sort(&self, sorted: &mut Sorted<D, S>, orders: &mut [Order], team: &Team) {
        let mut next = 0;
        let run = |slab: &Slab| {
            let of_part = |part: &Places| part.of_planes(slab.lo..slab.hi).len();
            let run = Run {
                first_block: next,
                particles: self.parts.iter().map(of_part).sum(),
            };
            next = run.blocks().end;
            run
        };
        let runs: Vec<_> = self.slabs.iter().map(run).collect();
        let in_place = runs == sorted.runs && Places::all_in_order(self.parts);
        sorted.runs = runs;
        let vacant = self.vacant.filter(|_| !in_place);
        sorted.moved = vacant.is_some();
        let Some(vacant) = vacant else {
            return;
        };
        sorted.scratch.resize(next, *vacant);
        let (blocks, mut rest) = (&sorted.blocks, &mut sorted.scratch[..]);
        let mut work = Vec::with_capacity(self.slabs.len());
        for ((slab, run), order) in self.slabs.iter().zip(&sorted.runs).zip(orders) {
            let (targets, others) = rest.split_at_mut(run.blocks().len());
            work.push((slab, targets, order));
            rest = others;
        }
        team.for_each(&mut work, |(slab, targets, order)| {
            order.find(self.parts, **slab, self.layout);
            let filled = targets.iter_mut().zip(order.numbers.chunks(LANES));
            filled.for_each(|(target, sources)| {
                fetch(target, sources, blocks, self.activity, vacant);
            });
        });
        std::mem::swap(&mut sorted.blocks, &mut sorted.scratch);
    }
}

/// The particles of one slab in the order of cells.
#[derive(Debug, Clone, Default)]
struct Order {
    /// Their numbers before the sort.
    numbers: Vec<u32>,
    /// Those of one plane in the order of columns; scratch, in 3D.
    by_column: Vec<Located>,
    /// Where the next particle of each column or row goes; scratch.
    next: Vec<u32>,
}

impl Order {
    /// Stable counting sort of one plane after the other, whose particles fit into the nearest cache; the order within a cell
    /// is the previous one.
    fn find<const D: usize>(&mut self, parts: &[Places], slab: Slab, layout: &Layout<D>) {
        self.numbers.clear();
        for plane in slab.lo..slab.hi {
            self.append_plane(parts, plane, layout);
        }
    }

    /// Sorts the particles of a plane by column and then, in 3D, by row.
    fn append_plane<const D: usize>(&mut self, parts: &[Places], plane: usize, layout: &Layout<D>) {
        let of_plane = |part| Places::of_planes(part, plane..plane + 1);
        let count = parts.iter().map(|part| of_plane(part).len()).sum();
        if count == 0 {
            return;
        }
        let located = || parts.iter().flat_map(&of_plane);
        let column = |located: &Located| located.place.column as usize;
        let row = |located: &Located| located.place.row as usize;
        let first = self.numbers.len();
        self.numbers.resize(first + count, 0);
        let numbers = &mut self.numbers[first..];
        let next = starts(&mut self.next, layout.columns(), located().map(column));
        if D == 2 {
            located().for_each(|one| numbers[take(next, column(one))] = one.number);
            return;
        }
        self.by_column.resize(count, Located::default());
        located().for_each(|one| self.by_column[take(next, column(one))] = *one);
        let rows = self.by_column.iter().map(row);
        let next = starts(&mut self.next, layout.rows_per_plane(), rows);
        let sorted = self.by_column.iter();
        sorted.for_each(|one| numbers[take(next, row(one))] = one.number);
    }
}

/// Where each of `kinds` begins if all are put in order.
fn starts(starts: &mut Vec<u32>, kinds: usize, all: impl Iterator<Item = usize>) -> &mut [u32] {
    starts.clear();
    starts.resize(kinds, 0);
    all.for_each(|kind| starts[kind] += 1);
    let mut start = 0;
    for number in &mut *starts {
        start += std::mem::replace(number, start);
    }
    starts
}

/// The place of the next particle of a kind, which is then taken.
fn take(next: &mut [u32], kind: usize) -> usize {
    let place = next[kind];
    next[kind] = place + 1;
    place as usize
}

fn fetch<const D: usize, S: State>(
    target: &mut Block<D, S>,
    sources: &[u32],
    blocks: &[Block<D, S>],
    activity: Activity,
    vacant: &Block<D, S>,
) {
    if sources.len() < LANES {
        *target = *vacant;
    }
    target.count = sources.len();
    for (lane, &source) in sources.iter().enumerate() {
        let source = source as usize;
        target.set(lane, &blocks[source / LANES].get(source % LANES, activity));
    }
}
