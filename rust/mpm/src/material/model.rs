//! What a constitutive model computes, and a material as a scene names it.

use std::fmt::Debug;

use super::elastic::Elastic;
use super::sand::Sand;
use super::water::Water;
use crate::error::MpmError;
use crate::linalg::{Lanes, Matrix, Symmetrics};

/// What the transfer loops need of a material. What they call is inlined into them, once per material and
/// dimension, and works on a block of particles at a time.
pub trait Constitutive<const D: usize>: Send + Sync {
    /// What one particle carries besides position, velocity and affine matrix.
    type State: State;

    /// The state at a given volume ratio, without shear.
    fn initial_state(&self, volume_ratio: f32) -> Self::State;
    /// tau = J sigma [Pa].
    fn kirchhoff_stress(&self, states: &<Self::State as State>::Block) -> Symmetrics<D>;
    /// Deforms by the velocity gradient `affine[row][column]` [1/s] over `dt` [s], and lets plastic flow happen.
    ///
    /// `crowding` is the density on the grid over the rest density, 0 where unknown.
    fn deform(
        &self,
        states: &mut <Self::State as State>::Block,
        affine: &[[Lanes; D]; D],
        crowding: &Lanes,
        dt: f32,
    );
    /// Whether `deform` looks at `crowding`.
    fn uses_crowding(&self) -> bool {
        false
    }
    /// J of water, det F of solids [-].
    fn volume_ratio(&self, state: &Self::State) -> f32;
    /// Stored elastic energy per rest volume [Pa].
    fn energy_density(&self, state: &Self::State) -> f32;
}

/// State of one particle, and how a block of particles holds it.
pub trait State: Copy + Send + Sync + Debug + PartialEq {
    /// One array over the lanes for each number.
    type Block: Copy + Send + Sync + Debug;

    /// The same state in all lanes.
    fn splat(self) -> Self::Block;
    fn load(block: &Self::Block, lane: usize) -> Self;
    fn store(self, block: &mut Self::Block, lane: usize);
    /// Plain numbers in a fixed order, for snapshots.
    fn write(&self, put: &mut impl FnMut(f32));
    fn read(take: &mut impl FnMut() -> f32) -> Self;
}

/// I + dt C of one particle.
#[inline(always)]
pub(super) fn increment<const D: usize>(
    affine: &[[Lanes; D]; D],
    lane: usize,
    dt: f32,
) -> Matrix<D> {
    Matrix::from_fn(|row, column| {
        let identity = if row == column { 1.0 } else { 0.0 };
        identity + dt * affine[row][column][lane]
    })
}

/// Lame parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lame {
    /// [Pa]
    pub mu: f32,
    /// [Pa]
    pub lambda: f32,
}

impl Lame {
    /// From Young's modulus [Pa] and Poisson's ratio [-].
    pub fn new(youngs_modulus: f32, poisson_ratio: f32) -> Self {
        let (e, nu) = (youngs_modulus, poisson_ratio);
        Self {
            mu: e / (2.0 * (1.0 + nu)),
            lambda: e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
        }
    }
}

/// A constitutive model with its constants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Model {
    Water(Water),
    Sand(Sand),
    Elastic(Elastic),
}

/// A model, how heavy it is, and how it rubs against walls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    pub model: Model,
    /// Rest density [kg/m^3].
    pub density: f32,
    /// Coulomb coefficient against walls and obstacles that name none [-].
    pub wall_friction: f32,
}

impl Material {
    /// Water of bulk modulus lambda [Pa]; `tension` in [0, 1] weakens the stress where J > 1.
    /// `volume_correction` leads J back to the density on the grid where they contradict each other.
    pub fn water(
        density: f32,
        bulk_modulus: f32,
        tension: f32,
        wall_friction: f32,
        volume_correction: bool,
    ) -> Result<Self, MpmError> {
        positive("bulk_modulus", bulk_modulus)?;
        if !(0.0..=1.0).contains(&tension) {
            return Err(MpmError::parameter("tension", "in [0, 1]", tension));
        }
        Self::new(
            Model::Water(Water {
                bulk_modulus,
                tension,
                volume_correction,
            }),
            density,
            wall_friction,
        )
    }

