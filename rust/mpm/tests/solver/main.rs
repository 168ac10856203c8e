//! The laws of the solver on real scenes, as one program: each would compile the whole solver anew.

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
