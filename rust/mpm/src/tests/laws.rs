//! Laws of whole simulations.

use super::common::{
    BULK_MODULUS, Bodies, FRAME, GRAVITY, elastic, liquid, positions, run, sand, settings,
    velocities, water,
};
use crate::{Contact, ContactKind, Force, Material, Obstacle, Shape, Substeps, Vector};

#[test]
fn free_fall_matches_g_t_squared_over_two() {
    for material in [water(), sand(), elastic(), liquid()] {
        let bodies = Bodies::default().block(64, [0.4, 0.6], [0.6, 0.7], [0.5, 0.0], 0);
        let mut solver = bodies.solver(settings::<2>(64, vec![material]));
        run(&mut solver, 60);
        let t = 60.0 * FRAME;
        // Symplectic Euler runs ahead by g t dt / 2.
        let ahead = 0.5 * GRAVITY * t * solver.last_frame().unwrap().smallest_dt;
        for (x, start) in positions(&solver).chunks(2).zip(bodies.x.chunks(2)) {
            assert!((x[0] - start[0] - 0.5 * t).abs() < 2.0e-5);
            let fallen = start[1] - x[1] - ahead;
            assert!(
                (fallen - 0.5 * GRAVITY * t * t).abs() < 2.0e-5,
                "fell {fallen} m"
            );
        }
    }
}

#[test]
fn a_mirrored_scene_gives_the_mirrored_result() {
    for material in [water(), sand()] {
        let side = |mirror: bool| {
            let place = |x: f32| if mirror { 1.0 - x } else { x };
            let (a, b) = (place(0.25), place(0.375));
            let speed = if mirror { -2.0 } else { 2.0 };
            let lower = [a.min(b), 0.15];
            let bodies = Bodies::default().block(64, lower, [a.max(b), 0.35], [speed, -1.0], 0);
            let mut settings = settings::<2>(64, vec![material]);
            let contact = Contact {
                kind: ContactKind::Separating,
                friction: Some(0.3),
            };
            let (start, end) = (
                Vector::<2>::new(place(0.6), 0.1),
                Vector::<2>::new(place(0.8), 0.25),
            );
            let ramp = Shape::Segment {
                start,
                end,
                thickness: 0.05,
            };
            settings.obstacles = vec![Obstacle::new(ramp, contact).unwrap()];
            (bodies.clone(), bodies.solver(settings))
        };
        let ((left_bodies, mut left), (right_bodies, mut right)) = (side(false), side(true));
        run(&mut left, 80);
        run(&mut right, 80);
        let (x, mirrored) = (positions(&left), positions(&right));
        let mut worst = 0.0f32;
        for (i, start) in left_bodies.x.chunks(2).enumerate() {
            let twin = (right_bodies.x.chunks(2)).position(|s| {
                (s[0] + start[0] - 1.0).abs() < 1e-4 && (s[1] - start[1]).abs() < 1e-4
            });
            let twin = twin.expect("every particle has a twin");
            worst = worst.max((x[2 * i] + mirrored[2 * twin] - 1.0).abs());
            worst = worst.max((x[2 * i + 1] - mirrored[2 * twin + 1]).abs());
        }
        // 0.2 s with an impact on floor and ramp; a wall one node off would give dx / 2 = 8e-3.
        assert!(worst < 5.0e-4, "mirror images differ by {worst} m");
    }
}

/// A tank whose water starts with the J that carries its own weight.
fn hydrostatic_tank<const D: usize>(resolution: usize, depth: f32) -> Bodies {
    let (lower, mut upper) = ([0.1; D], [0.9; D]);
    upper[1] = 0.1 + depth;
    let mut bodies = Bodies::default().block(resolution, lower, upper, [0.0; D], 0);
    for (ratio, x) in bodies.volume_ratio.iter_mut().zip(bodies.x.chunks(D)) {
        *ratio = 1.0 - 1000.0 * GRAVITY * (upper[1] - x[1]) / BULK_MODULUS;
    }
    bodies
}

