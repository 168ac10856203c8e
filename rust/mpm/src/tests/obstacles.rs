//! Obstacles act where their surface is.

use super::common::{
    BULK_MODULUS, Bodies, FRAME, GRAVITY, elastic, positions, run, settings, velocities, water,
};
use crate::{
    Contact, ContactKind, Force, Material, Motion, Obstacle, Shape, Solver, SolverSettings,
    Surface, Vector, Walls,
};

fn obstacle<const D: usize>(shape: Shape<D>, friction: f32) -> Obstacle<D> {
    let contact = Contact {
        kind: ContactKind::Separating,
        friction: Some(friction),
    };
    Obstacle::new(shape, contact).unwrap()
}

/// A box as a polygon or a mesh.
fn box_of_facets<const D: usize>(lower: &Vector<D>, upper: &Vector<D>) -> Shape<D> {
    let corner = |code: usize| {
        let high = |axis: usize| code >> axis & 1 == 1;
        Vector::from_fn(|axis, _| if high(axis) { upper[axis] } else { lower[axis] })
    };
    let surface = if D == 2 {
        Surface::outline(&[0, 1, 3, 2].map(corner))
    } else {
        let faces = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let triangles = faces
            .iter()
            .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
        Surface::mesh((0..8).map(corner).collect(), triangles.collect())
    };
    Shape::Surface(surface.unwrap())
}

fn bits<const D: usize>(solver: &Solver<D>) -> Vec<u32> {
    let numbers = [positions(solver), velocities(solver)].concat();
    numbers.iter().map(|s| s.to_bits()).collect()
}

#[test]
fn a_hydrostatic_tank_stays_at_rest_on_obstacles() {
    // On a floor within the cell at several places, and between a box and a wall.
    for place in [0.0, 0.3, 0.5, 0.8] {
        let (floor, side, depth) = (0.2 + place / 64.0, 0.5 + place / 64.0, 0.1);
        let mut bodies =
            Bodies::default().block(64, [side, floor], [0.9, floor + depth], [0.0; 2], 0);
        for (ratio, x) in bodies.volume_ratio.iter_mut().zip(bodies.x.chunks(2)) {
            *ratio = 1.0 - 1000.0 * GRAVITY * (floor + depth - x[1]) / BULK_MODULUS;
        }
        let floor_and_box = vec![
            obstacle(
                Shape::HalfSpace {
                    point: Vector::<2>::new(0.5, floor),
                    normal: Vector::<2>::new(0.0, 1.0),
                },
                0.0,
            ),
            obstacle(
                Shape::Box {
                    lower: Vector::<2>::new(0.3, 0.1),
                    upper: Vector::<2>::new(side, 0.6),
                },
                0.0,
            ),
        ];
        // The same as one polygon, with a concave corner, that ends on two walls.
        let corners = [
            [0.3, 0.1],
            [0.9, 0.1],
            [0.9, floor],
            [side, floor],
            [side, 0.6],
            [0.3, 0.6],
        ];
        let step = Surface::outline(&corners.map(Vector::<2>::from)).unwrap();
        let step = vec![obstacle(Shape::Surface(step), 0.0)];
        let fastest = |solids: &[Obstacle<2>]| {
            let mut settings = settings::<2>(64, vec![water()]);
            if solids.is_empty() {
                settings.walls.lower = Vector::<2>::new(side, floor);
            }
            settings.obstacles = solids.to_vec();
            let mut solver = bodies.solver(settings);
            let before = solver.diagnostics().centroid;
            let mut fastest = 0.0f64;
            solver
                .advance(400, Force::None, |_, s| {
                    fastest = fastest.max(s.diagnostics().max_speed);
                })
                .unwrap();
            let after = solver.diagnostics().centroid;
            for axis in 0..2 {
                let moved = (after[axis] - before[axis]).abs();
                assert!(moved < 5.0e-4, "moved by {moved} m at {place}");
            }
            fastest
        };
        let walls = fastest(&[]);
        for solids in [floor_and_box, step] {
            let obstacles = fastest(&solids);
            assert!(
                obstacles < 1.1 * walls + 0.005,
                "{obstacles} m/s for {walls} m/s between walls at {place}"
            );
        }
    }
}

#[test]
fn a_thin_shelf_lets_nothing_through() {
    for (thickness, speed) in [(0.5, 20.0), (1.0, 20.0), (0.5, 3.0)] {
        let top = 0.405;
        let bodies = Bodies::default().block(64, [0.4, 0.5], [0.6, 0.6], [0.0, -speed], 0);
        let mut settings = settings::<2>(64, vec![water()]);
        let lower = Vector::<2>::new(0.05, top - thickness / 64.0);
        let upper = Vector::<2>::new(0.95, top);
        for shelf in [Shape::Box { lower, upper }, box_of_facets(&lower, &upper)] {
            settings.obstacles = vec![obstacle(shelf, 0.0)];
            let mut solver = bodies.solver(settings.clone());
            run(&mut solver, 60);
            let positions = positions(&solver);
            let through = |x: &&[f32]| x[1] < top - 1.0e-4;
            let below = positions.chunks(2).filter(through).count();
            assert!(below == 0, "{below} below {thickness} cells at {speed} m/s");
        }
    }
}

