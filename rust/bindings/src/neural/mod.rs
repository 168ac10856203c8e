//! What surrounds the networks: `disturbance`, `relaxed`, `AccelerationHistory`.

mod answer_gate;
mod edges;
mod history;
mod relaxation;

pub use answer_gate::disturbance;
pub use history::{PyAccelerationHistory, PyAccelerationSignal};
pub use relaxation::relaxed;
