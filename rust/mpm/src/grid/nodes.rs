//! The background grid, and which part of it particles touch.

use std::marker::PhantomData;
use std::ops::Range;

use wide::f32x4;

use super::active::{ActiveSpans, Band, Reach};
use super::fields::{FieldSums, Fields};
use super::layout::{CHUNK, Layout, Place, Span};
use super::view::View;
use super::window::{SharedGrid, Window};
use threads::Team;

/// Lighter nodes [kg] count as empty: the inverse of their mass would leave the range of float32.
pub const SMALLEST_MASS: f32 = 1.0e-30;

/// Mass and momentum after P2G; velocity after the grid update.
#[derive(Debug, Clone)]
pub struct Grid<const D: usize> {
    pub layout: Layout<D>,
    /// Momentum [kg m/s], then velocity [m/s], in lanes 0..D; mass [kg] in lane 3.
    pub nodes: Vec<f32x4>,
    /// Sum of mass times wall friction; empty when all materials share one coefficient.
    pub friction_mass: Vec<f32>,
    /// Momentum before forces; the velocity by it after the grid update. See `OLD`; empty where it is not kept.
    pub old: Vec<f32>,
    /// Whether something has been written to a chunk of nodes since it was cleared; the others are zero.
    pub(super) dirty: Vec<bool>,
    pub active: ActiveSpans,
    /// Velocities of bodies that meet.
    pub fields: Fields<D>,
    reach: Reach,
    /// Scratch of `activate`.
    bands: Vec<Band>,
}

impl<const D: usize> Grid<D> {
    /// With a single field.
    pub fn new(layout: Layout<D>, mixed_friction: bool) -> Self {
        let sums = FieldSums {
            friction: mixed_friction,
            volume: false,
        };
        let count = layout.row_count() * layout.row_length;
        Self {
            layout,
            nodes: vec![f32x4::ZERO; count],
            friction_mass: if mixed_friction {
                vec![0.0; count]
            } else {
                Vec::new()
            },
            old: Vec::new(),
            dirty: vec![false; count / CHUNK],
            active: ActiveSpans::none(&layout),
            fields: Fields::new(layout, 1, true, sums),
            reach: Reach::new(&layout),
            bands: Vec::new(),
        }
    }

    /// Keeps the velocities before forces from now on.
    pub fn keep_old(&mut self) {
        self.old = vec![0.0; self.nodes.len() * Layout::<D>::OLD];
        self.fields.keep_old();
    }

    /// Recomputes the active spans. Bands are ranges of planes that tile the grid in ascending order; `places` returns the
    /// starts of the stencils in such a range.
    ///
    /// Nodes that leave the spans are zeroed: contact with a wall reads one node beyond them, whose value must not depend
    /// on earlier substeps.
    pub fn activate<I: Iterator<Item = Place>>(
        &mut self,
        bands: &[Range<usize>],
        places: impl Fn(Range<usize>) -> I + Sync,
        team: &Team,
    ) {
        let mut reach = std::mem::take(&mut self.reach);
        let windows = self.windows(bands.iter().cloned());
        let mut parts: Vec<_> = windows.into_iter().zip(reach.split(bands)).collect();
        team.for_each(&mut parts, |(window, reach)| {
            window.clear(window.planes.clone());
            reach.replace(places(window.planes.clone()));
        });
        self.reach = reach;
        self.bands.resize_with(bands.len(), Band::default);
        let mut parts: Vec<_> = self.bands.iter_mut().zip(bands).collect();
        let reach = &self.reach;
        team.for_each(&mut parts, |(band, planes)| band.find(reach, planes));
        self.active.gather(&self.bands);
    }

