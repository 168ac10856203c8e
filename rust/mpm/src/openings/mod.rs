//! Where particles come from and go to between frames.

mod emitter;
mod exchange;
mod opening;
mod population;

pub use emitter::{Emitter, EmitterStatus};
pub(crate) use exchange::FrameEnd;
pub use exchange::Openings;
pub(crate) use opening::{Crowd, Opening};
pub(crate) use population::{Flow, Population};
