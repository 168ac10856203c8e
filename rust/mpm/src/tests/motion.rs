//! Obstacles in prescribed motion.

use super::common::{
    Bodies, FRAME, GRAVITY, elastic, positions, run, sand, settings, velocities, water,
};
use crate::{
    Contact, ContactKind, Force, Motion, MpmError, Obstacle, Shape, Solver, SolverSettings,
    Substeps, Surface, Swing, Vector,
};

const FREE: Contact = Contact {
    kind: ContactKind::Separating,
    friction: Some(0.0),
};

fn steady<const D: usize>(velocity: [f32; D]) -> Motion<D> {
    Motion::new(Vector::from(velocity), &[], Vector::zeros(), None).unwrap()
}

fn turning(rate: f32, center: [f32; 2]) -> Motion<2> {
    Motion::new(Vector::zeros(), &[rate], Vector::from(center), None).unwrap()
}

fn moving_box<const D: usize>(
    lower: [f32; D],
    upper: [f32; D],
    contact: Contact,
    motion: Motion<D>,
) -> Obstacle<D> {
    let (lower, upper) = (Vector::from(lower), Vector::from(upper));
    let shape = Shape::Box { lower, upper };
    Obstacle::new(shape, contact).unwrap().moving(motion)
}

/// A tank that is half full of water at rest, with one obstacle in it.
fn tank(resolution: usize, lower: f32, obstacle: Obstacle<2>) -> Solver<2> {
    let mut settings = settings::<2>(resolution, vec![water()]);
    settings.obstacles = vec![obstacle];
    Bodies::default()
        .block(resolution, [lower, 0.1], [0.9, 0.35], [0.0, 0.0], 0)
        .solver(settings)
}

#[test]
fn a_piston_lifts_water_and_lets_none_through() {
    // From wall to wall 0.5 m apart, 0.1 m in half a second; then the water stands 5/4 as high.
    let (width, stroke, frames) = (0.5, 0.1, 200);
    let speed = stroke / (frames as f32 * FRAME);
    let piston = moving_box([0.2, 0.05], [0.4, 0.8], FREE, steady([speed, 0.0]));
    let mut solver = tank(64, 0.4, piston);
    for frame in 1..=frames {
        run(&mut solver, 1);
        let face = 0.4 + speed * FRAME * frame as f32;
        for x in positions(&solver).chunks(2) {
            assert!(x[0] > face - 1.0e-5, "{x:?} behind {face} in frame {frame}");
        }
    }
    let centroid = solver.diagnostics().centroid;
    let (middle, height) = (0.7, 0.25 * f64::from(width / (width - stroke)));
    assert!((centroid[0] - middle).abs() < 0.01, "{centroid:?}");
    assert!(
        (centroid[1] - 0.1 - 0.5 * height).abs() < 0.01,
        "{centroid:?}, not {height} high"
    );
}

#[test]
fn a_plate_that_ends_on_walls_lets_nothing_along_them() {
    let (speed, period) = (10.0, 0.125);
    let swing = Some(Swing { period, phase: 0.0 });
    let motion = Motion::new(Vector::from([0.0, speed]), &[], Vector::zeros(), swing).unwrap();
    let [lower, upper] = [[0.1, 0.3], [0.9, 0.3078]].map(Vector::from);
    let corners = [[0, 0], [1, 0], [1, 1], [0, 1]]
        .map(|ends: [usize; 2]| Vector::from_fn(|axis, _| [lower, upper][ends[axis]][axis]));
    let (thickness, middle) = (upper[1] - lower[1], 0.5 * (lower[1] + upper[1]));
    let shapes = [
        Shape::Box { lower, upper },
        Shape::Segment {
            start: Vector::from([lower[0], middle]),
            end: Vector::from([upper[0], middle]),
            thickness,
        },
        Shape::Surface(Surface::outline(&corners).unwrap()),
    ];
    for shape in shapes {
        let plate = Obstacle::new(shape.clone(), FREE).unwrap().moving(motion);
        let mut settings = settings::<2>(64, vec![water()]);
        settings.obstacles = vec![plate];
        let bodies = Bodies::default().block(64, [0.1, 0.3178], [0.9, 0.5], [0.0, 0.0], 0);
        let mut solver = bodies.solver(settings);
        for frame in 1..=60 {
            run(&mut solver, 1);
            let turns = std::f32::consts::TAU * frame as f32 * FRAME / period;
            let face = 0.3 + speed * period / std::f32::consts::TAU * turns.sin();
            for x in positions(&solver).chunks(2) {
                assert!(x[1] > face - 1.0e-5, "{x:?} below {face}: {shape:?}");
            }
        }
    }
}

