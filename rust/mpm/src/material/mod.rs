//! Constitutive models. A material decides what a particle has to carry: water one number, sand the elastic
//! part of its stretch, elastic solids a deformation gradient.

mod elastic;
mod model;
mod sand;
mod water;

pub use elastic::Elastic;
pub use model::{Constitutive, Material, Model, State};
pub use sand::Sand;
pub use water::Water;
