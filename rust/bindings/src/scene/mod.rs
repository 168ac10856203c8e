//! Parts of a solver: `Material`, `Obstacle`, `RigidBody`, `Emitter`.

mod emitter;
mod material;
mod obstacle;
mod rigid;

pub use emitter::{AnyEmitter, PyEmitter};
pub use material::PyMaterial;
pub use obstacle::{AnyObstacle, PyObstacle};
pub use rigid::{AnyRigidBody, PyRigidBody};
