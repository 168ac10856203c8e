//! Rigid bodies that the material moves and that move it.

mod bodies;
mod body;
mod convert;
mod pull;

pub use bodies::{Bodies, numbers_of, start};
pub use body::{MOST_BODIES, RigidBody, hull};
pub use convert::pose_of_numbers;
pub use pull::Pull;
