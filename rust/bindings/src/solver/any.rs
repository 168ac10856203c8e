//! Solver and upsampler of either dimension.

/// A type in the plane or in space.
#[derive(Clone)]
pub enum Any<P, S> {
    Plane(P),
    Space(S),
}

pub type AnySolver = Any<mpm::Solver<2>, mpm::Solver<3>>;
pub type AnyUpsampler = Any<Box<mpm::Upsampler<2>>, Box<mpm::Upsampler<3>>>;

/// Evaluates an expression in the dimension of its operand.
macro_rules! with_any {
    ($any:expr, $thing:ident => $body:expr) => {
        match $any {
            $crate::solver::any::Any::Plane($thing) => $body,
            $crate::solver::any::Any::Space($thing) => $body,
        }
    };
}
pub(super) use with_any;