#[test]
fn an_obstacle_that_moves_with_the_water_does_nothing() {
    let velocity = [0.8, -0.5];
    let drift = |obstacles| {
        let mut settings = settings::<2>(64, vec![water()]);
        settings.gravity = Vector::zeros();
        settings.obstacles = obstacles;
        let bodies = Bodies::default().block(64, [0.4, 0.45], [0.55, 0.65], velocity, 0);
        let mut solver = bodies.solver(settings);
        run(&mut solver, 100);
        (positions(&solver), velocities(&solver))
    };
    let worst = |a: &[f32], b: &[f32]| {
        a.iter()
            .zip(b)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max)
    };
    let (x, v) = drift(vec![]);
    for kind in [
        ContactKind::Sticky,
        ContactKind::Slip,
        ContactKind::Separating,
    ] {
        let contact = Contact {
            kind,
            friction: None,
        };
        // It touches the block's side.
        let beside = moving_box([0.3, 0.5], [0.4, 0.6], contact, steady(velocity));
        let (x_beside, v_beside) = drift(vec![beside]);
        let (shift, change) = (worst(&x, &x_beside), worst(&v, &v_beside));
        // What is left is rounding: a thousand substeps of half an ulp of 0.6 are 3e-5 m.
        assert!(
            shift < 5.0e-5 && change < 1.0e-5,
            "{kind:?}: {shift} m, {change} m/s"
        );
    }
}

/// Angular momentum about a point per mass [m^2/s].
fn angular_momentum(solver: &Solver<2>, center: [f32; 2]) -> f32 {
    let (x, v) = (positions(solver), velocities(solver));
    let arms = x.chunks(2).zip(v.chunks(2));
    let sum: f32 = arms
        .map(|(x, v)| (x[0] - center[0]) * v[1] - (x[1] - center[1]) * v[0])
        .sum();
    sum / solver.count() as f32
}

#[test]
fn a_turning_box_stirs_and_its_mirror_image_stirs_the_other_way() {
    let center = [0.5, 0.5];
    let stir = |rate: f32| {
        let paddle = moving_box([0.35, 0.47], [0.65, 0.53], FREE, turning(rate, center));
        let mut settings = settings::<2>(64, vec![water()]);
        settings.gravity = Vector::zeros();
        settings.obstacles = vec![paddle];
        let bodies = Bodies::default()
            .block(64, [0.1, 0.1], [0.9, 0.46875], [0.0, 0.0], 0)
            .block(64, [0.1, 0.53125], [0.9, 0.9], [0.0, 0.0], 0);
        let mut solver = bodies.solver(settings);
        run(&mut solver, 400);
        solver
    };
    let (left, right) = (stir(4.0), stir(-4.0));
    let (spin, mirrored) = (
        angular_momentum(&left, center),
        angular_momentum(&right, center),
    );
    // What the disc that the paddle sweeps has of it when it turns along: its share of the water times w r^2 / 2.
    assert!(spin > 0.11 * 4.0 * 0.15 * 0.15 / 2.0, "{spin}");
    assert!((spin + mirrored).abs() < 1.0e-3 * spin, "{spin} {mirrored}");
    let totals = left.diagnostics();
    assert!(
        totals.max_speed < 3.0 * 4.0 * 0.15,
        "{} m/s",
        totals.max_speed
    );
}

