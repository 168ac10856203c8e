//! Guidance of particles to a goal: `FreeSpace`, `match_to_region`, `least_acceleration`, `Tracks`.

mod arrays;
mod free_space;
mod matching;
mod timing;
mod tracks;

pub use free_space::PyFreeSpace;
pub use matching::{PyMatching, match_to_region};
pub use timing::{PyTiming, least_acceleration};
pub use tracks::PyTracks;
