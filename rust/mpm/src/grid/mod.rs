//! The background grid and the splines that join particles to its nodes.

mod active;
mod fields;
mod layout;
mod nodes;
mod stencil;
mod view;
mod window;

pub use active::ActiveSpans;
pub use fields::{FieldMap, FieldSums, FieldView, FieldWindow, Fields, NodePlace, Slopes};
pub use layout::{CHUNK, Layout, MARGIN, PADDING, Place, Span};
pub use nodes::{Grid, SMALLEST_MASS};
pub use stencil::{Stencil, Stencils, spline};
pub use view::View;
pub use window::Window;
