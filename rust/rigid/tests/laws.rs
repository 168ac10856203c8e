//! Laws of rigid bodies, each against its closed form.

use rigid::{
    Body, Facets, Fixed, Geometry, Moving, Placed, Push, Rates, Rotation, State, Vector3, World,
};

const G: f64 = 9.81;
const DT: f64 = 1.5e-4;

fn down() -> Vector3 {
    Vector3::new(0.0, -G, 0.0)
}

fn turn(angle: f64) -> Rotation {
    Rotation::from_axis_angle(&Vector3::z_axis(), angle)
}

fn at(x: Vector3, turn: Rotation) -> Moving {
    Moving {
        placed: Placed { x, turn },
        v: Vector3::zeros(),
        w: Vector3::zeros(),
        support: Rates::NONE,
    }
}

/// Bodies on a plane through the origin that falls to the right at an angle.
struct Slope<const D: usize> {
    world: World<D>,
    state: State,
    fixed: Vec<Fixed>,
}

impl<const D: usize> Slope<D> {
    fn new(angle: f64, bodies: Vec<(Body, Moving)>) -> Self {
        let normal = Vector3::new(angle.sin(), angle.cos(), 0.0);
        let fixed = Fixed::resting(Vector3::zeros(), Rotation::identity());
        Self::onto(&Geometry::HalfSpace { normal }, fixed, bodies)
    }

    /// The same with a plane of many facets, 0.06 m wide.
    fn of_facets(angle: f64, bodies: Vec<(Body, Moving)>) -> Self {
        let fixed = Fixed::resting(Vector3::zeros(), turn(-angle));
        Self::onto(&slab::<D>(), fixed, bodies)
    }

    fn onto(solid: &Geometry, fixed: Fixed, bodies: Vec<(Body, Moving)>) -> Self {
        let (bodies, moving) = bodies.into_iter().unzip();
        Self {
            world: World::new(bodies, std::slice::from_ref(solid)),
            state: State {
                bodies: moving,
                kept: Vec::new(),
            },
            fixed: vec![fixed],
        }
    }

    fn run(&mut self, time: f64) {
        for _ in 0..(time / DT).round() as usize {
            self.step();
        }
    }

    fn step(&mut self) {
        let pushes = vec![Push::NONE; self.state.bodies.len()];
        self.world
            .step(&mut self.state, &self.fixed, &down(), &pushes, DT);
    }

    fn energy(&self) -> f64 {
        let bodies = self.world.bodies.iter().zip(&self.state.bodies);
        let height: f64 = bodies
            .map(|(body, moving)| body.mass.mass * G * moving.placed.x.y)
            .sum();
        self.world.kinetic_energy(&self.state) + height
    }
}

fn square<const D: usize>(half: f64, friction: f64) -> Body {
    let half = Vector3::new(half, half, half);
    Body::new::<D>(Geometry::Box { half }, 500.0, friction, 0.0)
}

/// Builds a slope.
type Ground<const D: usize> = fn(f64, Vec<(Body, Moving)>) -> Slope<D>;

/// A slab below the origin, whose upper side is cut into pieces.
fn slab<const D: usize>() -> Geometry {
    let pieces = 50u32;
    let place = |i: u32, y: f64, z: f64| Vector3::new(0.06 * f64::from(i) - 1.0, y, z);
    let outline = |z: f64| {
        let upper = (0..=pieces).rev().map(move |i| place(i, 0.0, z));
        upper.chain([place(0, -0.3, z), place(pieces, -0.3, z)])
    };
    let count = pieces + 3;
    let sides = (0..count).map(|i| [i, (i + 1) % count]);
    if D == 2 {
        return Geometry::Surface(Facets {
            points: outline(0.0).collect(),
            facets: sides.map(|[a, b]| [a, b, b]).collect(),
        });
    }
    let mut facets: Vec<_> = sides
        .flat_map(|[a, b]| [[a + count, a, b], [a + count, b, b + count]])
        .collect();
    // Both ends, from the lower corners.
    for i in 0..pieces {
        let corner = pieces + 1;
        facets.extend([
            [corner, i + 1, i],
            [corner + count, i + count, i + 1 + count],
        ]);
    }
    let (corner, other) = (pieces + 1, pieces + 2);
    facets.extend([[corner, 0, other], [corner + count, other + count, count]]);
    let points = outline(-0.5).chain(outline(0.5));
    Geometry::Surface(Facets {
        points: points.collect(),
        facets,
    })
}

