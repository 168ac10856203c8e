//! Openings that let material into a scene.

use crate::boundary::Walls;
use crate::error::MpmError;
use crate::linalg::Vector;
use serde::{Deserialize, Serialize};

/// An opening that material leaves at a given velocity, in layers one spacing apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Emitter<const D: usize> {
    /// Index into the materials.
    pub material: u8,
    /// Velocity of the material that leaves [m/s].
    pub velocity: Vector<D>,
    /// Distance between layers [m].
    pub spacing: f32,
    /// The particles of a layer that has just left the opening [m].
    pub sites: Vec<Vector<D>>,
    /// Offsets from the sites [m], of one layer after the other; used in turn.
    pub jitter: Vec<Vector<D>>,
    /// Mass of each particle [kg].
    pub mass: f32,
    /// Rest volume of each particle [m^D].
    pub volume: f32,
    /// When material begins to leave [s].
    pub start: f64,
    /// When it ceases to [s]; may be infinite.
    pub stop: f64,
}

/// Status of an emitter in the latest frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum EmitterStatus {
    /// It has not started.
    Waiting,
    Running,
    /// Material or an obstacle is in its way.
    Blocked,
    /// The scene has the largest number of particles allowed.
    Full,
    /// It has stopped.
    Ended,
}

impl EmitterStatus {
    const ALL: [Self; 5] = [
        Self::Waiting,
        Self::Running,
        Self::Blocked,
        Self::Full,
        Self::Ended,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Running => "running",
            Self::Blocked => "blocked",
            Self::Full => "full",
            Self::Ended => "ended",
        }
    }

    pub(crate) fn from_number(number: u32) -> Option<Self> {
        Self::ALL.get(number as usize).copied()
    }
}

impl<const D: usize> Emitter<D> {
    /// Returns an error for numbers out of range, and for openings outside the walls.
    ///
    /// `name` is that of the emitter in errors, `materials` their number; a frame lasts `frame_dt` [s].
    pub(crate) fn check(
        &self,
        name: &str,
        materials: usize,
        walls: &Walls<D>,
        frame_dt: f32,
    ) -> Result<(), MpmError> {
        let refuse = |what: &str, allowed, value: &dyn std::fmt::Debug| {
            Err(MpmError::parameter(
                format!("{name}.{what}"),
                allowed,
                value,
            ))
        };
        if usize::from(self.material) >= materials {
            return refuse("material", "an index into materials", &self.material);
        }
        let speed = self.velocity.norm();
        if !(speed > 0.0 && speed.is_finite()) {
            return refuse("velocity", "finite and not zero", &self.velocity.as_slice());
        }
        for (what, value) in [
            ("spacing", self.spacing),
            ("mass", self.mass),
            ("volume", self.volume),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(what, "finite and > 0", &value);
            }
        }
        if !(self.start >= 0.0 && self.start < self.stop) {
            return refuse("start", ">= 0 s and before stop", &(self.start, self.stop));
        }
        if self.sites.is_empty() || self.jitter.is_empty() {
            return refuse("sites", "one or more, with jitter", &self.sites.len());
        }
        if !self.jitter.len().is_multiple_of(self.sites.len()) {
            return refuse(
                "jitter",
                "of whole layers of sites",
                &(self.jitter.len(), self.sites.len()),
            );
        }
        let farthest = f64::from(speed) * f64::from(frame_dt);
        for (offset, jitter) in [0.0, farthest].iter().flat_map(|&offset| {
            let layers = self.jitter.chunks(self.sites.len());
            layers.map(move |jitter| (offset, jitter))
        }) {
            let layer = self.layer(offset, jitter);
            if let Some(outside) = layer.iter().find(|x| !walls.contains(x)) {
                let allowed = "an opening whose material stays inside the walls in its first frame";
                return refuse("sites", allowed, &outside.as_slice());
            }
        }
        Ok(())
    }

    /// The particles of a layer that has moved on by `offset` [m].
    pub(crate) fn layer(&self, offset: f64, jitter: &[Vector<D>]) -> Vec<Vector<D>> {
        let way = self.velocity * (offset / f64::from(self.velocity.norm())) as f32;
        let moved = self.sites.iter().zip(jitter);
        moved.map(|(site, jitter)| site + way + jitter).collect()
    }

    /// Offsets from the sites of the layer with this number.
    pub(crate) fn jitter_of(&self, layer: u64) -> &[Vector<D>] {
        let n = self.sites.len();
        let turns = (self.jitter.len() / n) as u64;
        &self.jitter[(layer % turns) as usize * n..][..n]
    }
}
