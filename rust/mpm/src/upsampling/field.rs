//! Field of the motion of coarse particles on the nodes of their grid.

use wide::f32x4;

use crate::grid::{CHUNK, Layout, PADDING, SMALLEST_MASS, Stencil};
use crate::linalg::{Kernel, Matrix, Quad, Vector, run_wide};

/// Motion of a coarse particle.
#[derive(Debug, Clone, Copy)]
pub struct Sample<const D: usize> {
    /// Position at the beginning [m].
    pub x: Vector<D>,
    /// Displacement [m], or velocity [m/s].
    pub shift: Vector<D>,
    /// Gradient of `shift`, per metre.
    pub gradient: Matrix<D>,
    /// [kg]
    pub mass: f32,
}

/// The mean motion of the particles around each node, weighted by their masses.
#[derive(Debug, Clone)]
pub struct Field<const D: usize> {
    pub layout: Layout<D>,
    /// Motion in lanes 0..D; lane 3 is 1 at nodes with mass. All lanes are 0 elsewhere.
    pub nodes: Vec<f32x4>,
    dirty: DirtyChunks,
}

/// Chunks of nodes that are not zero.
///
/// They are listed because a grid has many more chunks than coarse particles touch.
#[derive(Debug, Clone)]
struct DirtyChunks {
    is_dirty: Vec<bool>,
    list: Vec<usize>,
}

impl DirtyChunks {
    #[inline(always)]
    fn mark(&mut self, chunk: usize) {
        if !self.is_dirty[chunk] {
            self.is_dirty[chunk] = true;
            self.list.push(chunk);
        }
    }
}

impl<const D: usize> Field<D> {
    pub fn new(layout: Layout<D>) -> Self {
        let count = layout.row_count() * layout.row_length;
        Self {
            layout,
            nodes: vec![f32x4::ZERO; count],
            dirty: DirtyChunks {
                is_dirty: vec![false; count / CHUNK],
                list: Vec::new(),
            },
        }
    }

    /// Replaces the field by the motion of particles, summed in their order.
    pub fn scatter(&mut self, samples: &[Sample<D>]) {
        self.clear();
        run_wide(Scatter {
            samples,
            layout: self.layout,
            nodes: &mut self.nodes,
            dirty: &mut self.dirty,
        });
        for &chunk in &self.dirty.list {
            for node in &mut self.nodes[chunk * CHUNK..(chunk + 1) * CHUNK] {
                let mass = node.to_array()[3];
                *node = if mass > SMALLEST_MASS {
                    *node * f32x4::splat(1.0 / mass)
                } else {
                    f32x4::ZERO
                };
                // Mass times its inverse need not be exactly 1.
                node.as_mut_array()[3] = if mass > SMALLEST_MASS { 1.0 } else { 0.0 };
            }
        }
    }

    fn clear(&mut self) {
        for chunk in self.dirty.list.drain(..) {
            self.dirty.is_dirty[chunk] = false;
            self.nodes[chunk * CHUNK..(chunk + 1) * CHUNK].fill(f32x4::ZERO);
        }
    }
}

/// Adds mass and mass times motion to the nodes.
struct Scatter<'a, const D: usize> {
    samples: &'a [Sample<D>],
    layout: Layout<D>,
    nodes: &'a mut [f32x4],
    dirty: &'a mut DirtyChunks,
}

impl<const D: usize> Kernel for Scatter<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        let resolution = self.layout.resolution as f32;
        let dx = self.layout.dx();
        for sample in self.samples {
            let xi = sample.x * resolution + Vector::from_element(PADDING as f32);
            let stencil = Stencil::at(&xi);
            let mut start = 0;
            let mut lowest = [0.0, 0.0, 0.0, sample.mass];
            let mut per_step = [[0.0; 4]; D];
            for row in 0..D {
                lowest[row] = sample.mass * sample.shift[row];
            }
            for axis in 0..D {
                let length = if axis == D - 1 {
                    self.layout.row_length
                } else {
                    self.layout.extents[axis]
                };
                start = start * length + stencil.base[axis];
                let offset = xi[axis] - stencil.base[axis] as f32;
                for row in 0..D {
                    per_step[axis][row] = sample.mass * dx * sample.gradient[(row, axis)];
                    lowest[row] -= per_step[axis][row] * offset;
                }
            }
            let last = stencil.weights[D - 1];
            let last = Q::of_nodes([last[0], last[1], last[2], 0.0]);
            let value = Q::repeat(f32x4::from(lowest)).mul(last);
            let along_last = Q::repeat(f32x4::from(per_step[D - 1])).mul(last);
            let along_first = Q::repeat(f32x4::from(per_step[0])).mul(last);
            let along_second = Q::repeat(f32x4::from(per_step[1])).mul(last);
            let mut plane = along_last.mul_add(Q::of_nodes([0.0, 1.0, 2.0, 0.0]), value);
            for a in 0..3 {
                let mut value = plane;
                for b in 0..if D == 3 { 3 } else { 1 } {
                    let across = if D == 3 { stencil.weights[1][b] } else { 1.0 };
                    let weight = Q::splat(stencil.weights[0][a] * across);
                    let begin = start + self.layout.stencil_row([a, b]);
                    let row: &mut [f32x4; 4] = (&mut self.nodes[begin..begin + 4])
                        .try_into()
                        .expect("four nodes");
                    *row = value.mul_add(weight, Q::load(row)).store();
                    self.dirty.mark(begin / CHUNK);
                    self.dirty.mark((begin + 2) / CHUNK);
                    value = value.add(along_second);
                }
                plane = plane.add(along_first);
            }
        }
    }
}
