//! Division of a frame into substeps.

use crate::error::MpmError;
use crate::material::Material;
use serde::{Deserialize, Serialize};

/// Part of a cell that a particle may cross in a substep, unless the caller gives another CFL number.
pub const DEFAULT_SPEED_CFL: f32 = 0.55;
/// Part of a cell per substep above which fixed substeps are refused.
const SPEED_LIMIT: f32 = 0.8;
/// Most substeps in a frame; more mean unbounded speeds.
pub const MAX_SUBSTEPS: u32 = 20_000;

/// Rule for the substeps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Substeps {
    /// The fewest with dt <= cfl dx / max(signal speed, largest speed), chosen anew as speeds change. Without a
    /// number, each material's own default stands beside its signal speed.
    Cfl(Option<f32>),
    /// floor(frame / (0.02 dx)) + 1 equal ones, the rule of the ground truth.
    Reference,
    /// `count` equal ones.
    Fixed { count: u32, allow_unstable: bool },
}

/// Limit that set the step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// The stiffest mode of the materials present.
    Sound,
    /// The fastest particle.
    Speed,
    /// The fastest moving obstacle.
    Obstacle,
    /// The frame itself.
    Frame,
    /// The reference rule.
    Reference,
    /// The caller.
    Fixed,
}

impl Bound {
    const ALL: [Self; 6] = [
        Self::Sound,
        Self::Speed,
        Self::Obstacle,
        Self::Frame,
        Self::Reference,
        Self::Fixed,
    ];

    /// The limit of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|bound| bound.name() == name)
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Sound => "sound",
            Self::Speed => "speed",
            Self::Obstacle => "obstacle",
            Self::Frame => "frame",
            Self::Reference => "reference",
            Self::Fixed => "fixed",
        }
    }
}

/// Division of a frame into substeps.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameReport {
    pub substeps: u32,
    /// Length of the shortest substep [s].
    pub smallest_dt: f32,
    /// Limit that set it.
    pub bound: Bound,
    /// Work of moving obstacles on the material [J], in 2D per metre of depth: their impulses times their velocities. The
    /// weight that they lift by putting back single particles is left out.
    pub obstacle_work: f64,
    /// Largest speed of a particle at the end [m/s].
    pub max_speed: f32,
    /// Mean forces on walls and obstacles; see `Reactions::forces`. Empty where they are not kept.
    pub forces: Vec<f64>,
}

/// The rule of the ground truth: taichi_elements' default_dt of 0.02 dx.
pub fn reference_substeps(frame_dt: f32, dx: f32) -> u32 {
    // The quotient is an integer on the usual grids; keep rounding from dropping below it.
    (f64::from(frame_dt) / (0.02 * f64::from(dx)) + 1.0e-4).floor() as u32 + 1
}

/// Number of substeps of a frame that the CFL law gives for materials on a grid, at a largest speed [m/s].
///
/// The first frame has as many; speeds that change within a frame change it. It may exceed `MAX_SUBSTEPS`, which a solver
/// refuses.
pub fn cfl_substeps(
    frame_dt: f32,
    resolution: usize,
    dim: usize,
    materials: &[Material],
    speed: f32,
    cfl: Option<f32>,
) -> Result<f32, MpmError> {
    let dx = 1.0 / resolution as f32;
    let chooser = StepChooser::new(Substeps::Cfl(cfl), frame_dt, dx, dim, materials)?;
    Ok(chooser.cfl_substeps(cfl, speed))
}

/// Chooses the substeps of one scene.
#[derive(Debug, Clone, Copy)]
pub struct StepChooser {
    pub substeps: Substeps,
    pub frame_dt: f32,
    pub dx: f32,
    /// Signal speed of the stiffest material present [m/s].
    pub signal_speed: f32,
    /// Largest step that all materials take by default [s].
    default_dt: f32,
    /// Largest step at which all materials were stable [s].
    stable_dt: f32,
}