#[test]
fn a_hydrostatic_tank_stays_at_rest() {
    // Walls at 6.4 and 57.6 cells, at 10 and 90, and at 12.8 and 115.2: on nodes and between them.
    for resolution in [64, 100, 128] {
        let mut solver =
            hydrostatic_tank::<2>(resolution, 0.1).solver(settings::<2>(resolution, vec![water()]));
        let mut fastest = 0.0f64;
        solver
            .advance(2000, Force::None, |_, s| {
                fastest = fastest.max(s.diagnostics().max_speed);
            })
            .unwrap();
        let end = solver.diagnostics();
        assert!(fastest < 0.05, "{fastest} m/s at {resolution} cells");
        assert!(
            (end.centroid[1] - 0.15).abs() < 1.0e-3,
            "centroid at {:?}",
            end.centroid
        );
    }
}

#[test]
fn a_hydrostatic_tank_stays_at_rest_in_3d() {
    let mut solver = hydrostatic_tank::<3>(20, 0.2).solver(settings::<3>(20, vec![water()]));
    let mut fastest = 0.0f64;
    solver
        .advance(2000, Force::None, |_, s| {
            fastest = fastest.max(s.diagnostics().max_speed);
        })
        .unwrap();
    assert!(fastest < 0.05, "{fastest} m/s");
}

#[test]
fn water_keeps_its_volume_through_a_splash() {
    // Two columns that fill a quarter of the floor each, twice as high as wide: at rest 0.2 m deep.
    let bodies = Bodies::default()
        .block(64, [0.1, 0.1], [0.3, 0.5], [0.0; 2], 0)
        .block(64, [0.7, 0.1], [0.9, 0.5], [0.0; 2], 0);
    let mut solver = bodies.solver(settings::<2>(64, vec![water()]));
    run(&mut solver, 4000);
    // Waves still run; one second of centroids averages them out.
    let mut depth = 0.0;
    solver
        .advance(400, Force::None, |_, s| {
            depth += 2.0 * (s.diagnostics().centroid[1] - 0.1) / 400.0;
        })
        .unwrap();
    assert!(
        (depth / 0.2 - 1.0).abs() < 0.05,
        "0.2 m of water became {depth} m"
    );
}

#[test]
fn sand_comes_to_rest_and_keeps_its_volume() {
    let bodies = Bodies::default().block(64, [0.4, 0.1], [0.6, 0.3], [0.0, 0.0], 0);
    let mut solver = bodies.solver(settings::<2>(64, vec![sand()]));
    run(&mut solver, 600);
    let end = solver.diagnostics();
    assert!(end.kinetic_energy / end.mass < 1.0e-4, "{end:?}");
    let x = positions(&solver);
    let spread = |low: f32, high: f32| x.chunks(2).filter(|x| x[0] > low && x[0] < high).count();
    // A pile with a slope stands on the column's old place; water would be 0.05 m deep everywhere.
    assert!(
        spread(0.4, 0.6) > x.len() / 2 / 2,
        "{} of {} grains stay",
        spread(0.4, 0.6),
        x.len() / 2
    );
    assert!(spread(0.1, 0.15) == 0 && spread(0.85, 0.9) == 0);
}

