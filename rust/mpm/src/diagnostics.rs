//! Totals over all particles, summed in double precision.

use crate::linalg::Vector;
use crate::particles::with_group;
use crate::state::SolverState;

/// Conserved and extreme quantities at one instant. In 2D, per metre of depth.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnostics {
    /// Mass of all particles [kg].
    pub mass: f64,
    /// Momentum, D components [kg m/s].
    pub momentum: Vec<f64>,
    /// Centre of mass, D components [m].
    pub centroid: Vec<f64>,
    /// Kinetic energy of the particles' velocities without their affine part [J].
    pub kinetic_energy: f64,
    /// Potential energy -m g . x [J].
    pub potential_energy: f64,
    /// Stored elastic energy [J].
    pub elastic_energy: f64,
    /// Largest speed of a particle [m/s].
    pub max_speed: f64,
    /// Smallest and largest J or det F [-]; 1 without particles.
    pub min_volume_ratio: f64,
    pub max_volume_ratio: f64,
    /// Mass that emitters have added since frame 0 [kg].
    pub emitted_mass: f64,
    /// Mass that sinks have removed since frame 0 [kg].
    pub removed_mass: f64,
}

impl Diagnostics {
    pub(crate) fn of<const D: usize>(state: &SolverState<D>, gravity: &Vector<D>) -> Self {
        let mut total = Self {
            mass: 0.0,
            momentum: vec![0.0; D],
            centroid: vec![0.0; D],
            kinetic_energy: 0.0,
            potential_energy: 0.0,
            elastic_energy: 0.0,
            max_speed: 0.0,
            min_volume_ratio: f64::INFINITY,
            max_volume_ratio: f64::NEG_INFINITY,
            emitted_mass: state.population.emitted_mass,
            removed_mass: state.population.removed_mass,
        };
        for group in &state.groups {
            with_group!(group, group => for p in group.particles() {
                let v = p.v;
                let mass = f64::from(p.mass);
                let speed_squared: f64 = v.iter().map(|&s| f64::from(s).powi(2)).sum();
                total.mass += mass;
                total.kinetic_energy += 0.5 * mass * speed_squared;
                total.max_speed = total.max_speed.max(speed_squared.sqrt());
                for axis in 0..D {
                    let x = f64::from(p.x[axis]);
                    total.momentum[axis] += mass * f64::from(v[axis]);
                    total.centroid[axis] += mass * x;
                    total.potential_energy -= mass * f64::from(gravity[axis]) * x;
                }
                total.elastic_energy += f64::from(group.elastic_energy(&p));
                let ratio = f64::from(group.volume_ratio(&p));
                total.min_volume_ratio = total.min_volume_ratio.min(ratio);
                total.max_volume_ratio = total.max_volume_ratio.max(ratio);
            });
        }
        if total.mass > 0.0 {
            total.centroid.iter_mut().for_each(|x| *x /= total.mass);
        } else {
            (total.min_volume_ratio, total.max_volume_ratio) = (1.0, 1.0);
        }
        total
    }
}
