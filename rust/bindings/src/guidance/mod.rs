//! Guidance of particles to a goal: `FreeSpace`, `Outlines`, `match_to_region`, `least_acceleration`, `Ways`,
//! `push_force`.

mod arrays;
mod free_space;
mod matching;
mod outlines;
mod push;
mod timing;
mod ways;

pub use free_space::PyFreeSpace;
pub use matching::{PyMatching, match_to_region};
pub use outlines::{PyOutlines, filled_solid, pressed};
pub use push::push_force;
pub use timing::{PyTiming, least_acceleration};
pub use ways::PyWays;