#[test]
fn nothing_passes_walls_or_obstacles() {
    let contact = Contact {
        kind: ContactKind::Separating,
        friction: None,
    };
    let shapes = [
        Shape::Ball {
            center: Vector::<2>::new(0.5, 0.3),
            radius: 0.08,
        },
        Shape::Box {
            lower: Vector::<2>::new(0.4, 0.2),
            upper: Vector::<2>::new(0.6, 0.3),
        },
        Shape::Segment {
            start: Vector::<2>::new(0.3, 0.25),
            end: Vector::<2>::new(0.7, 0.35),
            thickness: 0.04,
        },
        Shape::HalfSpace {
            point: Vector::<2>::new(0.5, 0.3),
            normal: Vector::<2>::new(0.6, 0.8),
        },
    ];
    for (shape, material) in shapes
        .iter()
        .flat_map(|shape| [water(), sand(), elastic()].map(|m| (shape.clone(), m)))
    {
        let mut settings = settings::<2>(64, vec![material]);
        settings.obstacles = vec![Obstacle::new(shape.clone(), contact).unwrap()];
        let bodies = Bodies::default().block(64, [0.4, 0.5], [0.6, 0.7], [0.0, -3.0], 0);
        let mut solver = bodies.solver(settings);
        run(&mut solver, 200);
        for x in positions(&solver).chunks(2) {
            let x = Vector::<2>::new(x[0], x[1]);
            assert!(
                x.iter().all(|s| (0.1..=0.9).contains(s)),
                "{x} is past a wall"
            );
            assert!(shape.distance(&x).0 > -1.0e-5, "{x} is inside {shape:?}");
        }
    }
}

#[test]
fn runs_and_thread_counts_give_the_same_bits() {
    let bodies = Bodies::default()
        .block(128, [0.15, 0.2], [0.5, 0.5], [1.0, 0.0], 0)
        .block(128, [0.6, 0.2], [0.8, 0.4], [0.0, 0.0], 1);
    assert!(
        bodies.material.len() > 8192,
        "the parallel path starts above that"
    );
    let result = |threads: usize| {
        let mut settings = settings::<2>(128, vec![water(), liquid()]);
        settings.threads = threads;
        let mut solver = bodies.solver(settings);
        run(&mut solver, 40);
        [positions(&solver), velocities(&solver)]
            .concat()
            .iter()
            .map(|s| s.to_bits())
            .collect::<Vec<_>>()
    };
    let once = result(1);
    assert!(once == result(1), "two runs differ");
    assert!(once == result(2), "two threads differ from one");
    assert!(once == result(3), "three threads differ from one");
}

#[test]
fn total_energy_never_grows() {
    let honey = Material::liquid(1420.0, BULK_MODULUS, [19.0, 0.0, 1.0], 0.25, 10.0, true).unwrap();
    let stiff =
        Material::liquid(1000.0, BULK_MODULUS, [1.0e5, 3.0e3, 1.0], 0.25, 10.0, true).unwrap();
    for material in [water(), sand(), elastic(), liquid(), honey, stiff] {
        let resolution = 64;
        let bodies = Bodies::default().block(resolution, [0.3, 0.3], [0.5, 0.5], [2.0, 1.0], 0);
        let mut solver = bodies.solver(settings::<2>(resolution, vec![material]));
        let energy = |s: &crate::Solver<2>| {
            let d = s.diagnostics();
            d.kinetic_energy + d.potential_energy + d.elastic_energy
        };
        let start = energy(&solver);
        let mut worst = start;
        solver
            .advance(300, Force::None, |_, s| worst = worst.max(energy(s)))
            .unwrap();
        assert!(worst <= start * 1.002, "{start} J grew to {worst} J");
    }
}

#[test]
fn cfl_steps_and_reference_steps_agree_before_the_splash() {
    let centroid = |substeps| {
        let bodies = Bodies::default().block(64, [0.3, 0.2], [0.5, 0.4], [0.0, 0.0], 0);
        let mut settings = settings::<2>(64, vec![water()]);
        settings.substeps = substeps;
        let mut solver = bodies.solver(settings);
        run(&mut solver, 80);
        solver.diagnostics().centroid
    };
    let (a, b) = (centroid(Substeps::Cfl(None)), centroid(Substeps::Reference));
    assert!(
        (a[0] - b[0]).abs() < 2.0e-3 && (a[1] - b[1]).abs() < 2.0e-3,
        "{a:?} {b:?}"
    );
}
