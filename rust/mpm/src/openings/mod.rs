//! Where particles come from and go to between frames.

mod emitter;
mod exchange;

pub use emitter::{Emitter, EmitterStatus};
pub(crate) use exchange::{Flow, Population, exchange};
