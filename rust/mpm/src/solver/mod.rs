//! Simulation of a scene: the frame loop and prescribed motion.

mod cancel;
mod frame_loop;
mod prescribe;
mod read;

pub use cancel::CancelFlag;
pub use frame_loop::Solver;
pub use prescribe::{MotionReport, PrescribeOptions};
