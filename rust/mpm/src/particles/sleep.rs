//! Sleep of regions at rest: their particles do not move and cost nothing.
//!
//! The box is divided into tiles. A tile is awake while a moving particle is in it or in a neighbouring tile, or will get
//! there before the next decision: so a region wakes before it is touched. Around the awake tiles lies a border. Its
//! particles do not move, but they keep their mass and their stress on the grid and so support the awake ones.

use super::block::Block;
use super::group::{Group, MaterialGroup, with_group};
use super::particle::{Activity, Particle};
use super::tiles::Tiles;
use crate::boundary::Obstacles;
use crate::error::MpmError;
use crate::force::FrameForce;
use crate::grid::{Layout, Stencils};
use crate::linalg::LANES;
use crate::material::{Constitutive, State};
use serde::{Deserialize, Serialize};

/// Condition of rest: particles were slow at the end of some consecutive frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sleep {
    /// Speed below which a particle is slow [m/s].
    pub speed: f32,
    /// Frames in a row after which a slow particle is at rest.
    pub frames: u32,
}

impl Sleep {
    pub fn check(&self) -> Result<(), MpmError> {
        if !(self.speed > 0.0 && self.speed.is_finite()) {
            return Err(MpmError::parameter(
                "sleep_speed",
                "finite and > 0 m/s",
                self.speed,
            ));
        }
        if !(1..=1_000_000).contains(&self.frames) {
            return Err(MpmError::parameter(
                "sleep_frames",
                "in [1, 1000000]",
                self.frames,
            ));
        }
        Ok(())
    }
}

/// Frames between two decisions.
pub const PERIOD: u64 = 4;

/// Counts the frames at rest of all awake particles, at the end of a frame.
pub fn count_calm<const D: usize>(groups: &mut [MaterialGroup<D>], sleep: &Sleep) {
    let limit = sleep.speed * sleep.speed;
    for group in groups {
        with_group!(group, group => for block in &mut group.awake.blocks {
            for lane in 0..LANES {
                let speed_squared: f32 = (0..D).map(|axis| block.v[axis][lane] * block.v[axis][lane]).sum();
                let calm = block.calm[lane] + 1.0;
                block.calm[lane] = if speed_squared < limit { calm } else { 0.0 };
            }
        });
    }
}

/// Causes that wake a region besides its own motion.
pub struct WakeCauses<'a, const D: usize> {
    pub force: FrameForce<'a, D>,
    pub obstacles: &'a Obstacles<D>,
    /// Time to the next decision [s].
    pub horizon: f32,
}

/// Decides which particles sleep until the next decision.
pub fn decide<const D: usize>(
    groups: &mut [MaterialGroup<D>],
    layout: &Layout<D>,
    sleep: &Sleep,
    causes: &WakeCauses<'_, D>,
) {
    let mut tiles = Tiles::new(layout);
    for group in groups.iter_mut() {
        with_group!(group, group => {
            let Group { awake, border, asleep, .. } = group;
            for block in awake.blocks.iter_mut().chain(&mut border.blocks).chain(asleep) {
                causes.stir(block, layout);
                tiles.mark(block, layout, sleep.frames as f32, causes.horizon);
            }
        });
    }
    tiles.spread();
    for group in groups {
        with_group!(group, group => move_to_shelves(group, &tiles, layout));
    }
}

impl<const D: usize> WakeCauses<'_, D> {
    /// Particles under a force or near a moving obstacle are not at rest.
    fn stir<S: State>(&self, block: &mut Block<D, S>, layout: &Layout<D>) {
        if self.force.is_some() {
            for lane in 0..block.count {
                if self.force.pushes(block.id[lane]) {
                    block.calm[lane] = 0.0;
                }
            }
        }
        if self.obstacles.any_moves() {
            let reach = 3.0 * layout.dx() + self.obstacles.speed() * self.horizon;
            for lane in 0..block.count {
                if self.obstacles.moving_within(reach, &block.position(lane)) {
                    block.calm[lane] = 0.0;
                }
            }
        }
    }
}

/// Takes the particles whose activity changes out of their blocks, and puts them where they belong.
fn move_to_shelves<const D: usize, M: Constitutive<D>>(
    group: &mut Group<D, M>,
    tiles: &Tiles<D>,
    layout: &Layout<D>,
) {
    let mut moved = Vec::new();
    take_changed(
        &mut group.awake.blocks,
        Activity::Awake,
        tiles,
        layout,
        &mut moved,
    );
    take_changed(
        &mut group.border.blocks,
        Activity::Border,
        tiles,
        layout,
        &mut moved,
    );
    take_changed(
        &mut group.asleep,
        Activity::Asleep,
        tiles,
        layout,
        &mut moved,
    );
    if !moved.is_empty() {
        group.append(&moved);
    }
}

fn take_changed<const D: usize, S: State>(
    blocks: &mut Vec<Block<D, S>>,
    present: Activity,
    tiles: &Tiles<D>,
    layout: &Layout<D>,
    moved: &mut Vec<Particle<D, S>>,
) {
    for block in blocks.iter_mut() {
        let base = Stencils::at(&block.x, layout).base;
        let mut kept = 0;
        for lane in 0..block.count {
            let activity = tiles.activity(base.map(|base| base[lane]));
            let mut particle = block.get(lane, activity);
            if activity == present {
                if kept < lane {
                    block.set(kept, &particle);
                }
                kept += 1;
                continue;
            }
            if present == Activity::Awake {
                (particle.v, particle.affine) = (nalgebra::zero(), nalgebra::zero());
            }
            moved.push(particle);
        }
        if kept < block.count {
            // Lanes behind the last particle have to rest without mass.
            let mut shrunk = Block::empty(&block.get(0, present));
            (0..kept).for_each(|lane| shrunk.set(lane, &block.get(lane, present)));
            shrunk.count = kept;
            *block = shrunk;
        }
    }
    blocks.retain(|block| block.count > 0);
}
