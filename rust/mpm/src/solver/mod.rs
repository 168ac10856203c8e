//! A scene in motion: the frame loop, and motion that somebody else prescribes.

mod cancel;
mod frame_loop;
mod prescribe;
mod read;

pub use cancel::CancelFlag;
pub use frame_loop::Solver;
pub use prescribe::{MotionReport, PrescribeOptions};
