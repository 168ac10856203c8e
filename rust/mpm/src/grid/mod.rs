//! The background grid and the splines that join particles to its nodes.

mod active;
mod layout;
mod nodes;
mod stencil;
mod window;

pub use active::ActiveSpans;
pub use layout::{CHUNK, Layout, MARGIN, PADDING, Place, Span};
pub use nodes::{Grid, SMALLEST_MASS};
pub use stencil::{Stencil, Stencils, spline};
pub use window::{View, Window};
