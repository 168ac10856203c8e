//! Regions at rest: which particles sleep, causes of waking, and effects on the result.

use super::common::*;
use crate::{
    Contact, ContactKind, Force, Motion, Obstacle, Shape, Sleep, Solver, SolverSettings, Vector,
};

const SLEEP: Sleep = Sleep {
    speed: 0.02,
    frames: 20,
};

fn asleep<const D: usize>(solver: &Solver<D>) -> Vec<bool> {
    let mut asleep = vec![false; solver.count()];
    solver.write_asleep(&mut asleep);
    asleep
}

fn share<const D: usize>(solver: &Solver<D>) -> f64 {
    let asleep = asleep(solver);
    asleep.iter().filter(|&&asleep| asleep).count() as f64 / asleep.len() as f64
}

/// A heap of sand that has come to rest after 240 frames, and a grain that is thrown up and lands on it then.
fn heap(sleep: Option<Sleep>) -> Solver<2> {
    heap_on(sleep, 1)
}

fn heap_on(sleep: Option<Sleep>, threads: usize) -> Solver<2> {
    let mut settings: SolverSettings<2> = settings(64, vec![sand()]);
    (settings.sleep, settings.threads) = (sleep, threads);
    let grain = ([0.5, 0.34375], [0.507_812_5, 0.351_562_5], [0.0, 3.2]);
    let bodies = Bodies::default()
        .block(64, [0.3, 0.1], [0.7, 0.3], [0.0; 2], 0)
        .block(64, grain.0, grain.1, grain.2, 0);
    bodies.solver(settings)
}

const REST: usize = 240;

#[test]
fn a_heap_falls_asleep_and_then_stays_where_it_is() {
    let mut solver = heap(Some(SLEEP));
    run(&mut solver, REST);
    let (x, sleepers) = (positions(&solver), asleep(&solver));
    assert!(
        share(&solver) > 0.9,
        "{} of the heap sleeps",
        share(&solver)
    );
    let v = velocities(&solver);
    run(&mut solver, 1);
    let later = positions(&solver);
    for i in (0..sleepers.len()).filter(|&i| sleepers[i] && asleep(&solver)[i]) {
        assert_eq!(x[2 * i..][..2], later[2 * i..][..2]);
        assert_eq!(v[2 * i..][..2], [0.0; 2]);
    }
}

#[test]
fn a_falling_grain_wakes_what_it_touches_and_nothing_far_away() {
    let (mut sleepy, mut awake) = (heap(Some(SLEEP)), heap(None));
    let grain = sleepy.count() - 1;
    let (mut landed, mut woken) = (false, 0.0f64);
    for _ in 0..REST + 120 {
        run(&mut sleepy, 1);
        run(&mut awake, 1);
        if sleepy.frame() < REST as u64 {
            continue;
        }
        let (x, sleepers) = (positions(&sleepy), asleep(&sleepy));
        woken = woken.max(1.0 - share(&sleepy));
        for i in 0..grain {
            let away = (x[2 * i] - x[2 * grain]).hypot(x[2 * i + 1] - x[2 * grain + 1]);
            let moving = !sleepers[grain];
            landed |= moving && !sleepers[i] && away < 2.5 / 64.0;
            assert!(
                !(moving && sleepers[i] && away < 1.5 / 64.0),
                "the grain touches a sleeper"
            );
        }
    }
    assert!(landed, "the grain has woken the heap");
    assert!(woken < 0.3, "a grain woke {woken} of the heap");
    assert!(share(&sleepy) > 0.95, "all is at rest again");
    // A tenth of a cell: what sleeps early keeps the rest of its last, slow motion.
    let pairs = positions(&sleepy).into_iter().zip(positions(&awake));
    let error = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / sleepy.count() as f64;
    assert!(
        error.sqrt() < 0.1 / 64.0,
        "sleeping moved the particles by {} m",
        error.sqrt()
    );
}

#[test]
fn a_force_wakes_whom_it_acts_on() {
    let mut solver = heap(Some(SLEEP));
    run(&mut solver, REST + 120);
    assert!(share(&solver) > 0.95);
    let mut force = vec![0.0; 2 * solver.count()];
    // The heap's last particle, at its top right.
    let pushed = solver.count() - 2;
    let before = positions(&solver);
    force[2 * pushed..][..2].copy_from_slice(&[30.0, 60.0]);
    solver.advance(10, Force::Held(&force), |_, _| ()).unwrap();
    let after = positions(&solver);
    assert!(!asleep(&solver)[pushed] && share(&solver) > 0.5);
    assert!((after[2 * pushed] - before[2 * pushed]).abs() > 1.0e-4);
}

#[test]
fn a_moving_obstacle_wakes_what_it_comes_near_to() {
    let contact = Contact {
        kind: ContactKind::Separating,
        friction: None,
    };
    let shape = Shape::Ball {
        center: Vector::<2>::new(0.5, 0.8),
        radius: 0.05,
    };
    let motion = Motion::new(Vector::<2>::new(0.0, -0.6), &[], Vector::<2>::zeros(), None).unwrap();
    let mut settings: SolverSettings<2> = settings(64, vec![sand()]);
    settings.sleep = Some(SLEEP);
    settings.obstacles = vec![Obstacle::new(shape, contact).unwrap().moving(motion)];
    let bodies = Bodies::default().block(64, [0.3, 0.1], [0.7, 0.3], [0.0; 2], 0);
    let mut solver = bodies.solver(settings);
    // It touches the heap's top after 0.45 m, at frame 300.
    run(&mut solver, 270);
    let settled = share(&solver);
    run(&mut solver, 60);
    let top = positions(&solver)
        .chunks(2)
        .map(|x| x[1])
        .fold(0.0, f32::max);
    assert!(
        settled > 0.1 && share(&solver) < settled,
        "{settled} {}",
        share(&solver)
    );
    for x in positions(&solver).chunks(2) {
        let center = Vector::<2>::new(0.5, 0.8 - 0.6 * 330.0 * FRAME);
        assert!((Vector::<2>::new(x[0], x[1]) - center).norm() > 0.05 - 1.0e-4);
    }
    assert!(top > 0.25);
}

#[test]
fn sleeping_gives_the_same_bits_on_any_threads_and_after_any_restore() {
    let mut whole = heap(Some(SLEEP));
    let mut cuts = Vec::new();
    for _ in 0..REST + 80 {
        run(&mut whole, 1);
        if [61, 130, 202, 247, 263].contains(&whole.frame()) {
            cuts.push(whole.snapshot());
        }
    }
    for (index, cut) in cuts.iter().enumerate() {
        let mut again = heap_on(Some(SLEEP), 1 + index % 3);
        again.restore(cut).unwrap();
        let rest = REST + 80 - again.frame() as usize;
        run(&mut again, rest);
        assert_eq!(again.snapshot(), whole.snapshot(), "cut {index}");
    }
}

#[test]
fn a_space_scene_sleeps_too() {
    let mut settings: SolverSettings<3> = settings(32, vec![sand()]);
    // Single grains at its sides move at up to .06 m/s for long.
    settings.sleep = Some(Sleep {
        speed: 0.1,
        ..SLEEP
    });
    let bodies = Bodies::default().block(32, [0.4, 0.1, 0.4], [0.6, 0.2, 0.6], [0.0; 3], 0);
    let mut solver = bodies.solver(settings);
    run(&mut solver, 300);
    assert!(share(&solver) > 0.9, "{}", share(&solver));
}