/// Path of a disc that rolls down a slope of 20 degrees, over that of a rigid one, with the floor at some height.
fn path(obstacle_floor: bool, floor: f32) -> f32 {
    let (angle, radius, start) = (20.0f32.to_radians(), 0.06, 0.15);
    let bodies = Bodies::default().ball(128, [start, floor + radius], radius, [0.0, 0.0], 0);
    let stiff = Material::elastic(1000.0, 2.0e6, 0.3, 1.0).unwrap();
    let mut settings: SolverSettings<2> = settings(128, vec![stiff]);
    settings.gravity = Vector::<2>::new(angle.sin(), -angle.cos()) * GRAVITY;
    let (lower, upper) = (Vector::<2>::new(0.05, 0.05), Vector::<2>::new(0.95, 0.95));
    let contact = settings.walls.contacts[0][0];
    settings.walls = Walls::uniform(lower, upper, contact);
    if obstacle_floor {
        let shape = Shape::HalfSpace {
            point: Vector::<2>::new(0.5, floor),
            normal: Vector::<2>::new(0.0, 1.0),
        };
        settings.obstacles = vec![obstacle(shape, 1.0)];
    } else {
        settings.walls.lower[1] = floor;
    }
    let mut solver = bodies.solver(settings);
    let before = solver.diagnostics().centroid[0];
    run(&mut solver, 160);
    let t = 160.0 * FRAME;
    let rigid = GRAVITY * angle.sin() * t * t / 3.0;
    (solver.diagnostics().centroid[0] - before) as f32 / rigid
}

#[test]
fn a_disc_rolls_down_walls_and_obstacles() {
    // Between nodes, and as near below some as counts as on them.
    for floor in [0.1043, (14.0 - 5.0e-4) / 128.0] {
        let (wall, half_space) = (path(false, floor), path(true, floor));
        assert!((0.85..1.02).contains(&wall), "{wall} on {floor}");
        assert!(
            (0.85..1.02).contains(&half_space),
            "{half_space} on {floor}"
        );
    }
}

/// Water and a jelly between a post, a ball and a paddle that turns.
fn stirred<const D: usize>(resolution: usize) -> (Bodies, SolverSettings<D>) {
    let corner = |x: f32, y: f32, z: f32| {
        let mut corner = [z; D];
        (corner[0], corner[1]) = (x, y);
        corner
    };
    let point = |x: f32, y: f32, z: f32| Vector::<D>::from_column_slice(&corner(x, y, z));
    let bodies = Bodies::default()
        .block(
            resolution,
            corner(0.1, 0.1, 0.3),
            corner(0.45, 0.3, 0.7),
            [0.0; D],
            0,
        )
        .block(
            resolution,
            corner(0.5, 0.4, 0.4),
            corner(0.7, 0.55, 0.6),
            [-1.0; D],
            1,
        );
    let mut settings = settings::<D>(resolution, vec![water(), elastic()]);
    let center = point(0.3, 0.3, 0.5);
    let turn: &[f32] = if D == 2 { &[4.0] } else { &[0.0, 0.0, 4.0] };
    let motion = Motion::new(Vector::zeros(), turn, center, None).unwrap();
    let paddle = box_of_facets(&point(0.2, 0.28, 0.4), &point(0.4, 0.32, 0.6));
    let post = box_of_facets(&point(0.463, 0.1, 0.0), &point(0.481, 0.25, 1.0));
    let ball = Shape::Ball {
        center: point(0.6, 0.25, 0.5),
        radius: 0.08,
    };
    settings.obstacles = vec![
        obstacle(paddle, 0.2).moving(motion),
        obstacle(post, 0.2),
        obstacle(ball, 0.2),
    ];
    (bodies, settings)
}

fn check_threads<const D: usize>(resolution: usize, frames: usize) {
    let (bodies, settings) = stirred::<D>(resolution);
    let result = |threads| {
        let settings = SolverSettings {
            threads,
            ..settings.clone()
        };
        let mut solver = bodies.solver(settings);
        run(&mut solver, frames);
        bits(&solver)
    };
    let once = result(1);
    assert!(once == result(2), "two threads differ from one");
    assert!(once == result(4), "four threads differ from one");
}

#[test]
fn obstacles_give_the_same_bits_on_all_threads() {
    check_threads::<2>(96, 40);
    check_threads::<3>(32, 10);
}

/// A funnel without an outlet, of one polygon half a cell thick.
#[test]
fn a_funnel_of_a_polygon_lets_nothing_through() {
    let wall = 0.5 * std::f32::consts::SQRT_2 / 64.0;
    let corners = [
        [0.2, 0.7],
        [0.5, 0.4],
        [0.8, 0.7],
        [0.8, 0.7 + wall],
        [0.5, 0.4 + wall],
        [0.2, 0.7 + wall],
    ];
    let funnel = Surface::outline(&corners.map(Vector::<2>::from)).unwrap();
    let bodies = Bodies::default().block(64, [0.4, 0.6], [0.6, 0.75], [0.0, -20.0], 0);
    let mut settings = settings::<2>(64, vec![water()]);
    settings.obstacles = vec![obstacle(Shape::Surface(funnel), 0.0)];
    let mut solver = bodies.solver(settings);
    let (mut passed, mut held) = (0, 0);
    solver
        .advance(20, Force::None, |_, s| {
            for x in positions(s).chunks(2) {
                let beside = (x[0] - 0.5).abs();
                let lower_face = 0.4 + beside;
                passed += usize::from(beside < 0.2 && x[1] < lower_face + wall - 1.0e-4);
                held += usize::from(beside < 0.2 && x[1] < lower_face + wall + 0.1);
            }
        })
        .unwrap();
    assert!(passed == 0 && held > 5000, "{passed} passed of {held}");
}
