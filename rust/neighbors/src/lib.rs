//! Fixed-radius neighbour graph in 2D and 3D by a cell list.
//!
//! Exact, without a cap on the number of neighbours, and the same for the same input on any number of threads: edges
//! are ordered by receiver, then by sender. Dimension is a const generic; D is 2 or 3.

mod error;
mod filter;
mod rows;
mod scan;
mod search;
mod settings;

pub use error::GraphError;
pub use search::Search;
pub use settings::GraphSettings;
