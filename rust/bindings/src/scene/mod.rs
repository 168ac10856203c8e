//! Parts of a solver: `Material`, `Obstacle`, `Emitter`.

mod emitter;
mod material;
mod obstacle;

pub use emitter::{AnyEmitter, PyEmitter};
pub use material::PyMaterial;
pub use obstacle::{AnyObstacle, PyObstacle};
