//! Properties of a solver's particles, in the caller's order.

use super::frame_loop::Solver;
use crate::diagnostics::Diagnostics;
use crate::linalg::Lanes;
use crate::openings::EmitterStatus;
use crate::particles::{Activity, with_group};
use crate::rigid::numbers_of;
use crate::settings::SolverSettings;
use crate::substep::FrameReport;

impl<const D: usize> Solver<D> {
    pub fn settings(&self) -> &SolverSettings<D> {
        &self.settings
    }

    /// Number of particles.
    pub fn count(&self) -> usize {
        self.state.population.ids.len()
    }

    /// Of each rigid body the centre of mass [m], the unit quaternion of its turn with the scalar first, its velocity [m/s] and its
    /// angular velocity [rad/s].
    pub fn rigid(&self) -> impl Iterator<Item = [f64; 13]> + '_ {
        self.state.rigid.bodies.iter().map(numbers_of)
    }

    /// Kinetic and potential energy of the rigid bodies [J].
    pub fn rigid_energy(&self) -> [f64; 2] {
        let bodies = self.bodies.as_ref();
        bodies.map_or([0.0; 2], |bodies| bodies.energy(&self.state.rigid))
    }

    /// Frames done.
    pub fn frame(&self) -> u64 {
        self.state.frame
    }

    /// How the latest frame was cut; None before the first.
    pub fn last_frame(&self) -> Option<FrameReport> {
        self.last_frame.clone()
    }

    /// N numbers, ascending, that particles keep for good.
    pub fn ids(&self) -> &[u64] {
        &self.state.population.ids
    }

    /// Status of each emitter in the latest frame.
    pub fn emitters(&self) -> impl Iterator<Item = EmitterStatus> + '_ {
        let flows = self.state.population.flows.iter();
        flows.map(|flow| flow.status)
    }

    /// Writes N indices into the materials.
    pub fn write_materials(&self, out: &mut [u8]) {
        for group in &self.state.groups {
            with_group!(group, group => for p in group.particles() {
                out[p.id as usize] = group.index;
            });
        }
    }

    /// Writes N numbers of bodies; 0 for materials that flow.
    pub(crate) fn write_bodies(&self, out: &mut [u32]) {
        for group in &self.state.groups {
            with_group!(group, group => for p in group.particles() {
                out[p.id as usize] = group.body;
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
        for group in &self.state.groups {
            with_group!(group, group => for (block, _) in group.blocks() {
                write_rows(&block.x, &block.id[..block.count], out);
            });
        }
    }

    /// Writes N x D velocities [m/s] in the caller's order.
    pub fn write_velocities(&self, out: &mut [f32]) {
        for group in &self.state.groups {
            with_group!(group, group => for (block, _) in group.blocks() {
                write_rows(&block.v, &block.id[..block.count], out);
            });
        }
    }

    /// Writes N x D x D APIC matrices [1/s], row-major, in the caller's order.
    pub fn write_affine(&self, out: &mut [f32]) {
        for group in &self.state.groups {
            with_group!(group, group => for p in group.particles() {
                let into = &mut out[p.id as usize * D * D..][..D * D];
                for (row, values) in into.chunks_exact_mut(D).enumerate() {
                    values
                        .iter_mut()
                        .enumerate()
                        .for_each(|(column, value)| *value = p.affine[(row, column)]);
                }
            });
        }
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

    /// Writes N pressures [Pa] in the caller's order.
    pub fn write_pressures(&self, out: &mut [f32]) {
        for group in &self.state.groups {
            with_group!(group, group => for p in group.particles() {
                out[p.id as usize] = group.pressure(&p);
            });
        }
    }

    /// Totals over all particles.
    pub fn diagnostics(&self) -> Diagnostics {
        Diagnostics::of(&self.state, &self.settings.gravity)
    }
}

/// Writes one vector for each particle of a block into the row of its index.
fn write_rows<const D: usize>(columns: &[Lanes; D], ids: &[u32], out: &mut [f32]) {
    let (rows, _) = out.as_chunks_mut::<D>();
    for (lane, &id) in ids.iter().enumerate() {
        let row = &mut rows[id as usize];
        for axis in 0..D {
            row[axis] = columns[axis][lane];
        }
    }
}
