//! What surrounds the networks: `answer_weights`, `relaxed`, `AccelerationHistory`.

mod answer_gate;
mod edges;
mod history;
mod relaxation;

pub use answer_gate::answer_weights;
pub use history::{PyAccelerationHistory, PyAccelerationSignal};
pub use relaxation::relaxed;
