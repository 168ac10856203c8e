//! Constitutive models. A material decides what a particle has to carry: water one number, sand the elastic
//! part of its stretch, elastic solids a deformation gradient.

mod constitutive;
mod elastic;
mod lame;
mod model;
mod sand;
mod water;

pub use constitutive::{Constitutive, Correction, State};
pub use elastic::Elastic;
pub use model::{Material, Model};
pub use sand::Sand;
pub use water::Water;