impl StepChooser {
    pub fn new(
        substeps: Substeps,
        frame_dt: f32,
        dx: f32,
        dim: usize,
        materials: &[Material],
    ) -> Result<Self, MpmError> {
        match substeps {
            Substeps::Cfl(Some(cfl)) if !(cfl > 0.0 && cfl <= 1.0) => {
                return Err(MpmError::parameter("cfl", "in (0, 1]", cfl));
            }
            Substeps::Fixed { count: 0, .. } => {
                return Err(MpmError::parameter("substeps", "at least 1", 0));
            }
            _ => {}
        }
        let signal_speed = materials
            .iter()
            .map(|m| m.signal_speed(dim))
            .fold(0.0, f32::max);
        let smallest = |cfl: fn(&Material) -> f32| {
            let steps = materials.iter().map(|m| cfl(m) * dx / m.signal_speed(dim));
            steps.fold(f32::INFINITY, f32::min)
        };
        Ok(Self {
            substeps,
            frame_dt,
            dx,
            signal_speed,
            default_dt: smallest(Material::default_cfl),
            stable_dt: smallest(Material::cfl_limit),
        })
    }

    /// The next step and what chose it. `particles` bounds the speeds of particles during it, `obstacles`
    /// those of obstacles [m/s].
    ///
    /// A particle and an obstacle close by the sum of both, and must not pass through each other in a step.
    pub fn next(
        &self,
        remaining: f32,
        particles: f32,
        obstacles: f32,
    ) -> Result<(f32, Bound), MpmError> {
        let speed = particles + obstacles;
        let moving = if obstacles > particles {
            Bound::Obstacle
        } else {
            Bound::Speed
        };
        let count = match self.substeps {
            Substeps::Cfl(cfl) => return self.under_cfl(cfl, remaining, speed, moving),
            Substeps::Reference => reference_substeps(self.frame_dt, self.dx),
            Substeps::Fixed { count, .. } => count,
        };
        let dt = self.frame_dt / count as f32;
        let motion = SPEED_LIMIT * self.dx / speed;
        let (limit, bound) = if self.stable_dt <= motion {
            (self.stable_dt, Bound::Sound)
        } else {
            (motion, moving)
        };
        if dt > limit
            && !matches!(
                self.substeps,
                Substeps::Fixed {
                    allow_unstable: true,
                    ..
                }
            )
        {
            return Err(MpmError::UnstableStep {
                dt,
                limit,
                bound: bound.name(),
                substeps: (self.frame_dt / limit).ceil() as u32,
            });
        }
        let bound = if self.substeps == Substeps::Reference {
            Bound::Reference
        } else {
            Bound::Fixed
        };
        Ok((dt, bound))
    }

    /// Number of equal substeps of a whole frame at a largest speed [m/s].
    fn cfl_substeps(&self, cfl: Option<f32>, speed: f32) -> f32 {
        let limit = self
            .cfl_limits(cfl, speed)
            .into_iter()
            .fold(f32::INFINITY, f32::min);
        (self.frame_dt / limit).ceil().max(1.0)
    }

    /// Longest substeps [s] by the signal speed of the materials and by the largest speed.
    fn cfl_limits(&self, cfl: Option<f32>, speed: f32) -> [f32; 2] {
        let sound = cfl.map_or(self.default_dt, |cfl| cfl * self.dx / self.signal_speed);
        let motion = cfl.unwrap_or(DEFAULT_SPEED_CFL) * self.dx / speed;
        [sound, motion]
    }

