//! Guidance of particles to a goal.
//!
//! Before the motion, `match_to_region` assigns a place in the goal to each particle and a way around obstacles to each
//! group of particles, and `least_acceleration` times a way. In each frame `Ways::force` returns the accelerations with
//! which particles follow their ways from their actual positions; into a shape it gives them places anew near to the end.
//! `Followed` are several laws in turn, as a page reads them. `Push` is the local force of a hand. This crate simulates
//! nothing, and does not depend on Python.

mod assignment;
mod detour;
mod drawn;
mod error;
mod filter;
mod free_space;
mod matching;
mod outlines;
mod partition;
mod paths;
mod plan;
mod pressed;
mod push;
mod sight;
mod silhouette;
mod spline;
mod tracks;
mod ways;
mod ways_file;

pub use detour::Detour;
pub use drawn::Fluid;
pub use error::GuidanceError;
pub use free_space::FreeSpace;
pub use matching::{Matching, in_cells, match_to_region};
pub use outlines::Outlines;
pub use plan::Plan;
pub use push::Push;
pub use silhouette::{Extent, Filled, Filling, Lattice, SEAMS, Silhouette};
pub use spline::{Timing, least_acceleration};
pub use ways::{ANEW, Forces, Present, Room, SHORTEST_FRAMES, Settings, Settling, Ways};
pub use ways_file::Followed;