#[test]
fn bodies_do_not_stumble_over_the_edges_of_a_plane_of_facets() {
    slides::<2>(Slope::of_facets);
    slides::<3>(Slope::of_facets);
    let upright = Rotation::identity();
    rolls::<2>(
        &Geometry::Ball { radius: 0.05 },
        upright,
        0.05,
        0.5,
        Slope::of_facets,
    );
    rolls::<3>(
        &Geometry::Ball { radius: 0.05 },
        upright,
        0.05,
        0.4,
        Slope::of_facets,
    );
}

/// A box on the slope, a length up from the origin along its normal.
fn resting<const D: usize>(angle: f64, half: f64, friction: f64, ground: Ground<D>) -> Slope<D> {
    let up = Vector3::new(angle.sin(), angle.cos(), 0.0) * half;
    ground(
        angle,
        vec![(square::<D>(half, friction), at(up, turn(-angle)))],
    )
}

fn slides<const D: usize>(ground: Ground<D>) {
    let (angle, friction, time) = (30.0f64.to_radians(), 0.2, 0.5);
    let mut slope = resting::<D>(angle, 0.05, friction, ground);
    slope.run(time);
    let path = slope.state.bodies[0].placed.x.norm();
    let exact = 0.5 * G * (angle.sin() - friction * angle.cos()) * time * time;
    assert!((path / exact - 1.0).abs() < 0.02, "{D}: {path} {exact}");
    let mut holds = resting::<D>(angle, 0.05, 0.6, ground);
    let start = holds.state.bodies[0].placed.x;
    holds.run(1.0);
    let moved = (holds.state.bodies[0].placed.x - start).norm();
    assert!(moved < 1.0e-4, "{D}: {moved}");
}

#[test]
fn a_box_slides_by_coulombs_law_or_holds() {
    slides::<2>(Slope::new);
    slides::<3>(Slope::new);
}

fn rolls<const D: usize>(
    geometry: &Geometry,
    turned: Rotation,
    radius: f64,
    inertia: f64,
    ground: Ground<D>,
) {
    for degrees in [5.0f64, 20.0, 30.0] {
        let angle = degrees.to_radians();
        let up = Vector3::new(angle.sin(), angle.cos(), 0.0) * radius;
        let body = Body::new::<D>(geometry.clone(), 500.0, 0.5, 0.0);
        let mut slope = ground(angle, vec![(body, at(up, turned))]);
        slope.run(0.5);
        let path = (slope.state.bodies[0].placed.x - up).norm();
        let exact = 0.5 * G * angle.sin() / (1.0 + inertia) * 0.25;
        assert!(
            (path / exact - 1.0).abs() < 0.02,
            "{D} {degrees}: {path} {exact}"
        );
        let v = slope.state.bodies[0].v.norm();
        let w = slope.state.bodies[0].w.norm();
        assert!((w * radius / v - 1.0).abs() < 0.01, "{w} {v}");
    }
}

#[test]
fn discs_balls_and_cylinders_roll() {
    let upright = Rotation::identity();
    rolls::<2>(
        &Geometry::Ball { radius: 0.05 },
        upright,
        0.05,
        0.5,
        Slope::new,
    );
    rolls::<3>(
        &Geometry::Ball { radius: 0.05 },
        upright,
        0.05,
        0.4,
        Slope::new,
    );
    let cylinder = Geometry::Cylinder {
        radius: 0.05,
        half_length: 0.1,
    };
    let lying = Rotation::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
    rolls::<3>(&cylinder, lying, 0.05, 0.5, Slope::new);
}

