//! Tiles of the box, by the activity in them.

use super::block::Block;
use super::particle::Activity;
use crate::grid::{Layout, Stencils};
use crate::material::State;

/// Cells along a tile, as a power of two.
const TILE_SHIFT: u32 = 1;
/// Tiles of the border: more than a stencil and its nodes' stencils reach.
const BORDER: isize = 2;

/// Activity in each tile of the box.
pub struct Tiles<const D: usize> {
    /// Along each axis.
    extents: [usize; D],
    activity: Vec<Activity>,
    /// Tiles with something that moves.
    stirred: Vec<[usize; D]>,
}

impl<const D: usize> Tiles<D> {
    pub fn new(layout: &Layout<D>) -> Self {
        let extents = layout.extents.map(|extent| (extent >> TILE_SHIFT) + 1);
        Self {
            extents,
            activity: vec![Activity::Asleep; extents.iter().product()],
            stirred: Vec::new(),
        }
    }

    fn index(&self, tile: [usize; D]) -> usize {
        let axes = tile.iter().zip(&self.extents);
        axes.fold(0, |index, (&coordinate, &extent)| {
            index * extent + coordinate
        })
    }

    pub fn activity(&self, base: [u32; D]) -> Activity {
        self.activity[self.index(base.map(|base| (base >> TILE_SHIFT) as usize))]
    }

    /// Notes the tiles where moving particles are, and where they may be at the end of the horizon.
    pub fn mark<S: State>(
        &mut self,
        block: &Block<D, S>,
        layout: &Layout<D>,
        calm_frames: f32,
        horizon: f32,
    ) {
        let base = Stencils::at(&block.x, layout).base;
        let restless = (0..block.count).filter(|&lane| block.calm[lane] < calm_frames);
        for lane in restless {
            let ranges: [(usize, usize); D] = std::array::from_fn(|axis| {
                let last = (self.extents[axis] - 1) as isize;
                let cells = (block.v[axis][lane] * horizon / layout.dx()) as isize;
                let (now, then) = (base[axis][lane] as isize, base[axis][lane] as isize + cells);
                let tile = |cell: isize| (cell >> TILE_SHIFT).clamp(0, last) as usize;
                (tile(now.min(then)), tile(now.max(then)))
            });
            for_each_tile(ranges, |tile| {
                let index = self.index(tile);
                if self.activity[index] != Activity::Awake {
                    self.activity[index] = Activity::Awake;
                    self.stirred.push(tile);
                }
            });
        }
    }

    /// Wakes the neighbours of moving tiles, and surrounds them with the border.
    pub fn spread(&mut self) {
        for (reach, activity) in [(1, Activity::Awake), (1 + BORDER, Activity::Border)] {
            for stirred in 0..self.stirred.len() {
                let tile = self.stirred[stirred];
                let ranges = std::array::from_fn(|axis| {
                    let last = self.extents[axis] as isize - 1;
                    let at = |step: isize| (tile[axis] as isize + step).clamp(0, last) as usize;
                    (at(-reach), at(reach))
                });
                for_each_tile(ranges, |tile| {
                    let index = self.index(tile);
                    if self.activity[index] == Activity::Asleep {
                        self.activity[index] = activity;
                    }
                });
            }
        }
    }
}

/// Visits the tiles between two corners, both included.
fn for_each_tile<const D: usize>(ranges: [(usize, usize); D], mut visit: impl FnMut([usize; D])) {
    let mut tile = ranges.map(|(low, _)| low);
    loop {
        visit(tile);
        let mut axis = 0;
        while tile[axis] == ranges[axis].1 {
            tile[axis] = ranges[axis].0;
            axis += 1;
            if axis == D {
                return;
            }
        }
        tile[axis] += 1;
    }
}
