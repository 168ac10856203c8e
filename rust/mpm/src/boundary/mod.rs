//! Walls and obstacles: their shapes, their motion, and what they do to velocities and particles.

mod contact;
mod motion;
mod obstacle;
mod shape;
mod swept;
mod wall_fill;
mod walls;

pub use contact::{Contact, ContactKind};
pub use motion::{Motion, Swing};
pub use obstacle::{MaterialFriction, Obstacle, Obstacles, Placed};
pub use shape::Shape;
pub use wall_fill::WallFill;
pub use walls::{WallContact, Walls};
