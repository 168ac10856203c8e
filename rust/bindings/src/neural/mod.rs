//! `answer_weights` and `AccelerationHistory`.

mod answer_gate;
mod edges;
mod history;

pub use answer_gate::answer_weights;
pub use history::{PyAccelerationHistory, PyAccelerationSignal};
