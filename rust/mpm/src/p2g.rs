//! Particles to grid (Hu et al. 2018, eq. 16-19; APIC by Jiang et al. 2015).
//!
//! Node i receives w_ip (m v + A (x_i - x_p)) with A = m C - dt V_0 (4 / dx^2) tau, and w_ip m.

use rayon::prelude::*;
use wide::f32x4;

use crate::grid::{Grid, Layout, MARGIN};
use crate::material::Constitutive;
use crate::math::{Vector, lanes};
use crate::particle::{Particle, Phase, Slab};
use crate::stencil::Stencil;
use crate::with_group;

/// What one substep needs besides the state.
#[derive(Clone, Copy)]
pub struct Step<'a, const D: usize> {
    /// [s]
    pub dt: f32,
    /// External acceleration [m/s^2] in the caller's order, N x D numbers.
    pub force: Option<&'a [f32]>,
}

/// The planes of the grid that one slab may write.
struct Window<'a> {
    slab: usize,
    /// Memory index of the first node.
    first: usize,
    nodes: &'a mut [f32x4],
    /// Empty unless materials differ in wall friction.
    friction_mass: &'a mut [f32],
}

/// Adds all particles to a cleared grid.
///
/// Slabs of one colour touch different nodes and may run at once; colours follow each other, so each node
/// sums in the same order whatever the number of threads.
pub fn p2g<const D: usize>(
    phases: &[Phase<D>],
    slabs: &[Slab],
    grid: &mut Grid<D>,
    step: Step<'_, D>,
    parallel: bool,
) {
    let layout = grid.layout;
    for colour in 0..2 {
        let windows = windows(slabs, colour, grid);
        let scatter = |mut window: Window<'_>| {
            for phase in phases {
                with_group!(phase, group => {
                    let range = group.slab_starts[window.slab]..group.slab_starts[window.slab + 1];
                    let particles = &group.particles[range];
                    scatter_group(particles, &group.material, &layout, &mut window, step);
                    if !window.friction_mass.is_empty() {
                        scatter_friction(particles, group.wall_friction, &layout, &mut window);
                    }
                });
            }
        };
        if parallel {
            windows.into_par_iter().for_each(scatter);
        } else {
            windows.into_iter().for_each(scatter);
        }
    }
}

/// Cuts the planes that the slabs of one colour reach out of the grid.
fn windows<'a, const D: usize>(
    slabs: &[Slab],
    colour: usize,
    grid: &'a mut Grid<D>,
) -> Vec<Window<'a>> {
    let plane = grid.layout.nodes_per_plane();
    let (mut nodes, mut friction) = (&mut grid.nodes[..], &mut grid.friction_mass[..]);
    let mut cut = 0;
    let mut windows = Vec::with_capacity(slabs.len() / 2 + 1);
    for (slab, planes) in slabs.iter().enumerate().skip(colour).step_by(2) {
        let first = planes.lo.saturating_sub(MARGIN) * plane;
        let end = ((planes.hi + MARGIN + 2) * plane).min(cut + nodes.len());
        let (mine, rest) = std::mem::take(&mut nodes)[first - cut..].split_at_mut(end - first);
        let (my_friction, friction_rest) = if friction.is_empty() {
            (&mut [][..], friction)
        } else {
            std::mem::take(&mut friction)[first - cut..].split_at_mut(end - first)
        };
        windows.push(Window {
            slab,
            first,
            nodes: mine,
            friction_mass: my_friction,
        });
        (nodes, friction, cut) = (rest, friction_rest, end);
    }
    windows
}

#[inline(always)]
fn scatter_group<const D: usize, M: Constitutive<D>>(
    particles: &[Particle<D, M::State>],
    material: &M,
    layout: &Layout<D>,
    window: &mut Window<'_>,
    step: Step<'_, D>,
) {
    let dx = layout.dx();
    let stress_factor = -step.dt * 4.0 / dx;
    for p in particles {
        let stencil = Stencil::at(&layout.cells(&p.x));
        let stress = material.stress_columns(&p.state).0;
        let (inertia, tension) = (
            f32x4::splat(p.mass * dx),
            f32x4::splat(stress_factor * p.volume),
        );
        // What a node gets more for each step along an axis.
        let per_step: [f32x4; D] =
            std::array::from_fn(|k| p.affine.0[k] * inertia + stress[k] * tension);
        let v = match step.force {
            Some(force) => {
                let a = &force[p.id as usize * D..][..D];
                p.v + lanes(&Vector::<D>::from_column_slice(a), 0.0) * f32x4::splat(step.dt)
            }
            None => p.v,
        };
        // What the lowest node would get at weight one.
        let mut lowest = v * f32x4::splat(p.mass);
        for axis in 0..D {
            lowest -= per_step[axis] * f32x4::splat(stencil.offset[axis]);
        }
        let start = layout.row(stencil.base) * layout.extent + stencil.base[D - 1] - window.first;
        let last = stencil.weights[D - 1].map(f32x4::splat);
        let mut scatter_row = |value: f32x4, weight: f32, begin: usize| {
            let weight = f32x4::splat(weight);
            let row: &mut [f32x4; 3] = (&mut window.nodes[begin..begin + 3])
                .try_into()
                .expect("three nodes");
            let (value, slope) = (value * weight, per_step[D - 1] * weight);
            row[0] += value * last[0];
            row[1] += (value + slope) * last[1];
            row[2] += (value + slope + slope) * last[2];
        };
        let mut value = lowest;
        for i in 0..3 {
            let (weight, begin) = (stencil.weights[0][i], start + layout.stencil_row([i, 0]));
            if D == 3 {
                let mut value = value;
                for j in 0..3 {
                    let begin = begin + j * layout.extent;
                    scatter_row(value, weight * stencil.weights[1][j], begin);
                    value += per_step[1];
                }
            } else {
                scatter_row(value, weight, begin);
            }
            value += per_step[0];
        }
    }
}

/// Wall friction as a mass-weighted quantity, where materials differ in it.
fn scatter_friction<const D: usize, S>(
    particles: &[Particle<D, S>],
    friction: f32,
    layout: &Layout<D>,
    window: &mut Window<'_>,
) {
    for p in particles.iter().filter(|_| friction > 0.0) {
        let stencil = Stencil::at(&layout.cells(&p.x));
        let start = layout.row(stencil.base) * layout.extent + stencil.base[D - 1] - window.first;
        for_each_row::<D>(|i, j| {
            let across = if D == 3 { stencil.weights[1][j] } else { 1.0 };
            let weight = stencil.weights[0][i] * across * p.mass * friction;
            for (k, w) in stencil.weights[D - 1].iter().enumerate() {
                window.friction_mass[start + layout.stencil_row([i, j]) + k] += weight * w;
            }
        });
    }
}

/// Calls back for each row of nodes of a stencil.
#[inline(always)]
fn for_each_row<const D: usize>(mut visit: impl FnMut(usize, usize)) {
    for i in 0..3 {
        if D == 3 {
            for j in 0..3 {
                visit(i, j);
            }
        } else {
            visit(i, 0);
        }
    }
}
