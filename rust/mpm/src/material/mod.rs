//! Constitutive models. The state of a particle depends on the material: one number for water, that and a deviator for
//! liquids, the elastic part of the stretch for sand, a deformation gradient for elastic solids.

mod constitutive;
mod elastic;
mod lame;
mod liquid;
mod model;
mod sand;
mod water;

pub use constitutive::{Constitutive, Correction, State};
pub use elastic::Elastic;
pub use liquid::Liquid;
pub use model::{Material, Model};
pub use sand::Sand;
pub use water::Water;
