//! Fixed-radius neighbour graph in 2D and 3D by a cell list.
//!
//! Exact, without a cap on the number of neighbours, and the same for the same input on any number of threads: edges
//! are ordered by receiver, then by sender. Dimension is a const generic; D is 2 or 3.

mod cells;
mod disturbance;
mod error;
mod padded;
mod rank;
mod reach;
mod relaxation;
mod rows;
mod search;
mod tile;
mod verlet;

pub use disturbance::Disturbance;
pub use error::GraphError;
pub use padded::{most_neighbors, write_padded};
pub use relaxation::Relaxation;
pub use search::{Search, Settings};
pub use verlet::VerletList;
