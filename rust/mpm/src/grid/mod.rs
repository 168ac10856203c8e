//! The background grid and the splines that join particles to its nodes.

mod active;
mod layout;
mod nodes;
mod stencil;

pub use active::ActiveSpans;
pub use layout::{CHUNK, Layout, PADDING, Place, Span};
pub use nodes::{Grid, MARGIN, SMALLEST_MASS, Window};
pub use stencil::{Stencil, Stencils, spline};
