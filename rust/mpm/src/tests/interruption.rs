//! Frames that end early: no look of the watch may leave anything behind.

use std::cell::Cell;
use std::rc::Rc;

use super::common::{Bodies, elastic, settings, water};
use crate::{
    Contact, ContactKind, Force, Motion, MpmError, Obstacle, Shape, Solver, SolverSettings, Vector,
};
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

/// Settings with obstacles at rest and in motion.
fn crowded() -> SolverSettings<2> {
    let contact = Contact {
        kind: ContactKind::Separating,
        friction: None,
    };
    let turning = || {
        Motion::new(
            Vector::<2>::new(0.1, 0.0),
            &[2.0],
            Vector::<2>::zeros(),
            None,
        )
    };
    let mut settings = settings::<2>(64, vec![water()]);
    for index in 0..60 {
        let (column, row) = ((index % 10) as f32, (index / 10) as f32);
        let center = Vector::<2>::new(0.15 + 0.07 * column, 0.4 + 0.07 * row);
        let ball = Shape::Ball {
            center,
            radius: 0.02,
        };
        let obstacle = Obstacle::new(ball, contact).unwrap();
        settings.obstacles.push(if index % 7 == 0 {
            obstacle.moving(turning().unwrap())
        } else {
            obstacle
        });
    }
    settings
}

#[test]
fn the_building_of_a_solver_ends_at_its_next_look() {
    let block = Bodies::default().block(64, [0.1, 0.1], [0.8, 0.3], [0.0, 0.0], 0);
    let build = |last: u32| {
        let looks = Rc::new(Cell::new(0));
        let count = Rc::clone(&looks);
        let poll = move || {
            count.set(count.get() + 1);
            count.get() >= last
        };
        let built = watched(poll, || block.try_solver(crowded()));
        (built.map(|solver| solver.snapshot()), looks.get())
    };
    let (whole, every) = build(u32::MAX);
    assert!(every > 500, "{every} looks");
    let whole = whole.unwrap();
    for last in (1..every).step_by(17) {
        let (built, looks) = build(last);
        assert_eq!(built, Err(MpmError::BuildCancelled));
        // Rows of a search that is ended are counted, but not searched.
        assert!(looks <= last + 80, "{looks} looks after {last}");
    }
    assert!(build(u32::MAX).0.unwrap() == whole);
}

#[test]
fn a_search_for_moving_obstacles_that_was_ended_is_made_again() {
    let block = Bodies::default().block(64, [0.1, 0.1], [0.8, 0.3], [0.0, 0.0], 0);
    let mut solver = block.solver(crowded());
    let mut reference = solver.clone();
    for frame in 0..12 {
        let before = solver.snapshot();
        let end = |solver: &mut Solver<2>, look: u32| {
            let looks = Rc::new(Cell::new(0));
            let count = Rc::clone(&looks);
            let poll = move || {
                count.set(count.get() + 1);
                count.get() > look
            };
            let outcome = watched(poll, || solver.advance(1, Force::None, |_, _| ()));
            (outcome, looks.get())
        };
        let (_, every) = end(&mut solver.clone(), u32::MAX);
        for look in [0, every / 3, every - 1] {
            let (outcome, _) = end(&mut solver, look);
            assert_eq!(outcome, Err(MpmError::Cancelled { frame }));
            assert!(solver.snapshot() == before, "look {look} of frame {frame}");
        }
        solver.advance(1, Force::None, |_, _| ()).unwrap();
        reference.advance(1, Force::None, |_, _| ()).unwrap();
        assert!(solver.snapshot() == reference.snapshot(), "frame {frame}");
    }
}
