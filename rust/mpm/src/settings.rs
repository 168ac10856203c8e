//! Settings of a solver and their checks, on which all stages rely.

use crate::boundary::{Obstacle, Shape, Walls};
use crate::error::MpmError;
use crate::linalg::{Vector, each_axis};
use crate::material::Material;
use crate::openings::Openings;
use crate::particles::Sleep;
use crate::rigid::{MOST_BODIES, RigidBody};
use crate::substep::Substeps;
use serde::{Deserialize, Serialize};

/// Everything about a scene but its particles.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SolverSettings<const D: usize> {
    /// Grid cells per metre.
    pub resolution: usize,
    /// Grid cells along each axis of the world, which begins at the origin.
    #[serde(with = "each_axis")]
    pub cells: [usize; D],
    /// Length of a frame [s].
    pub frame_dt: f32,
    /// Gravity [m/s^2].
    pub gravity: Vector<D>,
    pub walls: Walls<D>,
    /// Coulomb coefficient between an elastic body and anything else; None takes the smaller wall friction of the two.
    pub contact_friction: Option<f32>,
    /// Rate at which particles lose their deviations from the grid's velocity [1/s]; None loses them in each substep (APIC).
    pub transfer_loss: Option<f32>,
    /// 1 to 255 materials.
    pub materials: Vec<Material>,
    pub obstacles: Vec<Obstacle<D>>,
    /// At most `MOST_BODIES`.
    pub rigid: Vec<RigidBody<D>>,
    pub openings: Openings<D>,
    pub substeps: Substeps,
    /// Whether regions at rest may sleep; None for the ground truth.
    pub sleep: Option<Sleep>,
    /// Threads that a frame may use, at least 1; the result does not depend on them.
    pub threads: usize,
}

/// Most cells per metre.
pub const MAX_RESOLUTION: usize = 1 << 20;
/// Fewest and most cells along an axis.
pub const CELLS: [usize; 2] = [8, 4096];
/// Most cells of a grid; indices of nodes have 32 bits.
const MAX_CELLS: usize = 1 << 30;

/// Refuses grids that are too coarse or too large.
pub(crate) fn check_grid<const D: usize>(
    resolution: usize,
    cells: [usize; D],
) -> Result<(), MpmError> {
    let [fewest, most] = CELLS;
    if !(1..=MAX_RESOLUTION).contains(&resolution) {
        let allowed = "in [1, 1048576] cells per metre";
        return Err(MpmError::parameter("resolution", allowed, resolution));
    }
    if cells.iter().any(|count| !(fewest..=most).contains(count)) {
        let allowed = "in [8, 4096] along each axis";
        return Err(MpmError::parameter("cells", allowed, cells));
    }
    if cells.iter().product::<usize>() > MAX_CELLS {
        return Err(MpmError::parameter("cells", "at most 2^30 together", cells));
    }
    Ok(())
}

impl<const D: usize> SolverSettings<D> {
    /// Returns an error for settings out of range.
    pub(crate) fn check(&self) -> Result<(), MpmError> {
        check_grid(self.resolution, self.cells)?;
        if !(self.frame_dt > 0.0 && self.frame_dt.is_finite()) {
            return Err(MpmError::parameter(
                "frame_dt",
                "finite and > 0 s",
                self.frame_dt,
            ));
        }
        if !self.gravity.iter().all(|g| g.is_finite()) {
            return Err(MpmError::parameter(
                "gravity",
                "finite",
                self.gravity.as_slice(),
            ));
        }
        if self.materials.is_empty() || self.materials.len() > 255 {
            return Err(MpmError::parameter(
                "materials",
                "1 to 255 materials",
                self.materials.len(),
            ));
        }
        if let Some(mu) = self.contact_friction
            && !(mu >= 0.0 && mu.is_finite())
        {
            return Err(MpmError::parameter(
                "contact_friction",
                "finite and >= 0",
                mu,
            ));
        }
        if let Some(rate) = self.transfer_loss
            && !(rate >= 0.0 && rate.is_finite())
        {
            return Err(MpmError::parameter(
                "transfer_loss",
                "finite and >= 0 1/s",
                rate,
            ));
        }
        if self.threads == 0 {
            return Err(MpmError::parameter("threads", "at least 1", 0));
        }
        if let Some(sleep) = &self.sleep {
            sleep.check()?;
        }
        self.walls.check(1.0 / self.resolution as f32, self.cells)?;
        if self.rigid.len() > MOST_BODIES {
            let allowed = "at most 200 bodies";
            return Err(MpmError::parameter("rigid", allowed, self.rigid.len()));
        }
        let mut bodies = self.rigid.iter().enumerate();
        bodies.try_for_each(|(number, body)| body.check(number, &self.walls))?;
        let openings = &self.openings;
        openings.sinks.iter().try_for_each(Shape::check)?;
        let mut numbered = openings.emitters.iter().enumerate();
        numbered.try_for_each(|(i, emitter)| {
            let name = format!("emitters[{i}]");
            emitter.check(&name, self.materials.len(), &self.walls, self.frame_dt)
        })
    }
}
