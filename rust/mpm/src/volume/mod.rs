//! Matter keeps its volume.
//!
//! J of water and the volume of sand are integrals of div v along the way of a particle. After matter has parted
//! and met again they contradict the room that it takes: particles with J = 1 stand too far apart, and their false
//! pressure holds the voids between them open, or they stand too close, and nothing parts them.
//!
//! So two hundred times a second of simulated time each particle's volume is compared with the grid: `spread` puts
//! volumes and pressures on it, `smooth` takes the means of both, and `correct` compares. Then
//! - neighbours share their pressure: what single particles deviate by is noise of div v, and where tension is limited
//!   that noise would be rectified and carry part of the weight;
//! - matter with room around it gives its false pressure away;
//! - crowded matter gains pressure.
//!
//! All that happens only while matter deforms, because only deformation makes the contradictions: matter at rest stays
//! as it is, and no energy comes from nothing.

mod correct;
mod lanes;
mod smooth;
mod spread;
#[cfg(test)]
mod tests;

use std::mem::discriminant;

use crate::boundary::{Obstacles, Walls};
use crate::grid::{Grid, Layout};
use crate::particles::{MaterialGroup, Slab, with_group};
use correct::{Rooms, correct};
use lanes::VOLUME;
use smooth::Smoothing;
use spread::spread;
use threads::Team;

/// Time between two corrections [s], unless frames are longer.
const PERIOD: f32 = 5.0e-3;

/// The correction of volumes in one scene.
#[derive(Debug, Clone)]
pub struct VolumeCorrection<const D: usize> {
    /// Frames between two corrections.
    period: u64,
    frame_dt: f32,
    room: Rooms<D>,
    smoothing: Smoothing,
}

impl<const D: usize> VolumeCorrection<D> {
    pub fn new(walls: &Walls<D>, layout: &Layout<D>, frame_dt: f32) -> Self {
        Self {
            period: (PERIOD / frame_dt).round().max(1.0) as u64,
            frame_dt,
            room: Rooms::new(walls, layout),
            smoothing: Smoothing::new(layout),
        }
    }

    /// Time since the latest correction [s] where one is due before this frame. A function of the frame's number,
    /// so that a snapshot needs nothing of it.
    pub fn due(&self, frame: u64) -> Option<f32> {
        frame
            .is_multiple_of(self.period)
            .then_some(self.period as f32 * self.frame_dt)
    }

    /// Corrects the volumes of all particles that are awake, after a sort. `dt` is the time since the latest
    /// correction [s].
    pub fn apply(
        &mut self,
        groups: &mut [MaterialGroup<D>],
        slabs: &[Slab],
        grid: &mut Grid<D>,
        obstacles: &Obstacles<D>,
        dt: f32,
        team: &Team,
    ) {
        grid.clear();
        let mut first = true;
        // Water and sand side by side do not share: sand that is apart would pull the water apart as well.
        for family in families(groups) {
            if !first {
                grid.for_each_active(|node| {
                    let [volume, _, _, smooth] = node.to_array();
                    *node = [volume, 0.0, 0.0, smooth].into();
                });
            }
            let shares = |group: &MaterialGroup<D>| discriminant(group) == family;
            spread(groups, slabs, grid, team, first, shares);
            grid.for_each_active(|node| {
                let [volume, sharing, pressure, smooth] = node.to_array();
                if sharing > 0.0 {
                    *node = [volume, sharing, pressure / sharing, smooth].into();
                }
            });
            if first {
                self.fill_obstacles(grid, obstacles);
                self.smoothing.apply(grid);
            }
            for group in groups.iter_mut().filter(|group| shares(group)) {
                with_group!(group, group => correct(group, grid, &self.room, dt, team));
            }
            first = false;
        }
        // What has been written here is no momentum.
        grid.mark_dirty();
    }

    /// Adds the volume of obstacles, which take room as matter does: else matter beside them would be told from a free
    /// surface by nothing, and could be crowded. Beyond the walls they take none.
    fn fill_obstacles(&self, grid: &mut Grid<D>, obstacles: &Obstacles<D>) {
        if !obstacles.any() {
            return;
        }
        let layout = grid.layout;
        let ranges: Vec<_> = grid.active_ranges().collect();
        for index in ranges.into_iter().flatten() {
            if obstacles.near(index) {
                let mut node = layout.row_coordinates(index / layout.row_length);
                node[D - 1] = index % layout.row_length;
                if node[D - 1] < layout.extent {
                    let mut value = grid.nodes[index].to_array();
                    value[VOLUME] += obstacles.fill(node) * self.room.fine.at_node(node);
                    grid.nodes[index] = value.into();
                }
            }
        }
    }
}

/// The kinds of material whose volumes are corrected, each once.
fn families<const D: usize>(
    groups: &[MaterialGroup<D>],
) -> Vec<std::mem::Discriminant<MaterialGroup<D>>> {
    let mut families = Vec::new();
    for group in groups {
        let family = discriminant(group);
        if with_group!(group, group => group.corrects_volume()) && !families.contains(&family) {
            families.push(family);
        }
    }
    families
}