#[test]
fn a_mirrored_paddle_gives_the_mirrored_splash() {
    let side = |mirror: bool| {
        let sign = if mirror { -1.0 } else { 1.0 };
        let place = |x: f32| if mirror { 1.0 - x } else { x };
        let span = |a: f32, b: f32| (place(a).min(place(b)), place(a).max(place(b)));
        let (lower, upper) = span(0.2, 0.25);
        let swing = Swing {
            period: 0.4,
            phase: 0.25,
        };
        let motion = Motion::new(
            Vector::<2>::new(-0.3 * sign, 0.0),
            &[1.5 * sign],
            Vector::<2>::new(place(0.225), 0.1),
            Some(swing),
        )
        .unwrap();
        let (from, to) = span(0.3, 0.6);
        let bodies = Bodies::default().block(64, [from, 0.1], [to, 0.25], [0.0, 0.0], 0);
        let mut settings = settings::<2>(64, vec![sand()]);
        settings.obstacles = vec![moving_box([lower, 0.05], [upper, 0.5], FREE, motion)];
        let mut solver = bodies.solver(settings);
        run(&mut solver, 100);
        (bodies.x, positions(&solver))
    };
    let ((left_start, left), (right_start, right)) = (side(false), side(true));
    let mut worst = 0.0f32;
    for (start, now) in left_start.chunks(2).zip(left.chunks(2)) {
        let twin = right_start
            .chunks(2)
            .position(|s| (s[0] + start[0] - 1.0).abs() < 1e-4 && (s[1] - start[1]).abs() < 1e-4)
            .expect("every particle has a twin");
        worst = worst.max((now[0] + right[2 * twin] - 1.0).abs());
        worst = worst.max((now[1] - right[2 * twin + 1]).abs());
    }
    let moved = left_start
        .iter()
        .zip(&left)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f32::max);
    assert!(moved > 0.05, "the paddle moved nothing: {moved} m");
    // As for the walls: a geometry one node off would give dx / 2 = 8e-3.
    assert!(worst < 5.0e-4, "mirror images differ by {worst} m");
}

/// A block on a belt whose surface moves, started at rest; its velocity along the belt after a time.
fn on_a_belt(material: crate::Material, friction: f32, belt: f32, frames: usize) -> f64 {
    let shape = Shape::HalfSpace {
        point: Vector::<2>::new(0.5, 0.25),
        normal: Vector::<2>::new(0.0, 1.0),
    };
    let contact = Contact {
        kind: ContactKind::Separating,
        friction: Some(friction),
    };
    let mut settings = settings::<2>(64, vec![material]);
    settings.obstacles = vec![
        Obstacle::new(shape, contact)
            .unwrap()
            .moving(steady([belt, 0.0])),
    ];
    let bodies = Bodies::default().block(64, [0.2, 0.25], [0.4, 0.3125], [0.0, 0.0], 0);
    let mut solver = bodies.solver(settings);
    run(&mut solver, frames);
    let totals = solver.diagnostics();
    totals.momentum[0] / totals.mass
}

#[test]
fn a_belt_drags_by_coulomb_friction_until_the_load_moves_along() {
    // Faster than friction can make it: mu g t. Then at the speed of the belt.
    let frames = 60;
    let friction = f64::from(0.3 * GRAVITY * FRAME) * frames as f64;
    let dragged = on_a_belt(elastic(), 0.3, 2.0, frames);
    assert!(
        (dragged / friction - 1.0).abs() < 0.1,
        "{dragged} m/s, not {friction}"
    );
    for material in [elastic(), sand()] {
        let carried = on_a_belt(material, 0.6, 0.4, 120);
        assert!((carried - 0.4).abs() < 0.04, "{carried} m/s");
    }
    assert!(on_a_belt(elastic(), 0.0, 2.0, frames).abs() < 1e-3);
}

#[test]
fn nothing_gets_into_a_ball_that_ploughs_through_water() {
    let shape = Shape::Ball {
        center: Vector::<3>::new(0.25, 0.3, 0.5),
        radius: 0.1,
    };
    let mut settings = settings::<3>(32, vec![water()]);
    settings.obstacles = vec![
        Obstacle::new(shape, FREE)
            .unwrap()
            .moving(steady([2.0, 0.0, 0.0])),
    ];
    let bodies =
        Bodies::default().block(32, [0.375, 0.1, 0.3], [0.6, 0.5, 0.7], [0.0, 0.0, 0.0], 0);
    let mut solver = bodies.solver(settings.clone());
    for frame in 1..=100 {
        run(&mut solver, 1);
        let time = f64::from(FRAME) * f64::from(frame);
        for x in positions(&solver).chunks(3) {
            let x = Vector::<3>::from_column_slice(x);
            let distance = settings.obstacles[0].at(time).distance(&x);
            assert!(distance > -1.0e-5, "{distance} m inside in frame {frame}");
        }
    }
}

#[test]
fn a_press_that_leaves_no_room_throws_nothing_out_of_the_box() {
    let press = moving_box([0.05, 0.4], [0.95, 0.8], FREE, steady([0.0, -1.0]));
    let mut settings = settings::<2>(64, vec![sand()]);
    settings.obstacles = vec![press];
    let bodies = Bodies::default().block(64, [0.4, 0.1], [0.6, 0.2], [0.0, 0.0], 0);
    let mut solver = bodies.solver(settings);
    run(&mut solver, 160);
    assert!(positions(&solver).iter().all(|s| (0.1..=0.9).contains(s)));
}

