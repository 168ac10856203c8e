//! Bodies and their mass.

use crate::geometry::{Geometry, about_z};
use crate::narrow::Solid;
use crate::pose::{Matrix3, Placed, Rotation, Vector3};

/// Inertia of a body; in the plane per metre of depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mass {
    /// [kg]
    pub mass: f64,
    /// About the centre of mass in the body's own frame [kg m^2].
    inertia: Matrix3,
    inverse: Matrix3,
    /// Whether the inertia is the same about all axes, or the motion is plane.
    is_round: bool,
}

impl Mass {
    fn new<const D: usize>(geometry: &Geometry, density: f64) -> Self {
        let (measure, moments) = geometry.moments::<D>();
        let inertia = moments * density;
        let inverse = if D == 2 {
            about_z(1.0 / inertia[(2, 2)])
        } else {
            inertia.try_inverse().unwrap_or_else(Matrix3::zeros)
        };
        Self {
            mass: measure * density,
            inertia,
            inverse,
            is_round: D == 2 || matches!(geometry, Geometry::Ball { .. }),
        }
    }

    /// The inertia in the world of a body that is turned so [kg m^2].
    pub fn inertia(&self, turn: &Rotation) -> Matrix3 {
        self.in_world(&self.inertia, turn)
    }

    /// The inverse of that.
    pub fn inverse_inertia(&self, turn: &Rotation) -> Matrix3 {
        self.in_world(&self.inverse, turn)
    }

    fn in_world(&self, own: &Matrix3, turn: &Rotation) -> Matrix3 {
        if self.is_round {
            return *own;
        }
        let turn = turn.to_rotation_matrix();
        turn.matrix() * own * turn.matrix().transpose()
    }

    /// Whether angular velocities stay as they are without torque.
    pub fn is_round(&self) -> bool {
        self.is_round
    }
}

/// What does not change of a body.
#[derive(Debug, Clone)]
pub struct Body {
    pub geometry: Geometry,
    pub mass: Mass,
    /// Coulomb coefficient [-].
    pub friction: f64,
    /// Speed of parting over speed of meeting [-], in [0, 1].
    pub restitution: f64,
    pub(crate) solid: Solid,
}

impl Body {
    /// A body of this density [kg/m^3].
    pub fn new<const D: usize>(
        geometry: Geometry,
        density: f64,
        friction: f64,
        restitution: f64,
    ) -> Self {
        Self {
            mass: Mass::new::<D>(&geometry, density),
            solid: Solid::new::<D>(&geometry),
            geometry,
            friction,
            restitution,
        }
    }

    /// Kinetic energy [J].
    pub fn kinetic_energy(&self, placed: &Placed, v: &Vector3, w: &Vector3) -> f64 {
        0.5 * (self.mass.mass * v.norm_squared() + w.dot(&(self.mass.inertia(&placed.turn) * w)))
    }
}
