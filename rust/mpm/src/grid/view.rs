//! The grid, to be read.

use wide::f32x4;

use super::layout::Layout;

/// The nodes of some planes, to be read.
#[derive(Debug, Clone, Copy)]
pub struct View<'a, const D: usize> {
    pub layout: Layout<D>,
    /// Memory index of the first node.
    pub first: usize,
    pub nodes: &'a [f32x4],
    /// See `Grid`.
    pub old: &'a [f32],
}
