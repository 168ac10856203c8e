//! Answer gate of the learned simulators, and the signal of the safeguard.

mod answer_gate;
mod history;

pub use answer_gate::AnswerGate;
pub use history::{AccelerationHistory, HistorySettings, SafeguardError, Signal};
