//! Everything that can go wrong, with the values that a user needs to mend it.

use thiserror::Error;

/// Why a solver could not be built, advanced or restored.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MpmError {
    /// A parameter is outside its range.
    #[error("{name} must be {allowed}, got {value}")]
    Parameter {
        name: String,
        allowed: &'static str,
        value: String,
    },
    /// Rigid bodies overlap each other, walls or obstacles.
    #[error("{part}: {problem}")]
    Overlap { part: String, problem: String },
    /// Arrays of particles disagree.
    #[error("{name} must have {expected} entries, one a particle, got {got}")]
    Length {
        name: &'static str,
        expected: usize,
        got: usize,
    },
    /// A position, velocity or volume ratio became NaN or infinite.
    #[error(
        "particle {particle} became non-finite in frame {frame}: shorten the substeps, or look for \
         an external force without bound"
    )]
    NonFinite { particle: u32, frame: u64 },
    /// A particle crossed a wall by more than one cell, or left the world box.
    #[error(
        "particle {particle} left the domain in frame {frame} at {position:?} m; allowed is up to \
         {margin:.2e} m past a wall and [0, 1] on each axis"
    )]
    LeftDomain {
        particle: u32,
        frame: u64,
        position: Vec<f32>,
        margin: f32,
    },
    /// A particle was compressed to nothing.
    #[error(
        "particle {particle} reached volume ratio J = {volume_ratio:.3e} in frame {frame}, it must \
         stay above 0: shorten the substeps, stiffen the material or lower the speeds"
    )]
    Inverted {
        particle: u32,
        frame: u64,
        volume_ratio: f32,
    },
    /// A fixed substep above the stability limit.
    #[error(
        "a substep of {dt:.3e} s is above the stability limit of {limit:.3e} s ({bound}): use at \
         least {substeps} substeps a frame, or allow unstable steps by name"
    )]
    UnstableStep {
        dt: f32,
        limit: f32,
        bound: &'static str,
        substeps: u32,
    },
    /// More than `MAX_SUBSTEPS` substeps in a frame.
    #[error(
        "{signal} of {speed:.3e} m/s would need {substeps:.0} substeps in a frame, at most {most:.0} are \
         made: {remedy}"
    )]
    TooFast {
        signal: &'static str,
        speed: f32,
        substeps: f32,
        most: f32,
        remedy: &'static str,
    },
    /// The caller ended a frame.
    #[error("frame {frame} was cancelled before it was done; the state is the one before it")]
    Cancelled { frame: u64 },
    /// The caller ended the building of a solver.
    #[error("the building of the solver was cancelled before it was done")]
    BuildCancelled,
    /// Bytes that are no snapshot of this scene.
    #[error("snapshot refused: {reason}")]
    Snapshot { reason: String },
    /// Bytes that are no start file.
    #[error("start file refused: {reason}")]
    Start { reason: String },
}

impl MpmError {
    /// A parameter outside its range; `allowed` completes "must be".
    pub fn parameter(
        name: impl Into<String>,
        allowed: &'static str,
        value: impl std::fmt::Debug,
    ) -> Self {
        Self::Parameter {
            name: name.into(),
            allowed,
            value: format!("{value:?}"),
        }
    }
}

impl From<threads::ThreadError> for MpmError {
    fn from(error: threads::ThreadError) -> Self {
        Self::parameter(
            "threads",
            "a number that the system grants",
            error.to_string(),
        )
    }
}
