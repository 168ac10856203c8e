//! Constitutive models. A material decides what a particle has to carry: water one number, sand and
//! elastic solids a deformation gradient.

use crate::error::MpmError;
use crate::math::{Columns, Matrix, Vector, determinant};
use crate::svd::svd;

/// What the transfer loops need of a material.
pub trait Constitutive<const D: usize>: Send + Sync {
    /// What one particle carries besides position, velocity and affine matrix.
    type State: Copy + Send + Sync + std::fmt::Debug + PartialEq + Words;

    /// The state at a given volume ratio, without shear.
    fn initial_state(&self, volume_ratio: f32) -> Self::State;
    /// tau = J sigma [Pa].
    fn kirchhoff_stress(&self, state: &Self::State) -> Matrix<D>;
    /// The same, as the transfer to the grid uses it.
    #[inline(always)]
    fn stress_columns(&self, state: &Self::State) -> Columns<D> {
        Columns::from_matrix(&self.kirchhoff_stress(state))
    }
    /// Deforms by the displacement gradient dt C of one substep, and lets plastic flow happen.
    ///
    /// `crowding` is the density on the grid over the rest density, 0 where unknown; `dt` the substep [s].
    fn deform(&self, state: &mut Self::State, gradient: &Columns<D>, crowding: f32, dt: f32);
    /// J of water, det F of solids [-].
    fn volume_ratio(&self, state: &Self::State) -> f32;
    /// Stored elastic energy per rest volume [Pa].
    fn energy_density(&self, state: &Self::State) -> f32;
}

/// Plain numbers in a fixed order, for snapshots.
pub trait Words: Sized {
    fn write(&self, put: &mut impl FnMut(f32));
    fn read(take: &mut impl FnMut() -> f32) -> Self;
}

/// Water: tau = lambda J (J - 1) I. Carries J only.
///
/// J follows the divergence at the particle, which forgets what splashes do to the spacing of particles:
/// alone it lets a double dam break lose 30 % of its volume in 30 s. Where particles crowd more than J
/// says, J is therefore led back to what the density on the grid says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Water {
    /// lambda [Pa].
    pub bulk_modulus: f32,
    /// Factor on the stress where J > 1. With 1 spray clumps, with 0 J drifts at the free surface.
    pub tension: f32,
    /// Lead J back where the grid contradicts it; without it J is what the divergence alone makes of it.
    pub volume_correction: bool,
}

impl Words for f32 {
    fn write(&self, put: &mut impl FnMut(f32)) {
        put(*self);
    }
    fn read(take: &mut impl FnMut() -> f32) -> Self {
        take()
    }
}

impl Water {
    /// How fast J follows a density that contradicts it [1/s]. 20 to 100 keep the volume equally well.
    const CROWDING_RATE: f32 = 50.0;
    /// Excess of density that is no contradiction [-]: particles at random places vary by about that.
    const CROWDING_TOLERANCE: f32 = 0.1;

    #[inline(always)]
    fn stiffness(&self, volume_ratio: f32) -> f32 {
        if volume_ratio > 1.0 {
            self.tension * self.bulk_modulus
        } else {
            self.bulk_modulus
        }
    }
}

impl Water {
    /// lambda J (J - 1), negative under compression [Pa].
    #[inline(always)]
    fn mean_stress(&self, volume_ratio: f32) -> f32 {
        self.stiffness(volume_ratio) * volume_ratio * (volume_ratio - 1.0)
    }
}

impl<const D: usize> Constitutive<D> for Water {
    type State = f32;

    fn initial_state(&self, volume_ratio: f32) -> f32 {
        volume_ratio
    }

    #[inline(always)]
    fn kirchhoff_stress(&self, &volume_ratio: &f32) -> Matrix<D> {
        Matrix::from_diagonal_element(self.mean_stress(volume_ratio))
    }

