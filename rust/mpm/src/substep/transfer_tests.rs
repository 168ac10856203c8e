//! Laws of one transfer to the grid and back, on random particles without stress.

use proptest::prelude::*;

use super::grid_update::GridForces;
use super::meeting::Meeting;
use super::p2g::P2gStep;
use super::stages::{Stage, Substep};
use crate::boundary::{
    Bounds, Contact, ContactKind, MaterialFriction, Obstacles, Reactions, WallContact, Walls,
};
use crate::force::FrameForce;
use crate::grid::{Grid, Layout};
use crate::linalg::{Matrix, Vector};
use crate::material::Water;
use crate::particles::{Activity, Group, MaterialGroup, Particle, Sorter, bands};
use threads::Team;

const RESOLUTION: usize = 16;
const DX: f64 = 1.0 / RESOLUTION as f64;

type Set<const D: usize> = Vec<Particle<D, f32>>;

/// Mass, momentum, and the components of angular momentum about the origin.
#[derive(Debug)]
struct Totals {
    mass: f64,
    momentum: Vec<f64>,
    angular: Vec<f64>,
    /// Sums of magnitudes, which rounding is relative to.
    scale: f64,
}

fn totals<const D: usize>(particles: &Set<D>) -> Totals {
    let mut sum = empty::<D>();
    for p in particles {
        let x: Vec<f64> = p.x.iter().map(|&s| f64::from(s)).collect();
        let v: Vec<f64> = p.v.iter().map(|&s| f64::from(s)).collect();
        let affine = p.affine;
        add::<D>(&mut sum, f64::from(p.mass), &x, &v);
        for (index, (i, j)) in pairs(D).into_iter().enumerate() {
            // The affine part of APIC carries m dx^2 / 4 times the vorticity of C.
            let spin = f64::from(affine[(j, i)]) - f64::from(affine[(i, j)]);
            sum.angular[index] += f64::from(p.mass) * DX * DX / 4.0 * spin;
        }
    }
    sum
}

fn grid_totals<const D: usize>(grid: &Grid<D>) -> Totals {
    let mut sum = empty::<D>();
    for (index, node) in grid.nodes.iter().enumerate() {
        let lanes = node.to_array();
        if lanes[3] > 0.0 {
            let mut coordinates = grid.layout.row_coordinates(index / grid.layout.row_length);
            coordinates[D - 1] = index % grid.layout.row_length;
            let x: Vec<f64> = grid
                .layout
                .position(coordinates)
                .iter()
                .map(|&s| f64::from(s))
                .collect();
            let mass = f64::from(lanes[3]);
            let v: Vec<f64> = lanes[..D].iter().map(|&p| f64::from(p) / mass).collect();
            add::<D>(&mut sum, mass, &x, &v);
        }
    }
    sum
}

fn empty<const D: usize>() -> Totals {
    Totals {
        mass: 0.0,
        momentum: vec![0.0; D],
        angular: vec![0.0; pairs(D).len()],
        scale: 0.0,
    }
}

fn pairs(dim: usize) -> Vec<(usize, usize)> {
    if dim == 2 {
        vec![(0, 1)]
    } else {
        vec![(0, 1), (1, 2), (2, 0)]
    }
}

fn add<const D: usize>(sum: &mut Totals, mass: f64, x: &[f64], v: &[f64]) {
    sum.mass += mass;
    sum.scale += mass * v.iter().map(|s| s.abs()).sum::<f64>();
    for axis in 0..D {
        sum.momentum[axis] += mass * v[axis];
    }
    for (index, (i, j)) in pairs(D).into_iter().enumerate() {
        sum.angular[index] += mass * (x[i] * v[j] - x[j] * v[i]);
    }
}

fn assert_equal(before: &Totals, after: &Totals) {
    let close = |a: f64, b: f64, scale: f64| (a - b).abs() <= 1.0e-5 * scale;
    assert!(
        close(before.mass, after.mass, before.mass),
        "{before:?} {after:?}"
    );
    let all = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(&a, &b)| close(a, b, before.scale));
    assert!(
        all(&before.momentum, &after.momentum),
        "{before:?} {after:?}"
    );
    assert!(all(&before.angular, &after.angular), "{before:?} {after:?}");
}

