//! One pass, slab by slab on several threads.

use super::correct::{Rooms, correct};
use super::lanes::VOLUME;
use super::smooth::{smooth_across_planes, smooth_planes};
use super::spread::{empty, spread, take_means};
use crate::boundary::Obstacles;
use crate::grid::{CHUNK, Grid, View, Window};
use crate::material::Constitutive;
use crate::particles::{CutGroup, MaterialGroup, Slab, bands, fresh_planes, with_group};
use crate::substep::Interruption;
use threads::{Step, Team};

/// A part of a pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    Spread,
    SmoothPlanes,
    SmoothAcrossPlanes,
    Correct,
}

/// Slabs of one colour write to different planes.
const STEPS: [(Stage, Step); 6] = [
    (Stage::Spread, Step::EVEN),
    (Stage::Spread, Step::ODD),
    (Stage::SmoothPlanes, Step::ALL),
    (Stage::SmoothAcrossPlanes, Step::EVEN),
    (Stage::SmoothAcrossPlanes, Step::ODD),
    (Stage::Correct, Step::ALL),
];

/// The correction of one kind of material.
pub struct Pass<'a, const D: usize> {
    /// Whether each group is of that kind: its particles share their pressure, and are corrected.
    pub shares: Vec<bool>,
    /// Whether it is the first pass; the others reuse the volumes of all groups and the smoothed ones.
    pub first: bool,
    pub room: &'a Rooms<D>,
    pub obstacles: &'a Obstacles<D>,
    /// Time since the latest correction [s].
    pub dt: f32,
}

impl<const D: usize> Pass<'_, D> {
    /// Runs all stages. A slab enters one when it and its neighbours have finished those before.
    pub fn run(
        &self,
        groups: &mut [MaterialGroup<D>],
        slabs: &[Slab],
        grid: &mut Grid<D>,
        team: &Team,
    ) {
        let bands = bands(slabs, grid.layout.planes());
        let grid = grid.shared();
        let interruption = Interruption::new(groups);
        let groups: Vec<_> = groups.iter_mut().map(cut).collect();
        let groups = || groups.iter().zip(&self.shares);
        let across = |stage| stage == Stage::SmoothAcrossPlanes;
        let needed = STEPS
            .iter()
            .filter(|(stage, _)| self.first || !across(*stage));
        let (stages, steps): (Vec<_>, Vec<_>) = needed.copied().unzip();
        let costs: Vec<_> = slabs.iter().map(|slab| slab.cost).collect();
        team.in_steps(&costs, &steps, |number, slab| {
            if interruption.is_found() {
                return;
            }
            let (reach, band) = (slabs[slab].reach(), bands[slab].clone());
            // The planes within reach belong to the slab and its neighbours, which wait or have finished the stage before.
            match stages[number] {
                Stage::Spread => {
                    // SAFETY: concurrent slabs have one colour, and so no plane in common.
                    let window = &mut unsafe { grid.window(reach) };
                    empty(window, fresh_planes(slabs, slab), !self.first);
                    for (group, &shares) in groups() {
                        group.spread(slab, window, self.first, shares);
                    }
                }
                Stage::SmoothPlanes => {
                    // SAFETY: bands of slabs are disjoint.
                    let window = &mut unsafe { grid.window(band) };
                    take_means(window);
                    if self.first {
                        self.fill_obstacles(window);
                        smooth_planes(window);
                    }
                }
                Stage::SmoothAcrossPlanes => {
                    let around = band.start.saturating_sub(1)..band.end + 1;
                    // SAFETY: concurrent slabs have one colour, and so no plane in common.
                    smooth_across_planes(&mut unsafe { grid.window(around) }, band);
                }
                Stage::Correct => {
                    // SAFETY: all slabs in reach only read in this stage.
                    let view = unsafe { grid.view(reach) };
                    for (group, _) in groups().filter(|(_, shares)| **shares) {
                        group.correct(slab, view, self.room, self.dt);
                    }
                }
            }
        });
    }

    /// Adds the volume of obstacles, which occupy space as matter does. Without it matter beside them would look like a free
    /// surface, and could become too dense. Beyond the walls nothing is added.
    fn fill_obstacles(&self, window: &mut Window<'_, D>) {
        if !self.obstacles.any() {
            return;
        }
        let layout = window.layout;
        for chunk in window.chunks(window.planes.clone()) {
            for place in chunk * CHUNK..(chunk + 1) * CHUNK {
                let index = window.first + place;
                let column = index % layout.row_length;
                if column < layout.columns() && self.obstacles.near_node(index) {
                    let mut node = layout.row_coordinates(index / layout.row_length);
                    node[D - 1] = column;
                    let room = self.obstacles.fill(node) * self.room.fine.at_node(node);
                    window.nodes[place].as_mut_array()[VOLUME] += room;
                    window.dirty[chunk] = true;
                }
            }
        }
    }
}

/// A group of any material, cut into slabs.
trait Cut<const D: usize>: Sync {
    fn spread(&self, slab: usize, window: &mut Window<'_, D>, with_volume: bool, shares: bool);
    fn correct(&self, slab: usize, grid: View<'_, D>, room: &Rooms<D>, dt: f32);
}

fn cut<const D: usize>(group: &mut MaterialGroup<D>) -> Box<dyn Cut<D> + '_> {
    with_group!(group, group => Box::new(CutGroup::of(group)))
}

impl<const D: usize, M: Constitutive<D>> Cut<D> for CutGroup<'_, D, M> {
    fn spread(&self, slab: usize, window: &mut Window<'_, D>, with_volume: bool, shares: bool) {
        if with_volume || shares {
            for blocks in [&**self.awake(slab), self.border(slab)] {
                spread(blocks, self.material, with_volume, shares, window);
            }
        }
    }

    fn correct(&self, slab: usize, grid: View<'_, D>, room: &Rooms<D>, dt: f32) {
        correct(&mut self.awake(slab), self.material, grid, room, dt);
    }
}
