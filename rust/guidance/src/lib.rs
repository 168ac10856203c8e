//! How particles are guided to a goal.
//!
//! Before anything moves, `match_to_region` gives each particle a place in the goal and each group of particles a
//! way around obstacles, and `least_acceleration` times a way. In each frame `Tracks::force` says with which
//! acceleration the particles follow their ways from where they really are. This crate simulates nothing, and
//! knows no Python.

mod assignment;
mod detour;
mod error;
mod filter;
mod free_space;
mod matching;
mod partition;
mod paths;
mod sight;
mod spline;
mod tracks;

pub use detour::Detour;
pub use error::GuidanceError;
pub use free_space::FreeSpace;
pub use matching::{Matching, match_to_region};
pub use paths::Paths;
pub use spline::{Timing, least_acceleration};
pub use tracks::{Law, Tracks};
