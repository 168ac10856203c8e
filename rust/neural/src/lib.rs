//! What knows about networks: where their answers count, what follows them, and the signal that guards them.

mod answer_gate;
mod history;
mod relaxation;

pub use answer_gate::AnswerGate;
pub use history::{AccelerationHistory, HistorySettings, SafeguardError, Signal};
pub use relaxation::Relaxation;
