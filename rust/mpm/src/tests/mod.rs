//! The laws of the solver on real scenes. They are part of the crate, because programs beside it would compile the whole solver
//! anew.

mod common;
mod contact;
mod failures;
mod forces;
mod instructions;
mod interruption;
mod laws;
mod motion;
mod obstacles;
mod rigid;
mod sleep;
mod start;
mod transfer;
