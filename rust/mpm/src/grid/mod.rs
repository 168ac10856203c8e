//! The background grid and the splines that join particles to its nodes.

mod active;
mod field_map;
mod field_window;
mod fields;
mod layout;
mod nodes;
mod stencil;
mod view;
mod window;

pub use active::ActiveSpans;
pub use field_map::{FieldMap, NodePlace, RowPlace, Slot};
pub use field_window::{FieldView, FieldWindow, Slopes};
pub use fields::{FieldSums, Fields};
pub use layout::{CHUNK, Layout, MARGIN, PADDING, Place, Span};
pub use nodes::{Grid, SMALLEST_MASS};
pub use stencil::{Stencil, Stencils, spline};
pub use view::View;
pub use window::Window;
