//! A material as a scene names it: a model with its constants, its density and its friction.

use super::elastic::Elastic;
use super::lame::Lame;
use super::liquid::Liquid;
use super::sand::Sand;
use super::water::Water;
use crate::error::MpmError;
use serde::{Deserialize, Serialize};

/// A constitutive model with its constants.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Model {
    Water(Water),
    Sand(Sand),
    Elastic(Elastic),
    Liquid(Liquid),
}

/// A model, how heavy it is, and how it rubs against walls.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
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
        let water = checked_water(bulk_modulus, tension, volume_correction)?;
        Self::new(Model::Water(water), density, wall_friction)
    }

    /// Liquid whose volume behaves as that of water, and which flows by `law`: K [Pa s^n], the yield stress [Pa] and n.
    pub fn liquid(
        density: f32,
        bulk_modulus: f32,
        law: [f32; 3],
        tension: f32,
        wall_friction: f32,
        volume_correction: bool,
    ) -> Result<Self, MpmError> {
        let [viscosity, yield_stress, flow_index] = law;
        let volume = checked_water(bulk_modulus, tension, volume_correction)?;
        positive("viscosity", viscosity)?;
        if !(yield_stress >= 0.0 && yield_stress.is_finite()) {
            let allowed = "finite and >= 0";
            return Err(MpmError::parameter("yield_stress", allowed, yield_stress));
        }
        if !(0.2..=2.0).contains(&flow_index) {
            let allowed = "in [0.2, 2]";
            return Err(MpmError::parameter("flow_index", allowed, flow_index));
        }
        let liquid = Liquid {
            volume,
            viscosity,
            yield_stress,
            flow_index,
        };
        Self::new(Model::Liquid(liquid), density, wall_friction)
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
        let Lame { mu, lambda } = self.lame();
        ((lambda + 2.0 * mu) / self.density).sqrt()
    }

    /// Speed that limits explicit steps in `dim` dimensions, sqrt((dim lambda + 2 mu) / rho) [m/s], without lambda < 0.
    ///
    /// A particle alone on its nodes swells and shrinks with angular frequency 2 / dx times this, since
    /// dC/dt = 4 / (rho dx^2) tau: stiffer than any wave in the bulk, and first to become unstable. With lambda < 0 it
    /// changes its shape faster than its volume.
    pub fn signal_speed(&self, dim: usize) -> f32 {
        let Lame { mu, lambda } = self.lame();
        ((dim as f32 * lambda.max(0.0) + 2.0 * mu) / self.density).sqrt()
    }

    /// dt times the signal speed over dx at which splashes and single particles were last seen to be stable, the
    /// lower of 2D and 3D; `python -m hybridmpm_lab validate stability_limit` measures it. Larger fixed steps are refused.
    pub fn cfl_limit(&self) -> f32 {
        match self.model {
            Model::Water(_) | Model::Liquid(_) => 0.675,
            Model::Sand(_) => 1.1,
            Model::Elastic(_) => 0.65,
        }
    }

    /// CFL number by default, at least 1.5 times below the limit. Elastic solids stiffen as they stretch, and a particle
    /// alone at twice its rest volume is stable up to 0.3 only.
    pub fn default_cfl(&self) -> f32 {
        match self.model {
            Model::Water(_) | Model::Liquid(_) => 0.45,
            Model::Sand(_) => 0.7,
            Model::Elastic(_) => 0.28,
        }
    }

    fn lame(&self) -> Lame {
        match &self.model {
            // At rest a liquid has no shear modulus. That of its stress is below what single particles have against a change
            // of volume, lambda dim / 2, so it limits no step.
            Model::Water(water) | Model::Liquid(Liquid { volume: water, .. }) => Lame {
                mu: 0.0,
                lambda: water.bulk_modulus,
            },
            Model::Sand(sand) => sand.lame,
            Model::Elastic(elastic) => elastic.lame,
        }
    }
}

fn positive(name: &str, value: f32) -> Result<(), MpmError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(MpmError::parameter(name, "finite and > 0", value))
}

fn checked_water(
    bulk_modulus: f32,
    tension: f32,
    volume_correction: bool,
) -> Result<Water, MpmError> {
    positive("bulk_modulus", bulk_modulus)?;
    if !(0.0..=1.0).contains(&tension) {
        return Err(MpmError::parameter("tension", "in [0, 1]", tension));
    }
    Ok(Water {
        bulk_modulus,
        tension,
        volume_correction,
    })
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