    /// Lends the grid to threads that take turns on its planes.
    pub fn shared(&mut self) -> SharedGrid<'_, D> {
        SharedGrid {
            layout: self.layout,
            nodes: self.nodes.as_mut_ptr(),
            friction_mass: (!self.friction_mass.is_empty())
                .then_some(self.friction_mass.as_mut_ptr()),
            old: (!self.old.is_empty()).then_some(self.old.as_mut_ptr()),
            dirty: self.dirty.as_mut_ptr(),
            active: &self.active,
            fields: self.fields.shared(),
            borrowed: PhantomData,
        }
    }

    /// All nodes.
    pub fn view(&self) -> View<'_, D> {
        View {
            layout: self.layout,
            first: 0,
            nodes: &self.nodes,
            old: &self.old,
        }
    }

    /// Windows onto ranges of planes, given in ascending order without overlap.
    pub fn windows(&mut self, planes: impl Iterator<Item = Range<usize>>) -> Vec<Window<'_, D>> {
        let layout = self.layout;
        let (mut nodes, mut friction_mass, mut dirty, mut old) = (
            &mut self.nodes[..],
            &mut self.friction_mass[..],
            &mut self.dirty[..],
            &mut self.old[..],
        );
        let mut cut = 0;
        let mut windows = Vec::new();
        for planes in planes {
            let planes = planes.start..planes.end.min(layout.planes());
            let first = planes.start * layout.nodes_per_plane();
            let end = planes.end * layout.nodes_per_plane();
            let mine = cut_out(nodes, first - cut, end - cut);
            let my_dirty = cut_out(dirty, (first - cut) / CHUNK, (end - cut) / CHUNK);
            let my_friction = if friction_mass.is_empty() {
                (&mut [][..], friction_mass)
            } else {
                cut_out(friction_mass, first - cut, end - cut)
            };
            let numbers = Layout::<D>::OLD;
            let my_old = if old.is_empty() {
                (&mut [][..], old)
            } else {
                cut_out(old, (first - cut) * numbers, (end - cut) * numbers)
            };
            (nodes, dirty, friction_mass, cut) = (mine.1, my_dirty.1, my_friction.1, end);
            old = my_old.1;
            windows.push(Window {
                layout,
                first,
                nodes: mine.0,
                friction_mass: my_friction.0,
                old: my_old.0,
                dirty: my_dirty.0,
                planes,
                active: &self.active,
            });
        }
        windows
    }

    /// Memory indices of the active nodes.
    pub fn active_ranges(&self) -> impl Iterator<Item = Range<usize>> {
        let row_length = self.layout.row_length;
        let range = move |span: &Span| {
            let start = span.row * row_length;
            start + span.lo..start + span.hi
        };
        self.active.all().iter().map(range)
    }

    /// Makes the next `clear` zero all active nodes, also those that no P2G has marked.
    pub fn mark_dirty(&mut self) {
        let ranges: Vec<_> = self.active_ranges().collect();
        for range in ranges {
            self.dirty[range.start / CHUNK..range.end / CHUNK].fill(true);
        }
    }
}

/// Splits `start..end` off a slice, and the rest behind it.
fn cut_out<T>(slice: &mut [T], start: usize, end: usize) -> (&mut [T], &mut [T]) {
    slice[start..].split_at_mut(end - start)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Activates the nodes around stencils with these lowest nodes, in bands of three planes.
    fn activate<const D: usize>(grid: &mut Grid<D>, bases: &[[usize; D]]) {
        let layout = grid.layout;
        let ends = (0..layout.planes()).step_by(3);
        let bands: Vec<_> = ends
            .map(|plane| plane..layout.planes().min(plane + 3))
            .collect();
        let places = |planes: Range<usize>| {
            let mine = bases.iter().filter(move |base| planes.contains(&base[0]));
            mine.map(move |base| Place {
                plane: base[0] as u16,
                row: if D == 3 { base[1] as u16 } else { 0 },
                column: base[D - 1] as u16,
            })
        };
        grid.activate(&bands, places, &Team::new(2).unwrap());
    }

    #[test]
    fn active_spans_cover_every_stencil_within_the_margin() {
        let mut grid = Grid::<3>::new(Layout::unit(16), false);
        let bases = [[6, 7, 8], [6, 7, 18], [9, 7, 8], [12, 12, 5]];
        for _ in 0..2 {
            activate(&mut grid, &bases);
            let spans = grid.active.all();
            for base in bases {
                for (dx, dy) in (-1isize..=3).flat_map(|dx| (-1..=3).map(move |dy| (dx, dy))) {
                    let near = |axis: usize, d: isize| (base[axis] as isize + d) as usize;
                    let row = grid.layout.row([near(0, dx), near(1, dy), 0]);
                    let covered = spans
                        .iter()
                        .any(|span| span.row == row && span.lo < base[2] && base[2] + 3 < span.hi);
                    assert!(covered, "{base:?} {row}");
                }
            }
            assert!(spans.is_sorted_by_key(|s| (s.row, s.lo)));
            let apart = |pair: &[Span]| pair[0].row != pair[1].row || pair[0].hi < pair[1].lo;
            assert!(spans.windows(2).all(apart));
            // 5 rows by 5 for each base; two planes of the third are those of the first. The columns 8 and 18 of
            // the first two lie in chunks that touch.
            assert_eq!(spans.len(), 25 + 15 + 25);
            assert!(spans.iter().all(|s| s.lo % CHUNK == 0 && s.hi % CHUNK == 0));
        }
    }

    #[test]
    fn nodes_that_are_no_longer_active_are_empty() {
        let mut grid = Grid::<2>::new(Layout::unit(16), true);
        activate(&mut grid, &[[6, 6], [9, 12]]);
        for span in grid.active.all().to_vec() {
            let start = span.row * grid.layout.row_length;
            grid.nodes[start + span.lo..start + span.hi].fill(f32x4::splat(1.0));
            grid.dirty[(start + span.lo) / CHUNK..(start + span.hi) / CHUNK].fill(true);
            grid.friction_mass[start + span.lo..start + span.hi].fill(1.0);
        }
        activate(&mut grid, &[[14, 14]]);
        assert!(grid.nodes.iter().all(|node| *node == f32x4::ZERO));
        assert!(grid.friction_mass.iter().all(|mass| *mass == 0.0));
    }
}