fn tips<const D: usize>() {
    // A box of width b and height h tips on a slope steeper than b / h, where it does not slide.
    let half = Vector3::new(0.04, 0.1, 0.04);
    let steepest = (half.x / half.y).atan();
    for (factor, falls) in [(0.98, false), (1.02, true)] {
        let angle = factor * steepest;
        let up = Vector3::new(angle.sin(), angle.cos(), 0.0) * half.y;
        let body = Body::new::<D>(Geometry::Box { half }, 500.0, 2.0, 0.0);
        let mut slope = Slope::<D>::new(angle, vec![(body, at(up, turn(-angle)))]);
        slope.run(3.0);
        let lies = slope.state.bodies[0]
            .placed
            .turn
            .transform_vector(&Vector3::y());
        let normal = Vector3::new(angle.sin(), angle.cos(), 0.0);
        assert_eq!(lies.dot(&normal) < 0.9, falls, "{D} {factor}: {lies}");
    }
}

#[test]
fn a_tall_box_tips_at_its_angle() {
    tips::<2>();
    tips::<3>();
}

fn stands<const D: usize>(time: f64) {
    let half = 0.05;
    let bodies = (0..5).map(|level| {
        let x = Vector3::new(
            0.002 * f64::from(level % 2),
            half * f64::from(2 * level + 1),
            0.0,
        );
        (square::<D>(half, 0.3), at(x, Rotation::identity()))
    });
    let mut stack = Slope::<D>::new(0.0, bodies.collect());
    let start: Vec<_> = stack
        .state
        .bodies
        .iter()
        .map(|body| body.placed.x)
        .collect();
    stack.run(time);
    for (body, start) in stack.state.bodies.iter().zip(start) {
        let moved = (body.placed.x - start).norm();
        assert!(
            moved < 2.0e-4 && body.v.norm() < 1.0e-3,
            "{D}: {moved} {}",
            body.v
        );
    }
}

#[test]
fn five_boxes_stand_on_each_other_for_ten_seconds() {
    stands::<2>(10.0);
    stands::<3>(2.0);
}

#[test]
fn a_ball_bounces_by_its_restitution() {
    let ball = Body::new::<2>(Geometry::Ball { radius: 0.05 }, 500.0, 0.3, 0.8);
    let start = at(Vector3::new(0.0, 0.55, 0.0), Rotation::identity());
    let mut drop = Slope::<2>::new(0.0, vec![(ball, start)]);
    let mut highest = 0.0f64;
    let mut has_bounced = false;
    for _ in 0..(0.9 / DT) as usize {
        drop.step();
        has_bounced |= drop.state.bodies[0].v.y > 0.0;
        if has_bounced {
            highest = highest.max(drop.state.bodies[0].placed.x.y - 0.05);
        }
    }
    assert!((highest / (0.5 * 0.64) - 1.0).abs() < 0.01, "{highest}");
}

/// A heap of all shapes, thrown at each other.
fn heap<const D: usize>(restitution: f64) -> Slope<D> {
    let points: Vec<Vector3> = if D == 2 {
        (0..5)
            .map(|k| {
                0.05 * Vector3::new((1.2 * f64::from(k)).cos(), (1.2 * f64::from(k)).sin(), 0.0)
            })
            .collect()
    } else {
        let corners = [
            [1., 0., 0.],
            [-1., 0.2, 0.],
            [0., 1., 0.1],
            [0., -1., 0.],
            [0., 0., 1.],
            [0.1, 0., -1.],
        ];
        corners.iter().map(|c| 0.05 * Vector3::from(*c)).collect()
    };
    let bodies = (0..12).map(|k| {
        let number = f64::from(k);
        let geometry = match k % 4 {
            0 => Geometry::Ball { radius: 0.04 },
            1 => Geometry::hull::<D>(&points).unwrap().0,
            2 if D == 3 => Geometry::Cylinder {
                radius: 0.04,
                half_length: 0.05,
            },
            _ => Geometry::Box {
                half: Vector3::new(0.05, 0.03, 0.04),
            },
        };
        let x = Vector3::new(
            0.12 * (number % 3.0),
            0.15 + 0.12 * (number / 3.0).floor(),
            0.0,
        );
        let mut moving = at(x, turn(0.3 * number));
        moving.v = Vector3::new(0.5 - 0.1 * number, 0.0, 0.0);
        moving.w = Vector3::new(0.0, 0.0, 3.0);
        (Body::new::<D>(geometry, 500.0, 0.4, restitution), moving)
    });
    Slope::new(0.1, bodies.collect())
}

