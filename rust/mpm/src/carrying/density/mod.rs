//! Where carried particles are too dense, and where they are not where the few are; counted on grids.

mod crowding;
mod slide;
mod straying;
mod tally;

pub use crowding::Crowding;
pub use straying::Straying;
