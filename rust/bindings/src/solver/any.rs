//! A solver of either dimension.

#[derive(Clone)]
pub enum AnySolver {
    Plane(mpm::Solver<2>),
    Space(mpm::Solver<3>),
}

/// Runs one expression on the solver of whichever dimension.
macro_rules! with_solver {
    ($any:expr, $solver:ident => $body:expr) => {
        match $any {
            AnySolver::Plane($solver) => $body,
            AnySolver::Space($solver) => $body,
        }
    };
}
pub(super) use with_solver;
