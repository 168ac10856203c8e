//! Threads for two sizes of work. No result depends on which thread did which item.
//!
//! - `Pool` is for coarse work, from a tenth of a millisecond on: scenes of a batch, parts of a large graph. Its threads
//!   are rayon's.
//! - `Team` is for the stages of a substep, tens of microseconds each.

mod error;
mod pool;
mod shares;
mod steps;
mod team;
mod watch;

pub use error::ThreadError;
pub use pool::Pool;
pub use shares::Step;
pub use team::Team;
pub use watch::{interrupted, watched};
