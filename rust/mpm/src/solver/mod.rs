//! Simulation of a scene: the frame loop and prescribed motion.

mod frame_loop;
mod prescribe;
mod read;

pub use frame_loop::Solver;
pub use prescribe::{MotionReport, PrescribeOptions};
