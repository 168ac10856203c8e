//! Many particles, carried along by the motion of few.
//!
//! A simulator of few particles, coarse MPM or a network, moves matter; a `Carrier` lets all particles of the scene take
//! part. Every few frames it spreads what the few have moved by on the nodes of their grid, as P2G spreads
//! momentum, and gathers it at the many, as G2P gathers velocity (`field`). The many then part where they have become
//! too dense (`crowding`), and stay between walls and outside of obstacles. Between two such *carries* their positions
//! are computed from the last one whenever somebody asks, so nobody who looks changes what follows.
//!
//! The few may come from anybody: positions, affine matrices and masses are all that is asked for.

mod block;
mod carrier;
mod density;
mod exchange;
mod few;
mod field;
mod force;
mod gather;
mod snapshot;
mod surfaces;
#[cfg(test)]
mod tests;

pub use carrier::{CARRY_EVERY, Carrier, CarryConstants};
pub use few::Few;
