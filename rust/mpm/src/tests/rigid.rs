//! Rigid bodies in a fluid.

use crate::{Pull, RigidBody, Shape, Solver, SolverSettings, Vector};

use super::common::{Bodies, positions, run, settings, water};

fn body<const D: usize>(shape: Shape<D>, density: f32) -> RigidBody<D> {
    RigidBody {
        shape,
        turn: [0.0; 3],
        density,
        velocity: Vector::zeros(),
        spin: [0.0; 3],
        friction: 0.3,
        restitution: 0.0,
    }
}

fn square(center: [f32; 2], half: f32, density: f32) -> RigidBody<2> {
    let center = Vector::<2>::from(center);
    let half = Vector::<2>::new(half, half);
    let shape = Shape::Box {
        lower: center - half,
        upper: center + half,
    };
    body(shape, density)
}

/// A pool with its surface at 0.5, with rigid bodies; what would lie within them is left out.
fn pool(bodies: Vec<RigidBody<2>>, threads: usize) -> Solver<2> {
    let scene = SolverSettings {
        rigid: bodies,
        threads,
        ..settings::<2>(32, vec![water()])
    };
    let block = Bodies::default().block(32, [0.1, 0.1], [0.9, 0.5], [0.0, 0.0], 0);
    let outside = |x: &Vector<2>| {
        let distance = |body: &RigidBody<2>| body.distances([*x].into_iter())[0];
        scene.rigid.iter().all(|body| distance(body) > 0.0)
    };
    block.only(outside).solver(scene)
}

/// Two boxes that lie on each other on the floor, one that floats, and a disc that falls on it.
fn some() -> Vec<RigidBody<2>> {
    let disc = Shape::Ball {
        center: Vector::<2>::new(0.62, 0.75),
        radius: 0.06,
    };
    vec![
        square([0.25, 0.16], 0.06, 2500.0),
        square([0.27, 0.28], 0.06, 2500.0),
        square([0.6, 0.52], 0.1, 300.0),
        body(disc, 700.0),
    ]
}

fn bits(solver: &Solver<2>) -> (Vec<u32>, Vec<[u64; 13]>) {
    let x = positions(solver).iter().map(|s| s.to_bits()).collect();
    (
        x,
        solver.rigid().map(|body| body.map(f64::to_bits)).collect(),
    )
}

#[test]
fn threads_snapshots_and_copies_keep_the_bits() {
    let mut whole = pool(some(), 1);
    run(&mut whole, 60);
    let (snapshot, mut copy) = (whole.snapshot(), whole.clone());
    run(&mut whole, 40);
    for threads in [2, 4] {
        let mut other = pool(some(), threads);
        run(&mut other, 100);
        assert!(bits(&other) == bits(&whole), "{threads} threads");
    }
    run(&mut copy, 40);
    assert!(bits(&copy) == bits(&whole), "a copy");
    let mut restored = pool(some(), 1);
    restored.restore(&snapshot).unwrap();
    run(&mut restored, 40);
    assert!(bits(&restored) == bits(&whole), "a snapshot");
    let mut elsewhere = pool(some()[..3].to_vec(), 1);
    assert!(elsewhere.restore(&snapshot).is_err());
}

#[test]
fn a_body_lighter_than_the_water_that_follows_it_is_stable() {
    // Its mass is a fifth of that of the water in a cell.
    let mut solver = pool(vec![square([0.5, 0.3], 0.05, 20.0)], 1);
    let mut fastest = 0.0f64;
    // It has risen to the surface after 340.
    for _ in 0..400 {
        run(&mut solver, 1);
        let body = solver.rigid().next().unwrap();
        fastest = fastest.max(body[7].hypot(body[8]));
    }
    let body = solver.rigid().next().unwrap();
    assert!(fastest < 0.6 && body[1] > 0.5, "{fastest} {body:?}");
}

#[test]
fn bodies_that_overlap_are_refused() {
    let mut settings = settings::<2>(32, vec![water()]);
    settings.rigid = vec![
        square([0.5, 0.5], 0.1, 300.0),
        square([0.6, 0.5], 0.1, 300.0),
    ];
    let Err(error) = Bodies::default().try_solver(settings) else {
        panic!("accepted");
    };
    assert!(
        error.to_string().contains("rigid[0]: overlaps rigid[1]"),
        "{error}"
    );
}

#[test]
fn a_hand_lifts_what_it_can_and_lets_go() {
    let (light, heavy) = (
        square([0.3, 0.45], 0.05, 500.0),
        square([0.6, 0.16], 0.05, 8000.0),
    );
    let mut solver = pool(vec![light, heavy], 1);
    // The light one weighs 49 N per metre of depth, the other 785.
    for _ in 0..240 {
        for (body, x) in [(0, 0.3), (1, 0.6)] {
            let pull = Pull {
                body,
                grip: Vector::<2>::new(0.0, 0.04),
                target: Vector::<2>::new(x, 0.7),
                reach: 0.1,
                strength: 300.0,
            };
            solver.pull(pull).unwrap();
        }
        run(&mut solver, 1);
    }
    let held: Vec<_> = solver.rigid().collect();
    let sag = 0.1 * 49.0 / 300.0;
    assert!((held[0][1] + 0.04 + sag - 0.7).abs() < 0.01, "{held:?}");
    assert!(held[1][1] < 0.2, "{held:?}");
    // A frame without a pull has none.
    run(&mut solver, 8);
    let fallen = solver.rigid().next().unwrap();
    assert!((fallen[8] + 8.0 * 0.0025 * 9.81).abs() < 0.01, "{fallen:?}");
    let nobody = Pull {
        body: 2,
        grip: Vector::<2>::zeros(),
        target: Vector::<2>::zeros(),
        reach: 0.1,
        strength: 1.0,
    };
    assert!(solver.pull(nobody).is_err());
}