    #[inline(always)]
    fn stress_columns(&self, &volume_ratio: &f32) -> Columns<D> {
        Columns::diagonal(self.mean_stress(volume_ratio))
    }

    #[inline(always)]
    fn deform(&self, volume_ratio: &mut f32, gradient: &Columns<D>, crowding: f32, dt: f32) {
        *volume_ratio *= 1.0 + gradient.trace();
        if !self.volume_correction {
            return;
        }
        let excess = *volume_ratio * crowding - (1.0 + Self::CROWDING_TOLERANCE);
        // At most a halving, whatever the substep.
        *volume_ratio *= 1.0 - (Self::CROWDING_RATE * dt * excess).clamp(0.0, 0.5);
    }

    fn volume_ratio(&self, &volume_ratio: &f32) -> f32 {
        volume_ratio
    }

    fn energy_density(&self, &volume_ratio: &f32) -> f32 {
        // d psi / dJ = tau / J.
        0.5 * self.stiffness(volume_ratio) * (volume_ratio - 1.0).powi(2)
    }
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

/// Dry sand: StVK-Hencky elasticity with a Drucker-Prager yield surface (Klar et al. 2016).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sand {
    pub lame: Lame,
    /// Slope of the yield cone, sqrt(2/3) 2 sin(phi) / (3 - sin(phi)). In 2D the plane-strain friction
    /// angle is asin(sqrt(2) alpha): 45 degrees stay 45.4.
    pub alpha: f32,
    /// Take volume gained in separation back before stress builds up (Tampubolon et al. 2017).
    pub volume_correction: bool,
}

impl Sand {
    /// `friction_angle` in degrees.
    pub fn new(lame: Lame, friction_angle: f32, volume_correction: bool) -> Self {
        let sin = friction_angle.to_radians().sin();
        Self {
            lame,
            alpha: (2.0f32 / 3.0).sqrt() * 2.0 * sin / (3.0 - sin),
            volume_correction,
        }
    }

    /// Hencky strains on or inside the yield surface, and the log of the volume gained.
    #[inline(always)]
    fn return_mapping<const D: usize>(&self, trial: &Vector<D>, gained: f32) -> (Vector<D>, f32) {
        let Lame { mu, lambda } = self.lame;
        let strain = trial.add_scalar(gained / D as f32);
        let trace = strain.sum();
        if trace >= 0.0 {
            // Grains apart: no stress. Only the volume is remembered.
            return (
                Vector::zeros(),
                if self.volume_correction { trace } else { 0.0 },
            );
        }
        let deviator = strain.add_scalar(-trace / D as f32);
        let norm = deviator.norm();
        let excess = norm + (D as f32 * lambda + 2.0 * mu) / (2.0 * mu) * trace * self.alpha;
        if excess <= 0.0 {
            return (strain, 0.0);
        }
        (strain - deviator * (excess / norm), 0.0)
    }
}

/// Deformation of a sand particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SandState<const D: usize> {
    /// Elastic part of F.
    pub deformation_gradient: Matrix<D>,
    /// tau of that F, kept because plastic flow needs the same decomposition.
    pub kirchhoff_stress: Matrix<D>,
    /// Log of the volume gained while the grains were apart.
    pub volume_gain: f32,
}

impl<const D: usize> Words for SandState<D> {
    fn write(&self, put: &mut impl FnMut(f32)) {
        self.deformation_gradient.iter().for_each(|&word| put(word));
        self.kirchhoff_stress.iter().for_each(|&word| put(word));
        put(self.volume_gain);
    }
    fn read(take: &mut impl FnMut() -> f32) -> Self {
        Self {
            deformation_gradient: Matrix::from_fn(|_, _| take()),
            kirchhoff_stress: Matrix::from_fn(|_, _| take()),
            volume_gain: take(),
        }
    }
}

impl<const D: usize> Constitutive<D> for Sand {
    type State = SandState<D>;

