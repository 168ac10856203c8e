//! Frames that end early: no look of the watch may leave anything behind.

mod common;

use std::cell::Cell;

use common::{Bodies, elastic, settings, water};
use mpm::{Force, MpmError, Solver};
use threads::watched;

/// Enough particles that stages are interrupted between slabs.
fn pool(threads: usize) -> Solver<2> {
    let resolution = 512;
    let mut settings = settings::<2>(resolution, vec![water(), elastic()]);
    settings.threads = threads;
    let block = |bodies: Bodies, lower, upper, material| {
        bodies.block(resolution, lower, upper, [0.3, -1.0], material)
    };
    let bodies = block(Bodies::default(), [0.1, 0.1], [0.6, 0.25], 0);
    block(bodies, [0.2, 0.3], [0.3, 0.35], 1).solver(settings)
}

/// Advances by a frame, in which the watch is true from its look number `look` on.
fn advance(solver: &mut Solver<2>, look: u32) -> Result<(), MpmError> {
    let looks = Cell::new(0);
    let poll = move || {
        looks.set(looks.get() + 1);
        looks.get() > look
    };
    watched(poll, || solver.advance(1, Force::None, |_, _| ()))
}

#[test]
fn an_interrupted_frame_leaves_the_state_before_it_wherever_it_ends() {
    for threads in [1, 2] {
        let mut solver = pool(threads);
        assert!(solver.count() > 1 << 16, "{}", solver.count());
        let before = solver.snapshot();
        let mut reference = solver.clone();
        advance(&mut reference, u32::MAX).unwrap();
        let mut look = 0;
        while let Err(error) = advance(&mut solver, look) {
            assert_eq!(error, MpmError::Cancelled { frame: 0 });
            assert!(solver.snapshot() == before, "look {look}");
            look += 7 + look / 2;
        }
        assert!(look > 50, "{look} looks in a frame of many stages");
        assert!(solver.snapshot() == reference.snapshot());
        assert_eq!(solver.last_frame(), reference.last_frame());
    }
}
