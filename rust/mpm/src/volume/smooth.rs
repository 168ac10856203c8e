//! The volume on the nodes, smoothed once along each axis.
//!
//! Particles at random places fill the grid unevenly. Weights of 1/4, 1/2, 1/4 along each axis halve that noise in
//! 2D and leave 40 % of it in 3D.

use super::lanes::{SMOOTH, VOLUME};
use crate::grid::{Grid, Layout};

/// Scratch of the smoothing, one number a node; zero between calls.
#[derive(Debug, Clone)]
pub struct Smoothing {
    along: Vec<f32>,
    /// Empty in 2D.
    across: Vec<f32>,
}

impl Smoothing {
    pub fn new<const D: usize>(layout: &Layout<D>) -> Self {
        let count = layout.row_count() * layout.row_length;
        Self {
            along: vec![0.0; count],
            across: vec![0.0; if D == 3 { count } else { 0 }],
        }
    }

    /// Adds the smooth volume on the active nodes. Beyond them it is 0: they reach one node beyond what particles touch
    /// just after a sort.
    pub fn apply<const D: usize>(&mut self, grid: &mut Grid<D>) {
        let layout = grid.layout;
        let spans: Vec<_> = grid.active_ranges().collect();
        for range in spans.clone() {
            let volume = |node: usize| grid.nodes[node].to_array()[VOLUME];
            for node in range {
                self.along[node] = binomial(volume(node - 1), volume(node), volume(node + 1));
            }
        }
        if D == 3 {
            for range in spans.clone() {
                smooth_rows(&self.along, &mut self.across, range, layout.row_length);
            }
            std::mem::swap(&mut self.along, &mut self.across);
        }
        let plane = layout.nodes_per_plane();
        for range in spans.clone() {
            for node in range {
                let smooth = binomial(
                    self.along[node - plane],
                    self.along[node],
                    self.along[node + plane],
                );
                let mut value = grid.nodes[node].to_array();
                value[SMOOTH] = smooth;
                grid.nodes[node] = value.into();
            }
        }
        for range in spans {
            self.along[range.clone()].fill(0.0);
            if D == 3 {
                self.across[range].fill(0.0);
            }
        }
    }
}

/// The smooth value of a node from those before, at and after it along an axis.
pub fn binomial(before: f32, here: f32, after: f32) -> f32 {
    0.25 * (before + after) + 0.5 * here
}

/// Smooths `range` of `from` across rows that lie `stride` apart.
fn smooth_rows(from: &[f32], to: &mut [f32], range: std::ops::Range<usize>, stride: usize) {
    let before = &from[range.start - stride..range.end - stride];
    let after = &from[range.start + stride..range.end + stride];
    let neighbours = before.iter().zip(after);
    for ((to, here), (before, after)) in to[range.clone()]
        .iter_mut()
        .zip(&from[range])
        .zip(neighbours)
    {
        *to = binomial(*before, *here, *after);
    }
}
