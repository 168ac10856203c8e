//! Correction of the particles' volumes.
//!
//! J of water and the volume of sand are integrals of div v along the path of a particle. After matter has separated and
//! met again they contradict the space that it occupies. Particles with J = 1 may be too far apart, and their false
//! pressure keeps the voids between them open; or too close, and no pressure separates them.
//!
//! So every 5 ms of simulated time each particle's volume is compared with the grid: `spread` scatters volumes and
//! pressures, `smooth` takes the means of both, and `correct` compares. Then
//! - neighbours share their pressure: deviations of single particles are noise of div v, and where tension is limited
//!   that noise would be rectified and support part of the weight;
//! - matter with free space around it loses its false pressure;
//! - matter that is too dense gains pressure.
//!
//! Corrections are made only while matter deforms, because only deformation causes the errors: matter at rest does not
//! change, and no energy is created.

mod correct;
mod lanes;
mod pass;
mod smooth;
mod spread;
#[cfg(test)]
mod tests;

use std::mem::discriminant;

use crate::boundary::{Obstacles, Walls};
use crate::grid::{Grid, Layout};
use crate::particles::{MaterialGroup, Slab, with_group};
use correct::Rooms;
use pass::Pass;
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
}

impl<const D: usize> VolumeCorrection<D> {
    pub fn new(walls: &Walls<D>, layout: &Layout<D>, frame_dt: f32) -> Self {
        Self {
            period: (PERIOD / frame_dt).round().max(1.0) as u64,
            frame_dt,
            room: Rooms::new(walls, layout),
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
        &self,
        groups: &mut [MaterialGroup<D>],
        slabs: &[Slab],
        grid: &mut Grid<D>,
        obstacles: &Obstacles<D>,
        dt: f32,
        team: &Team,
    ) {
        // Water and sand side by side do not share: sand that is apart would pull the water apart as well.
        for (index, family) in families(groups).into_iter().enumerate() {
            let pass = Pass {
                shares: groups
                    .iter()
                    .map(|group| discriminant(group) == family)
                    .collect(),
                first: index == 0,
                room: &self.room,
                obstacles,
                dt,
            };
            pass.run(groups, slabs, grid, team);
        }
        // These nodes do not contain momentum.
        grid.mark_dirty();
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