    fn initial_state(&self, volume_ratio: f32) -> SandState<D> {
        let stretch = volume_ratio.powf(1.0 / D as f32);
        let mut state = SandState {
            deformation_gradient: Matrix::from_diagonal_element(stretch),
            kirchhoff_stress: Matrix::zeros(),
            volume_gain: 0.0,
        };
        self.deform(&mut state, &Columns::ZERO, 1.0, 0.0);
        state
    }

    #[inline(always)]
    fn kirchhoff_stress(&self, state: &SandState<D>) -> Matrix<D> {
        state.kirchhoff_stress
    }

    #[inline(always)]
    fn deform(&self, state: &mut SandState<D>, gradient: &Columns<D>, _crowding: f32, _dt: f32) {
        let f = (Matrix::identity() + gradient.matrix()) * state.deformation_gradient;
        let parts = svd(&f);
        // A floor far below any stretch that sand survives, so that the logarithm stays finite.
        let trial = parts.sigma.map(|s| s.max(1.0e-4).ln());
        let (strain, gained) = self.return_mapping(&trial, state.volume_gain);
        let Lame { mu, lambda } = self.lame;
        let principal = (strain * (2.0 * mu)).add_scalar(lambda * strain.sum());
        state.deformation_gradient =
            scaled_columns(&parts.u, &strain.map(f32::exp)) * parts.v.transpose();
        state.kirchhoff_stress = scaled_columns(&parts.u, &principal) * parts.u.transpose();
        state.volume_gain = gained;
    }

    fn volume_ratio(&self, state: &SandState<D>) -> f32 {
        determinant(&state.deformation_gradient)
    }

    fn energy_density(&self, state: &SandState<D>) -> f32 {
        let strain = svd(&state.deformation_gradient)
            .sigma
            .map(|s| s.max(1.0e-4).ln());
        self.lame.mu * strain.norm_squared() + 0.5 * self.lame.lambda * strain.sum().powi(2)
    }
}

/// M diag(s).
#[inline(always)]
fn scaled_columns<const D: usize>(m: &Matrix<D>, s: &Vector<D>) -> Matrix<D> {
    Matrix::from_fn(|row, column| m[(row, column)] * s[column])
}

/// Fixed-corotated solid (Stomakhin et al. 2012). Its state is F.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elastic {
    pub lame: Lame,
}

impl<const D: usize> Words for Matrix<D> {
    fn write(&self, put: &mut impl FnMut(f32)) {
        self.iter().for_each(|&word| put(word));
    }
    fn read(take: &mut impl FnMut() -> f32) -> Self {
        Matrix::from_fn(|_, _| take())
    }
}

impl<const D: usize> Constitutive<D> for Elastic {
    type State = Matrix<D>;

    fn initial_state(&self, volume_ratio: f32) -> Matrix<D> {
        Matrix::from_diagonal_element(volume_ratio.powf(1.0 / D as f32))
    }

    #[inline(always)]
    fn kirchhoff_stress(&self, f: &Matrix<D>) -> Matrix<D> {
        let Lame { mu, lambda } = self.lame;
        let parts = svd(f);
        let rotation = parts.u * parts.v.transpose();
        let j = determinant(f);
        (f - rotation) * f.transpose() * (2.0 * mu)
            + Matrix::from_diagonal_element(lambda * j * (j - 1.0))
    }

    #[inline(always)]
    fn deform(&self, f: &mut Matrix<D>, gradient: &Columns<D>, _crowding: f32, _dt: f32) {
        *f = (Matrix::identity() + gradient.matrix()) * *f;
    }

    fn volume_ratio(&self, f: &Matrix<D>) -> f32 {
        determinant(f)
    }

    fn energy_density(&self, f: &Matrix<D>) -> f32 {
        let stretch = svd(f).sigma.add_scalar(-1.0).norm_squared();
        self.lame.mu * stretch + 0.5 * self.lame.lambda * (determinant(f) - 1.0).powi(2)
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