    fn under_cfl(
        &self,
        cfl: Option<f32>,
        remaining: f32,
        speed: f32,
        moving: Bound,
    ) -> Result<(f32, Bound), MpmError> {
        let (limit, bound) = match self.cfl_limits(cfl, speed) {
            [sound, motion] if sound <= motion => (sound, Bound::Sound),
            [_, motion] => (motion, moving),
        };
        let count = (remaining / limit).ceil().max(1.0);
        if count > MAX_SUBSTEPS as f32 || !count.is_finite() {
            let (signal, speed, remedy) = match bound {
                Bound::Speed => (
                    "particles",
                    speed,
                    "lower the velocities or the external force",
                ),
                Bound::Obstacle => ("obstacles", speed, "slow their motion down"),
                _ => (
                    "waves",
                    self.signal_speed,
                    "take a softer or denser material, or shorter frames",
                ),
            };
            let most = MAX_SUBSTEPS as f32;
            return Err(MpmError::TooFast {
                signal,
                speed,
                substeps: count,
                most,
                remedy,
            });
        }
        let bound = if limit >= self.frame_dt {
            Bound::Frame
        } else {
            bound
        };
        Ok((remaining / count, bound))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chooser(substeps: Substeps) -> StepChooser {
        let water = Material::water(1000.0, 277_778.0, 0.25, 0.0, true).unwrap();
        StepChooser::new(substeps, 0.0025, 1.0 / 128.0, 2, &[water]).unwrap()
    }

    #[test]
    fn reference_counts_are_those_of_the_ground_truth() {
        assert_eq!(reference_substeps(0.0025, 1.0 / 128.0), 17);
        assert_eq!(reference_substeps(0.0025, 1.0 / 64.0), 9);
    }

    #[test]
    fn the_bound_that_is_active_is_named() {
        let cfl = chooser(Substeps::Cfl(Some(0.5)));
        let (dt, bound) = cfl.next(0.0025, 1.0, 0.0).unwrap();
        assert_eq!(bound, Bound::Sound);
        // sqrt(2 * 277 778 / 1000) m/s in two dimensions.
        assert!(dt <= 0.5 / 128.0 / 23.57 && dt > 0.45 / 128.0 / 23.57);
        assert_eq!(cfl.next(0.0025, 40.0, 0.0).unwrap().1, Bound::Speed);
        // Each alone would be slower than sound; the step is that of both together.
        let (dt, bound) = cfl.next(0.0025, 20.0, 21.0).unwrap();
        assert_eq!(bound, Bound::Obstacle);
        assert!(dt <= 0.5 / 128.0 / 41.0 && dt > 0.45 / 128.0 / 41.0);
        assert_eq!(
            chooser(Substeps::Reference)
                .next(0.0025, 1.0, 0.0)
                .unwrap()
                .1,
            Bound::Reference
        );
    }

    #[test]
    fn the_count_of_a_frame_is_that_of_its_first_substep() {
        let water = Material::water(1000.0, 277_778.0, 0.25, 0.0, true).unwrap();
        for (cfl, speed) in [
            (None, 0.0),
            (None, 40.0),
            (Some(0.5), 1.0),
            (Some(0.1), 90.0),
        ] {
            let chooser = chooser(Substeps::Cfl(cfl));
            let (dt, _) = chooser.next(0.0025, speed, 0.0).unwrap();
            let count = cfl_substeps(0.0025, 128, 2, &[water], speed, cfl).unwrap();
            assert_eq!(0.0025 / count, dt, "{cfl:?}, {speed} m/s");
        }
        let count = cfl_substeps(0.0025, 128, 2, &[water], 1.0e6, None).unwrap();
        assert!(count > MAX_SUBSTEPS as f32);
    }

    #[test]
    fn unstable_steps_need_a_name() {
        let refused = chooser(Substeps::Fixed {
            count: 4,
            allow_unstable: false,
        });
        let error = refused.next(0.0025, 0.0, 0.0).unwrap_err();
        assert!(
            matches!(error, MpmError::UnstableStep { substeps: 12, .. }),
            "{error}"
        );
        assert!(
            chooser(Substeps::Fixed {
                count: 4,
                allow_unstable: true
            })
            .next(0.0025, 0.0, 0.0)
            .is_ok()
        );
        for (particles, obstacles, signal) in [(1.0e9, 0.0, "particles"), (0.0, 1.0e9, "obstacles")]
        {
            let error = chooser(Substeps::Cfl(Some(0.5)))
                .next(0.0025, particles, obstacles)
                .unwrap_err();
            assert!(
                matches!(error, MpmError::TooFast { signal: named, .. } if named == signal),
                "{error}"
            );
        }
    }
}
