//! Walls and obstacles: their shapes, their motion, and their effect on velocities and particles.

mod bounds;
mod buckets;
mod contact;
mod crossings;
mod edge;
mod lattice;
mod line_window;
mod lines;
mod motion;
mod moving;
mod node;
mod obstacle;
mod obstacles;
mod outline;
mod reactions;
mod shape;
mod surface;
mod touch;
mod wall_contact;
mod wall_fill;

pub use bounds::Bounds;
pub use contact::{Contact, ContactKind, Walls, remaining_slip};
pub use lines::Probe;
pub use motion::{Motion, Pose, Swing};
pub use node::MaterialFriction;
pub use obstacle::{Obstacle, Placed};
pub use obstacles::Obstacles;
pub use reactions::{Reactions, Wrench};
pub use shape::Shape;
pub use surface::Surface;
pub use wall_contact::{Lines, WallContact};
pub use wall_fill::WallFill;
