//! The background grid and the splines that join particles to its nodes.

mod nodes;
mod stencil;

pub use nodes::{CHUNK, Grid, Layout, MARGIN, PADDING, Span, Window};
pub use stencil::{Stencil, Stencils, spline};
