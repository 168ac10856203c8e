//! Finding the points near one point.

mod cells;
mod rank;
mod reach;
mod tile;

pub(crate) use cells::CellList;
pub(crate) use rank::{room, write_sorted};
pub(crate) use reach::Reach;
pub(crate) use tile::{Found, Tile};
