//! Laws of bodies that meet.

use super::common::{Bodies, FRAME, GRAVITY, elastic, run, sand, settings, velocities, water};
use crate::{Contact, ContactKind, Force, Material, Solver, SolverSettings, Vector, Walls};

const SOFT: f32 = 3.0e5;

fn soft() -> Material {
    Material::elastic(1000.0, SOFT, 0.2, 0.5).unwrap()
}

/// A box without gravity whose walls are far from the middle.
fn weightless<const D: usize>(
    resolution: usize,
    materials: Vec<Material>,
    contact_friction: Option<f32>,
) -> SolverSettings<D> {
    let contact = Contact {
        kind: ContactKind::Separating,
        friction: None,
    };
    SolverSettings {
        gravity: Vector::zeros(),
        walls: Walls::uniform(Vector::zeros(), Vector::from_element(1.0), contact),
        contact_friction,
        ..settings(resolution, materials)
    }
}

/// Mean velocity of each body.
fn body_velocities<const D: usize>(solver: &Solver<D>, bodies: &Bodies) -> Vec<Vector<D>> {
    let v = velocities(solver);
    let count = bodies.body.iter().max().map_or(0, |last| last + 1);
    let mean = |body: u32| {
        let rows = v.chunks(D).zip(&bodies.body);
        let mine: Vec<_> = rows.filter(|(_, of)| **of == body).collect();
        let sum = (mine.iter()).fold(Vector::<D>::zeros(), |sum, (v, _)| {
            sum + Vector::from_column_slice(v)
        });
        sum / mine.len() as f32
    };
    (0..count).map(mean).collect()
}

fn energy<const D: usize>(solver: &Solver<D>) -> f64 {
    let d = solver.diagnostics();
    d.kinetic_energy + d.potential_energy + d.elastic_energy
}

/// Parting over closing speed of two balls of one material that meet at 1 m/s, seen from something that moves.
fn rebound<const D: usize>(resolution: usize, frame_speed: f32) -> f32 {
    let ball = |at: f32, speed: f32| {
        let mut center = [0.5; D];
        center[0] = at - 0.125 * frame_speed;
        let mut velocity = [0.0; D];
        velocity[0] = speed + frame_speed;
        (center, velocity)
    };
    let (one, other) = (ball(0.4, 0.5), ball(0.6, -0.5));
    let bodies = Bodies::default()
        .ball(resolution, one.0, 0.08, one.1, 0)
        .ball(resolution, other.0, 0.08, other.1, 0);
    let mut solver = bodies.solver(weightless::<D>(resolution, vec![soft()], None));
    let start = solver.diagnostics();
    let before = energy(&solver);
    let mut most = before;
    solver
        .advance(100, Force::None, |_, s| most = most.max(energy(s)))
        .unwrap();
    assert!(most <= before * 1.0001, "{before} J grew to {most} J");
    let end = solver.diagnostics();
    for axis in 0..D {
        let change = (end.momentum[axis] - start.momentum[axis]).abs();
        assert!(change < 1.0e-5 * start.mass, "momentum changed by {change}");
    }
    let v = body_velocities(&solver, &bodies);
    v[1][0] - v[0][0]
}

#[test]
fn discs_part_as_fast_in_every_frame_of_reference() {
    for (resolution, least) in [(64, 0.85), (128, 0.92)] {
        for frame_speed in [0.0, 0.1, 0.3, 1.0] {
            let parted = rebound::<2>(resolution, frame_speed);
            assert!(
                (least..=1.0).contains(&parted),
                "{parted} at {frame_speed} m/s, {resolution} cells"
            );
        }
    }
}

#[test]
fn balls_part_as_fast_as_discs() {
    let parted = rebound::<3>(64, 0.3);
    assert!((0.85..=1.0).contains(&parted), "{parted}");
}

#[test]
fn nothing_holds_bodies_together() {
    // They touch at the start; elastic on elastic, on sand and on water.
    for below in [soft(), sand(), water()] {
        let bodies = Bodies::default()
            .block(64, [0.4, 0.35], [0.6, 0.5], [0.0, 0.0], 0)
            .block(64, [0.4, 0.5], [0.6, 0.65], [0.0, 0.5], 1);
        let materials = vec![below, soft()];
        let mut solver = bodies.solver(weightless::<2>(64, materials, None));
        run(&mut solver, 40);
        let v = body_velocities(&solver, &bodies);
        assert!((v[1][1] - 0.5).abs() < 0.01, "{v:?}");
        assert!(v[0][1].abs() < 0.01, "{v:?}");
    }
}

