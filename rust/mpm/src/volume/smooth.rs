//! The volume on the nodes, smoothed once along each axis.
//!
//! Particles at random positions fill the grid unevenly. Weights of 1/4, 1/2, 1/4 along each axis halve that noise in
//! 2D and leave 40 % of it in 3D.
//!
//! Active nodes reach one node beyond those of particles just after a sort; beyond them the smooth volume is 0.

use std::ops::Range;

use wide::f32x4;

use super::lanes::{HALF_SMOOTH, SMOOTH, VOLUME};
use crate::grid::{CHUNK, Window};
use crate::linalg::{Kernel, Quad, run_wide};

/// Smooths along all axes but the first, each plane for itself. The chunks that the volume reaches are marked.
pub fn smooth_planes<const D: usize>(window: &mut Window<'_, D>) {
    run_wide(SmoothPlanes(window));
}

struct SmoothPlanes<'a, 'w, const D: usize>(&'a mut Window<'w, D>);

impl<const D: usize> Kernel for SmoothPlanes<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        let window = self.0;
        for chunk in window.chunks(window.planes.clone()) {
            let marked = &mut window.dirty[chunk];
            if D == 3 {
                *marked |= smooth_along::<SMOOTH>(window.nodes, chunk, *marked);
            } else {
                *marked |= smooth_along::<HALF_SMOOTH>(window.nodes, chunk, *marked);
            }
        }
        if D == 3 {
            let row = window.layout.row_length;
            for chunk in window.chunks(window.planes.clone()) {
                if any_marked(window.dirty, chunk, row) {
                    smooth_across::<SMOOTH, HALF_SMOOTH>(window.nodes, chunk, row);
                }
            }
        }
    }
}

/// Smooths some planes along the first axis, after `smooth_planes` of these and their neighbours.
pub fn smooth_across_planes<const D: usize>(window: &mut Window<'_, D>, planes: Range<usize>) {
    run_wide(SmoothAcrossPlanes { window, planes });
}

struct SmoothAcrossPlanes<'a, 'w, const D: usize> {
    window: &'a mut Window<'w, D>,
    planes: Range<usize>,
}

impl<const D: usize> Kernel for SmoothAcrossPlanes<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        let Self { window, planes } = self;
        let (row, plane) = (window.layout.row_length, window.layout.nodes_per_plane());
        for chunk in window.chunks(planes) {
            // In 3D the volume has reached neighbouring rows, which are not marked.
            let rows = if D == 3 { row / CHUNK } else { 0 };
            let near = [chunk - rows, chunk, chunk + rows];
            if near
                .into_iter()
                .any(|chunk| any_marked(window.dirty, chunk, plane))
            {
                smooth_across::<HALF_SMOOTH, SMOOTH>(window.nodes, chunk, plane);
            }
        }
    }
}

/// The smooth value of a node from those before, at and after it along an axis.
#[inline(always)]
pub fn binomial(before: f32, here: f32, after: f32) -> f32 {
    0.25 * (before + after) + 0.5 * here
}

/// Whether a chunk or one of those that lie `stride` nodes before and after it is marked.
#[inline(always)]
fn any_marked(dirty: &[bool], chunk: usize, stride: usize) -> bool {
    let stride = stride / CHUNK;
    dirty[chunk - stride] | dirty[chunk] | dirty[chunk + stride]
}

/// Smooths the volume of a chunk along its row, into lane `TO`; false where there is none.
#[inline(always)]
fn smooth_along<const TO: usize>(nodes: &mut [f32x4], chunk: usize, marked: bool) -> bool {
    let start = chunk * CHUNK;
    let volume = |node: usize| nodes.get(node).map_or(0.0, |node| node.as_array()[VOLUME]);
    let (mut before, after) = (volume(start.wrapping_sub(1)), volume(start + CHUNK));
    let any = marked | (before != 0.0) | (after != 0.0);
    if any {
        let nodes = &mut nodes[start..start + CHUNK];
        for k in 0..CHUNK {
            let mut node = nodes[k].to_array();
            let next = nodes
                .get(k + 1)
                .map_or(after, |node| node.as_array()[VOLUME]);
            node[TO] = binomial(before, node[VOLUME], next);
            before = node[VOLUME];
            nodes[k] = node.into();
        }
    }
    any
}

/// Smooths lane `FROM` of a chunk across nodes that lie `stride` apart, into lane `TO`.
#[inline(always)]
fn smooth_across<const FROM: usize, const TO: usize>(
    nodes: &mut [f32x4],
    chunk: usize,
    stride: usize,
) {
    let start = chunk * CHUNK;
    let near = &mut nodes[start - stride..start + stride + CHUNK];
    for k in 0..CHUNK {
        let value = |node: usize| near[node].as_array()[FROM];
        let smooth = binomial(value(k), value(k + stride), value(k + 2 * stride));
        near[k + stride].as_mut_array()[TO] = smooth;
    }
}