fn never_gains<const D: usize>() {
    for restitution in [0.0, 0.5, 1.0] {
        let mut heap = heap::<D>(restitution);
        let start = heap.energy();
        let mut lowest = start;
        for step in 0..4000 {
            heap.step();
            let energy = heap.energy();
            assert!(
                energy < lowest + 1.0e-3 * start,
                "{D} {restitution} {step}: {energy} {lowest} {start}"
            );
            lowest = lowest.min(energy);
        }
    }
}

#[test]
fn energy_comes_from_nothing_in_no_heap() {
    never_gains::<2>();
    never_gains::<3>();
}

#[test]
fn a_free_body_keeps_its_energy_and_angular_momentum() {
    let half = Vector3::new(0.1, 0.04, 0.02);
    let body = Body::new::<3>(Geometry::Box { half }, 500.0, 0.3, 0.0);
    let mut moving = at(Vector3::new(0.0, 1.0, 0.0), Rotation::identity());
    // About the middle axis it tumbles.
    moving.w = Vector3::new(0.01, 10.0, 0.0);
    let world = World::<3>::new(vec![body], &[]);
    let mut state = State {
        bodies: vec![moving],
        kept: Vec::new(),
    };
    let momentum = |state: &State| {
        let moving = &state.bodies[0];
        world.bodies[0].mass.inertia(&moving.placed.turn) * moving.w
    };
    let (energy, spin) = (world.kinetic_energy(&state), momentum(&state));
    for _ in 0..20_000 {
        world.step(&mut state, &[], &Vector3::zeros(), &[Push::NONE], DT);
    }
    assert!((world.kinetic_energy(&state) / energy - 1.0).abs() < 1.0e-4);
    assert!((momentum(&state) - spin).norm() < 1.0e-9 * spin.norm());
}

#[test]
fn hulls_have_the_mass_and_inertia_of_the_boxes_that_they_are() {
    let half = Vector3::new(0.1, 0.2, 0.3);
    let corner = |k: usize| {
        let side = |axis: usize| {
            if k >> axis & 1 == 0 {
                -half[axis]
            } else {
                half[axis]
            }
        };
        Vector3::new(side(0) + 0.5, side(1), side(2))
    };
    let points: Vec<Vector3> = (0..8).map(corner).collect();
    let (hull, center) = Geometry::hull::<3>(&points).unwrap();
    assert!((center - Vector3::new(0.5, 0.0, 0.0)).norm() < 1.0e-12);
    let of = |geometry| Body::new::<3>(geometry, 700.0, 0.0, 0.0).mass;
    let (hull, exact) = (of(hull), of(Geometry::Box { half }));
    assert!((hull.mass / exact.mass - 1.0).abs() < 1.0e-12);
    let turn = turn(0.3);
    assert!((hull.inertia(&turn) - exact.inertia(&turn)).norm() < 1.0e-9);
    let (flat, _) = Geometry::hull::<2>(&points[..4]).unwrap();
    let of = |geometry| Body::new::<2>(geometry, 700.0, 0.0, 0.0).mass;
    let (flat, exact) = (of(flat), of(Geometry::Box { half }));
    assert!((flat.mass / exact.mass - 1.0).abs() < 1.0e-12);
    assert!((flat.inertia(&turn) - exact.inertia(&turn)).norm() < 1.0e-9);
    assert!(Geometry::hull::<3>(&points[..4]).is_err());
}