#[test]
fn a_block_on_a_block_is_braked_by_friction() {
    let stiff = || Material::elastic(1000.0, 1.0e6, 0.2, 10.0).unwrap();
    for mu in [0.0, 0.2, 0.5] {
        let bodies = Bodies::default()
            .block(64, [0.1, 0.1], [0.9, 0.2], [0.0, 0.0], 0)
            .block(64, [0.2, 0.2], [0.4, 0.3], [0.0, 0.0], 0);
        let mut settings = settings::<2>(64, vec![stiff()]);
        settings.contact_friction = Some(mu);
        let mut solver = bodies.solver(settings);
        // A third of a second at rest, and then a push.
        run(&mut solver, 130);
        let push: Vec<f32> = (bodies.body.iter())
            .flat_map(|&body| [if body == 1 { 1.0 / FRAME } else { 0.0 }, 0.0])
            .collect();
        solver.advance(1, Force::Held(&push), |_, _| ()).unwrap();
        // The push makes the blocks hop for a while.
        run(&mut solver, 20);
        let before = body_velocities(&solver, &bodies)[1][0];
        run(&mut solver, 40);
        let braked = (before - body_velocities(&solver, &bodies)[1][0]) / (40.0 * FRAME);
        assert!(
            (braked - mu * GRAVITY).abs() < 0.1 * mu * GRAVITY + 0.3,
            "{braked} m/s2 at mu {mu}"
        );
    }
}

/// Balls of two materials that fall on each other and on a pool of two fluids of different density.
fn heap<const D: usize>(resolution: usize) -> (Bodies, SolverSettings<D>) {
    let place = |x: f32, y: f32| {
        let mut place = [0.5; D];
        (place[0], place[1]) = (x, y);
        place
    };
    let corner = |x: f32, y: f32, z: f32| {
        let mut corner = [z; D];
        (corner[0], corner[1]) = (x, y);
        corner
    };
    let mut down = [0.0; D];
    down[1] = -2.0;
    let r = 6.5 / (D as f32 - 0.5) / resolution as f32;
    let bodies = Bodies::default()
        .block(
            resolution,
            corner(0.1, 0.1, 0.3),
            corner(0.5, 0.25, 0.7),
            [0.0; D],
            0,
        )
        .block(
            resolution,
            corner(0.5, 0.1, 0.3),
            corner(0.9, 0.25, 0.7),
            [0.0; D],
            1,
        )
        .ball(resolution, place(0.5, 0.26 + r), r, down, 2)
        .ball(resolution, place(0.52, 0.27 + 3.0 * r), r, down, 2)
        .ball(resolution, place(0.49, 0.28 + 5.0 * r), r, down, 3);
    let heavy = Material::sand(1600.0, 1.0e6, 0.2, 35.0, 0.4, true).unwrap();
    let materials = vec![water(), heavy, elastic(), soft()];
    (bodies, settings(resolution, materials))
}

fn check_threads<const D: usize>(resolution: usize, frames: usize) {
    let (bodies, settings) = heap::<D>(resolution);
    let result = |threads| {
        let settings = SolverSettings {
            threads,
            ..settings.clone()
        };
        let mut solver = bodies.solver(settings);
        run(&mut solver, frames);
        solver.snapshot()
    };
    let once = result(1);
    assert!(once == result(2), "two threads differ from one");
    assert!(once == result(4), "four threads differ from one");
    let mut solver = bodies.solver(settings.clone());
    run(&mut solver, frames / 2);
    let half = solver.snapshot();
    let mut twin = bodies.solver(settings);
    twin.restore(&half).unwrap();
    run(&mut twin, frames - frames / 2);
    assert!(once == twin.snapshot(), "a restored solver differs");
}

#[test]
fn contact_gives_the_same_bits_on_all_threads_and_from_snapshots() {
    check_threads::<2>(96, 30);
    check_threads::<3>(32, 10);
}

#[test]
fn bodies_that_do_not_touch_move_as_if_they_were_one() {
    // Two columns that are pressed by their weight, four cells apart, within one chunk of nodes; both on the floor.
    let bodies = Bodies::default()
        .block(64, [0.2, 0.1], [0.4, 0.35], [0.1, -0.3], 0)
        .block(64, [0.47, 0.1], [0.6, 0.3], [0.0, -0.2], 0)
        .block(64, [0.2, 0.42], [0.4, 0.5], [0.0, 0.0], 0);
    let mut settings = settings::<2>(64, vec![elastic()]);
    settings.gravity = Vector::<2>::new(0.3, -1.0);
    let mut apart = bodies.solver(settings.clone());
    let as_one = Bodies {
        body: vec![0; bodies.body.len()],
        ..bodies.clone()
    };
    let mut as_one = as_one.solver(settings);
    run(&mut apart, 20);
    run(&mut as_one, 20);
    let bits = |solver: &Solver<2>| {
        let numbers = [super::common::positions(solver), velocities(solver)].concat();
        numbers.iter().map(|s| s.to_bits()).collect::<Vec<_>>()
    };
    assert!(bits(&apart) == bits(&as_one));
}