/// Particles after P2G, and after G2P, away from walls, without gravity and in no time.
fn there_and_back<const D: usize>(particles: &Set<D>, keeps: bool) -> (Grid<D>, Set<D>) {
    let contact = Contact {
        kind: ContactKind::Separating,
        friction: None,
    };
    let walls = Walls::uniform(Vector::zeros(), Vector::from_element(1.0), contact);
    let mut grid = Grid::<D>::new(Layout::unit(RESOLUTION), false);
    if keeps {
        grid.keep_old();
    }
    let layout = grid.layout;
    let water = Water {
        bulk_modulus: 1.0e5,
        tension: 1.0,
        volume_correction: true,
    };
    let group = Group::new(water, 0.0, particles);
    let mut groups = vec![MaterialGroup::Water(group)];
    let team = Team::new(1).unwrap();
    let mut sorter = Sorter::default();
    let slabs = sorter.sort(&mut groups, &layout, &[], &team);
    let bands = bands(&slabs, layout.planes());
    grid.activate(&bands, |planes| sorter.places(planes), &team);
    let obstacles = Obstacles::new(Vec::new(), &walls, &layout);
    let substep = Substep {
        step: P2gStep {
            dt: 0.0,
            force: FrameForce::None,
        },
        forces: GridForces {
            gravity: Vector::zeros(),
            walls: &WallContact::new(&walls, &layout),
            obstacles: &obstacles,
            material_friction: MaterialFriction::Uniform(0.0),
            meeting: &Meeting::new(&groups, &[1.0], 1.0, None),
            dt: 0.0,
            bodies: false,
        },
        bounds: &Bounds::new(walls, &Vector::zeros(), &layout),
        transfer_loss: 0.0,
        is_new: true,
    };
    let mut sums = vec![Reactions::none(0, 0); slabs.len()];
    substep.run(
        &[Stage::P2g],
        &mut groups,
        &slabs,
        &mut grid,
        &mut sums,
        &team,
    );
    let momentum = grid.clone();
    let rest = [Stage::GridUpdate, Stage::G2p];
    let outcome = substep.run(&rest, &mut groups, &slabs, &mut grid, &mut sums, &team);
    assert!(outcome.sound);
    let Some(MaterialGroup::Water(group)) = groups.pop() else {
        unreachable!()
    };
    (momentum, group.particles().collect())
}

fn sets<const D: usize>() -> impl Strategy<Value = Set<D>> {
    let numbers = prop::collection::vec(-1.0f32..1.0, 2 * D + D * D + 1);
    prop::collection::vec(numbers, 1..60).prop_map(|rows| {
        rows.iter()
            .enumerate()
            .map(|(id, n)| Particle {
                x: Vector::from_fn(|axis, _| 0.5 + 0.3 * n[axis]),
                v: Vector::from_fn(|axis, _| 3.0 * n[D + axis]),
                affine: Matrix::from_fn(|i, j| 20.0 * n[2 * D + i * D + j]),
                mass: 1.5 + n[2 * D + D * D],
                volume: 1.0e-3,
                id: id as u32,
                calm: 0.0,
                activity: Activity::Awake,
                state: 1.0,
            })
            .collect()
    })
}

fn check_conservation<const D: usize>(particles: &Set<D>) {
    let before = totals(particles);
    let (grid, after) = there_and_back(particles, false);
    assert_equal(&before, &grid_totals(&grid));
    assert_equal(&before, &totals(&after));
}

/// In no time and without forces nothing is lost.
fn check_velocities<const D: usize>(particles: &Set<D>) {
    let (_, mut after) = there_and_back(particles, true);
    after.sort_by_key(|p| p.id);
    for (p, q) in particles.iter().zip(&after) {
        assert!((p.v - q.v).amax() < 1.0e-4, "{p:?} {q:?}");
    }
}

fn check_affine_field<const D: usize>(mut particles: Set<D>, gradient: Matrix<D>) {
    for p in &mut particles {
        (p.v, p.affine) = (gradient * p.x, gradient);
    }
    let (_, after) = there_and_back(&particles, false);
    for p in after {
        assert!(
            (p.v - gradient * p.x).amax() < 2.0e-5 * gradient.amax().max(1.0),
            "{p:?}"
        );
        assert!(
            (p.affine - gradient).amax() < 5.0e-4 * gradient.amax().max(1.0),
            "{p:?}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn transfers_keep_mass_and_both_momenta_2d(set in sets::<2>()) { check_conservation(&set); }

    #[test]
    fn transfers_keep_mass_and_both_momenta_3d(set in sets::<3>()) { check_conservation(&set); }
}

proptest! {
    #[test]
    fn velocities_that_are_kept_are_the_same(plane in sets::<2>(), space in sets::<3>()) {
        check_velocities(&plane);
        check_velocities(&space);
    }

    #[test]
    fn affine_velocity_fields_survive(
        plane in sets::<2>(), space in sets::<3>(), g in prop::collection::vec(-10.0f32..10.0, 9),
    ) {
        check_affine_field(plane, Matrix::<2>::from_row_slice(&g[..4]));
        check_affine_field(space, Matrix::<3>::from_row_slice(&g));
    }
}
