//! Particles, grouped by material so that the loops over them have no branches.

use wide::f32x4;

use crate::grid::{Layout, PADDING};
use crate::material::{Constitutive, Elastic, Sand, Water};
use crate::math::{Columns, Vector};
use crate::stencil::Stencil;

/// One material point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle<const D: usize, S> {
    /// Position [m].
    pub x: Vector<D>,
    /// Velocity [m/s] in the first D lanes, one in the last: times the mass it is what a node holds.
    pub v: f32x4,
    /// APIC matrix C [1/s].
    pub affine: Columns<D>,
    /// [kg]
    pub mass: f32,
    /// Rest volume [m^D].
    pub volume: f32,
    /// Index in the caller's order.
    pub id: u32,
    pub state: S,
}

/// All particles of one material.
#[derive(Debug, Clone)]
pub struct Group<const D: usize, M: Constitutive<D>> {
    pub material: M,
    pub wall_friction: f32,
    pub particles: Vec<Particle<D, M::State>>,
    /// The other half of each sort; its content means nothing.
    scratch: Vec<Particle<D, M::State>>,
    /// Particles of slab s are `particles[slab_starts[s]..slab_starts[s + 1]]`.
    pub slab_starts: Vec<usize>,
}

impl<const D: usize, M: Constitutive<D>> Group<D, M> {
    pub fn new(material: M, wall_friction: f32, particles: Vec<Particle<D, M::State>>) -> Self {
        Self {
            material,
            wall_friction,
            particles,
            scratch: Vec::new(),
            slab_starts: Vec::new(),
        }
    }

    /// J of water, det F of solids [-].
    pub fn volume_ratio(&self, particle: &Particle<D, M::State>) -> f32 {
        self.material.volume_ratio(&particle.state)
    }

    /// Stored elastic energy [J].
    pub fn elastic_energy(&self, particle: &Particle<D, M::State>) -> f32 {
        self.material.energy_density(&particle.state) * particle.volume
    }
}

/// A group of any material.
#[derive(Debug, Clone)]
pub enum Phase<const D: usize> {
    Water(Group<D, Water>),
    Sand(Group<D, Sand>),
    Elastic(Group<D, Elastic>),
}

impl<const D: usize> Phase<D> {
    /// Takes over the particles of a phase of the same material without allocating.
    pub fn copy_particles(&mut self, from: &Self) {
        match (self, from) {
            (Self::Water(to), Self::Water(from)) => to.particles.clone_from(&from.particles),
            (Self::Sand(to), Self::Sand(from)) => to.particles.clone_from(&from.particles),
            (Self::Elastic(to), Self::Elastic(from)) => to.particles.clone_from(&from.particles),
            _ => unreachable!("the phases of a solver keep their order"),
        }
    }
}

/// Runs one expression on the group of whichever material.
#[macro_export]
macro_rules! with_group {
    ($phase:expr, $group:ident => $body:expr) => {
        match $phase {
            $crate::particle::Phase::Water($group) => $body,
            $crate::particle::Phase::Sand($group) => $body,
            $crate::particle::Phase::Elastic($group) => $body,
        }
    };
}

/// Planes `lo..hi` of the grid; the particles whose stencil starts there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slab {
    pub lo: usize,
    pub hi: usize,
}

/// Thinner slabs of one colour would touch the same nodes: a stencil reaches two planes beyond its
/// base, and the base moves by one in either direction between sorts.
const MIN_PLANES: usize = 4;
/// More than four threads gain nothing at the sizes that are interactive.
const MAX_SLABS: usize = 16;

/// Sorts all particles by grid row, and cuts the grid into slabs of about equal numbers of them.
///
/// The cut depends on the particles alone, never on the number of threads.
pub fn sort<const D: usize>(phases: &mut [Phase<D>], layout: &Layout<D>) -> Vec<Slab> {
    let mut per_plane = vec![0usize; layout.extent];
    for phase in phases.iter_mut() {
        with_group!(phase, group => sort_by_row(group, layout, &mut per_plane));
    }
    let slabs = cut(&per_plane);
    for phase in phases {
        with_group!(phase, group => {
            group.slab_starts.clear();
            group.slab_starts.push(0);
            group.slab_starts.extend(slabs.iter().map(|slab| {
                group.particles.partition_point(|p| base(&p.x, layout)[0] < slab.hi)
            }));
        });
    }
    slabs
}

/// Lowest stencil node of a particle.
#[inline(always)]
pub fn base<const D: usize>(x: &Vector<D>, layout: &Layout<D>) -> [usize; D] {
    Stencil::at(&layout.cells(x)).base
}

/// Stable counting sort; the order within a row is the previous one.
fn sort_by_row<const D: usize, M: Constitutive<D>>(
    group: &mut Group<D, M>,
    layout: &Layout<D>,
    per_plane: &mut [usize],
) {
    let row = |p: &Particle<D, M::State>| layout.row(base(&p.x, layout)) as u32;
    let rows: Vec<u32> = group.particles.iter().map(row).collect();
    let mut starts = vec![0u32; layout.row_count() + 1];
    for &row in &rows {
        starts[row as usize + 1] += 1;
    }
    for (plane, counts) in starts[1..].chunks(layout.rows_per_plane()).enumerate() {
        per_plane[plane] += counts.iter().sum::<u32>() as usize;
    }
    if rows.is_sorted() {
        return;
    }
    for row in 1..starts.len() {
        starts[row] += starts[row - 1];
    }
    // Every place of it is written below; an allocation this large would cost more than the sort.
    group
        .scratch
        .resize(group.particles.len(), group.particles[0]);
    for (particle, &row) in group.particles.iter().zip(&rows) {
        let place = &mut starts[row as usize];
        group.scratch[*place as usize] = *particle;
        *place += 1;
    }
    std::mem::swap(&mut group.particles, &mut group.scratch);
}

fn cut(per_plane: &[usize]) -> Vec<Slab> {
    let total: usize = per_plane.iter().sum();
    let share = total.div_ceil(MAX_SLABS).max(1);
    let end = per_plane.len() - PADDING + 1;
    let mut slabs = Vec::new();
    let (mut lo, mut held) = (0, 0);
    for (plane, &count) in per_plane.iter().enumerate().take(end) {
        held += count;
        if held >= share && plane + 1 - lo >= MIN_PLANES && slabs.len() + 1 < MAX_SLABS {
            slabs.push(Slab { lo, hi: plane + 1 });
            (lo, held) = (plane + 1, 0);
        }
    }
    match slabs.last_mut() {
        // What is left over joins the last slab if it is too thin to stand alone.
        Some(last) if end - lo < MIN_PLANES || held == 0 => last.hi = end,
        _ => slabs.push(Slab { lo, hi: end }),
    }
    slabs
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn slabs_tile_the_planes_and_are_never_thin(counts in prop::collection::vec(0usize..300, 20..140)) {
            let slabs = cut(&counts);
            prop_assert_eq!(slabs[0].lo, 0);
            prop_assert_eq!(slabs.last().unwrap().hi, counts.len() - PADDING + 1);
            for pair in slabs.windows(2) {
                prop_assert_eq!(pair[0].hi, pair[1].lo);
            }
            prop_assert!(slabs.len() == 1 || slabs.iter().all(|s| s.hi - s.lo >= MIN_PLANES));
            prop_assert!(slabs.len() <= MAX_SLABS);
        }
    }
}
