//! Rigid bodies that touch each other and fixed solids, in the plane and in space.
//!
//! Shapes and their distances are parry's; the step is our own: contacts are solved by projected Gauss-Seidel on impulses,
//! in double precision and one fixed order. Plane motion is motion in space with z = 0. The step is a function of its
//! arguments: nothing is remembered but the `State`.

mod body;
mod contacts;
mod geometry;
mod hull;
mod narrow;
mod pose;
mod solve;
mod state;
mod world;

pub use body::{Body, Mass};
pub use geometry::{Facets, Geometry};
pub use hull::{Hull, HullError, polygon, polyhedron};
pub use pose::{Matrix3, Placed, Rotation, Vector3, across, turn_of_matrix, turn_of_y, turned};
pub use state::{Kept, Moving, Rates, State};
pub use world::{Fixed, Push, World};