    /// Sand; `friction_angle` in degrees.
    pub fn sand(
        density: f32,
        youngs_modulus: f32,
        poisson_ratio: f32,
        friction_angle: f32,
        wall_friction: f32,
        volume_correction: bool,
    ) -> Result<Self, MpmError> {
        let lame = checked_lame(youngs_modulus, poisson_ratio)?;
        if !(friction_angle > 0.0 && friction_angle < 90.0) {
            return Err(MpmError::parameter(
                "friction_angle",
                "in (0, 90) degrees",
                friction_angle,
            ));
        }
        let sand = Sand::new(lame, friction_angle, volume_correction);
        Self::new(Model::Sand(sand), density, wall_friction)
    }

    /// Elastic solid.
    pub fn elastic(
        density: f32,
        youngs_modulus: f32,
        poisson_ratio: f32,
        wall_friction: f32,
    ) -> Result<Self, MpmError> {
        let lame = checked_lame(youngs_modulus, poisson_ratio)?;
        Self::new(Model::Elastic(Elastic { lame }), density, wall_friction)
    }

    fn new(model: Model, density: f32, wall_friction: f32) -> Result<Self, MpmError> {
        positive("density", density)?;
        if !(wall_friction >= 0.0 && wall_friction.is_finite()) {
            return Err(MpmError::parameter(
                "wall_friction",
                "finite and >= 0",
                wall_friction,
            ));
        }
        Ok(Self {
            model,
            density,
            wall_friction,
        })
    }

    /// Speed of the fastest wave at rest, sqrt((lambda + 2 mu) / rho) [m/s].
    pub fn sound_speed(&self) -> f32 {
        self.speed_of_modes(1)
    }

    /// Speed that limits explicit steps in `dim` dimensions, sqrt((dim lambda + 2 mu) / rho) [m/s].
    ///
    /// A particle alone on its nodes swells and shrinks with angular frequency 2 / dx times this, since
    /// dC/dt = 4 / (rho dx^2) tau: stiffer than any wave in the bulk, and first to become unstable.
    pub fn signal_speed(&self, dim: usize) -> f32 {
        self.speed_of_modes(dim)
    }

    /// dt times the signal speed over dx at which splashes and single particles were last seen to be stable, the
    /// lower of 2D and 3D; `hybridmpm bench stability` measures it. Larger fixed steps are refused.
    pub fn cfl_limit(&self) -> f32 {
        match self.model {
            Model::Water(_) => 0.675,
            Model::Sand(_) => 1.1,
            Model::Elastic(_) => 0.65,
        }
    }

    /// The same for steps that nobody chose: 1.5 times below the limit at least. Elastic solids stiffen as they
    /// stretch, and a particle alone at twice its rest volume is stable up to 0.3 only.
    pub fn default_cfl(&self) -> f32 {
        match self.model {
            Model::Water(_) => 0.45,
            Model::Sand(_) => 0.7,
            Model::Elastic(_) => 0.28,
        }
    }

    fn speed_of_modes(&self, dim: usize) -> f32 {
        let Lame { mu, lambda } = match &self.model {
            Model::Water(water) => Lame {
                mu: 0.0,
                lambda: water.bulk_modulus,
            },
            Model::Sand(sand) => sand.lame,
            Model::Elastic(elastic) => elastic.lame,
        };
        ((dim as f32 * lambda + 2.0 * mu) / self.density).sqrt()
    }
}

fn positive(name: &str, value: f32) -> Result<(), MpmError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(MpmError::parameter(name, "finite and > 0", value))
}

fn checked_lame(youngs_modulus: f32, poisson_ratio: f32) -> Result<Lame, MpmError> {
    positive("youngs_modulus", youngs_modulus)?;
    if !(poisson_ratio > -1.0 && poisson_ratio < 0.5) {
        return Err(MpmError::parameter(
            "poisson_ratio",
            "in (-1, 0.5)",
            poisson_ratio,
        ));
    }
    Ok(Lame::new(youngs_modulus, poisson_ratio))
}
