//! What a solver tells of its particles, in the caller's order.

use super::frame_loop::Solver;
use crate::diagnostics::Diagnostics;
use crate::linalg::{Matrix, Vector};
use crate::openings::EmitterStatus;
use crate::particles::{Activity, with_group};

impl<const D: usize> Solver<D> {
    /// N numbers, ascending, that particles keep for good.
    pub fn ids(&self) -> &[u64] {
        &self.state.population.ids
    }

    /// What each emitter did in the latest frame.
    pub fn emitters(&self) -> impl Iterator<Item = EmitterStatus> + '_ {
        let flows = self.state.population.flows.iter();
        flows.map(|flow| flow.status)
    }

    /// Writes N indices into the materials.
    pub fn write_materials(&self, out: &mut [u8]) {
        for (material, group) in (0..).zip(&self.state.groups) {
            with_group!(group, group => for p in group.particles() {
                out[p.id as usize] = material;
            });
        }
    }

    /// Writes N masses [kg].
    pub fn write_masses(&self, out: &mut [f32]) {
        for group in &self.state.groups {
            with_group!(group, group => for p in group.particles() {
                out[p.id as usize] = p.mass;
            });
        }
    }

    /// Writes N x D positions [m] in the caller's order.
    pub fn write_positions(&self, out: &mut [f32]) {
        self.scatter(out, D, |x, _, _, into| into.copy_from_slice(x.as_slice()));
    }

    /// Writes N x D velocities [m/s] in the caller's order.
    pub fn write_velocities(&self, out: &mut [f32]) {
        self.scatter(out, D, |_, v, _, into| into.copy_from_slice(v.as_slice()));
    }

    /// Writes N x D x D APIC matrices [1/s], row-major, in the caller's order.
    pub fn write_affine(&self, out: &mut [f32]) {
        self.scatter(out, D * D, |_, _, c, into| {
            for (row, values) in into.chunks_exact_mut(D).enumerate() {
                values
                    .iter_mut()
                    .enumerate()
                    .for_each(|(column, value)| *value = c[(row, column)]);
            }
        });
    }

    /// Writes for N particles in the caller's order whether they sleep.
    pub fn write_asleep(&self, out: &mut [bool]) {
        for group in &self.state.groups {
            with_group!(group, group => for p in group.particles() {
                out[p.id as usize] = p.activity != Activity::Awake;
            });
        }
    }

    /// Writes N volume ratios in the caller's order.
    pub fn write_volume_ratios(&self, out: &mut [f32]) {
        for group in &self.state.groups {
            with_group!(group, group => for p in group.particles() {
                out[p.id as usize] = group.volume_ratio(&p);
            });
        }
    }

    fn scatter(
        &self,
        out: &mut [f32],
        width: usize,
        write: impl Fn(&Vector<D>, &Vector<D>, &Matrix<D>, &mut [f32]),
    ) {
        for group in &self.state.groups {
            with_group!(group, group => for p in group.particles() {
                write(&p.x, &p.v, &p.affine, &mut out[p.id as usize * width..][..width]);
            });
        }
    }

    /// Totals over all particles.
    pub fn diagnostics(&self) -> Diagnostics {
        Diagnostics::of(&self.state, &self.settings.gravity)
    }
}