/// A scene with every kind of motion.
fn machine() -> (Bodies, SolverSettings<2>) {
    let mut settings = settings::<2>(64, vec![water()]);
    let swing = Swing {
        period: 0.3,
        phase: 0.0,
    };
    let wave = Motion::new(
        Vector::<2>::new(0.5, 0.0),
        &[],
        Vector::zeros(),
        Some(swing),
    );
    settings.obstacles = vec![
        moving_box([0.15, 0.05], [0.2, 0.5], FREE, wave.unwrap()),
        moving_box([0.6, 0.25], [0.8, 0.3], FREE, turning(-6.0, [0.7, 0.275])),
    ];
    let bodies = Bodies::default().block(64, [0.25, 0.1], [0.55, 0.4], [0.0, 0.0], 0);
    (bodies, settings)
}

#[test]
fn a_snapshot_in_the_middle_of_a_motion_goes_on_with_the_same_bits() {
    let (bodies, settings) = machine();
    let mut whole = bodies.solver(settings.clone());
    run(&mut whole, 120);
    for cut in [1, 37, 119] {
        let mut first = bodies.solver(settings.clone());
        run(&mut first, cut);
        // Into a solver whose obstacles are elsewhere, ahead in time.
        let mut second = bodies.solver(settings.clone());
        run(&mut second, 97);
        second.restore(&first.snapshot()).unwrap();
        run(&mut second, 120 - cut);
        assert!(second.snapshot() == whole.snapshot(), "cut at {cut}");
    }
}

#[test]
fn threads_do_not_change_the_result() {
    let (_, mut settings) = machine();
    (settings.resolution, settings.cells) = (128, [128; 2]);
    let bodies = Bodies::default().block(128, [0.25, 0.1], [0.59, 0.5], [0.0, 0.0], 0);
    assert!(
        bodies.material.len() > 8192,
        "the parallel path starts above that"
    );
    let result = |threads| {
        let mut solver = bodies.solver(SolverSettings {
            threads,
            ..settings.clone()
        });
        run(&mut solver, 40);
        solver.snapshot()
    };
    assert!(result(1) == result(2));
}

#[test]
fn substeps_follow_the_speed_of_an_obstacle() {
    let fast = |rate, substeps| {
        let paddle = moving_box([0.3, 0.6], [0.7, 0.63], FREE, turning(rate, [0.5, 0.615]));
        let mut settings = settings::<2>(64, vec![water()]);
        settings.substeps = substeps;
        settings.obstacles = vec![paddle];
        let mut solver = Bodies::default()
            .block(64, [0.4, 0.15], [0.6, 0.3], [0.0, 0.0], 0)
            .solver(settings);
        let result = solver.advance(1, Force::None, |_, _| ());
        result.map(|()| solver.last_frame().unwrap())
    };
    let by_cfl = Substeps::Cfl(None);
    assert_eq!(fast(10.0, by_cfl).unwrap().bound.name(), "sound");
    // Its corners, 0.2006 m from the centre, at 200 m/s.
    let report = fast(1000.0, by_cfl).unwrap();
    assert_eq!(report.bound.name(), "obstacle");
    let travelled = 200.6 * report.smallest_dt * 64.0;
    assert!(
        travelled <= crate::DEFAULT_SPEED_CFL && travelled > 0.9 * crate::DEFAULT_SPEED_CFL,
        "{travelled}"
    );
    assert!(matches!(
        fast(1000.0, Substeps::Reference),
        Err(MpmError::UnstableStep {
            bound: "obstacle",
            ..
        })
    ));
    assert!(matches!(
        fast(1.0e7, by_cfl),
        Err(MpmError::TooFast {
            signal: "obstacles",
            ..
        })
    ));
}

#[test]
fn motions_that_make_no_sense_are_refused() {
    let motion = |velocity: f32, turn: &[f32], period, phase| {
        let swing = Some(Swing { period, phase });
        Motion::new(
            Vector::<2>::new(velocity, 0.0),
            turn,
            Vector::zeros(),
            swing,
        )
        .unwrap_err()
        .to_string()
    };
    assert!(motion(f32::NAN, &[], 1.0, 0.0).contains("finite velocity"));
    assert!(motion(1.0, &[0.0; 3], 1.0, 0.0).contains("one number in 2D and three in 3D"));
    assert!(motion(1.0, &[1.0], 0.0, 0.0).contains("period must be finite and > 0 s"));
    assert!(motion(1.0, &[1.0], 1.0, 1.0).contains("phase must be in [0, 1)"));
}
