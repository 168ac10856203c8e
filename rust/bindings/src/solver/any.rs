//! What there is in either dimension: a solver, a carrier.

/// The same thing in the plane or in space.
#[derive(Clone)]
pub enum Any<P, S> {
    Plane(P),
    Space(S),
}

pub type AnySolver = Any<mpm::Solver<2>, mpm::Solver<3>>;
pub type AnyCarrier = Any<Box<mpm::Carrier<2>>, Box<mpm::Carrier<3>>>;

/// Runs one expression on the thing of whichever dimension.
macro_rules! with_any {
    ($any:expr, $thing:ident => $body:expr) => {
        match $any {
            $crate::solver::any::Any::Plane($thing) => $body,
            $crate::solver::any::Any::Space($thing) => $body,
        }
    };
}
pub(super) use with_any;
