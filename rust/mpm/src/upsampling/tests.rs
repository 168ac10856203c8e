use super::block::{Shown, blocks, particles};
use super::density::Relaxation;
use super::field::{Field, Sample};
use super::interpolation::{advect, interpolate_velocities};
use crate::boundary::{Contact, ContactKind, Obstacles, Walls};
use crate::grid::Layout;
use crate::linalg::{Instructions, Matrix, Vector};
use threads::Team;

const RESOLUTION: usize = 32;
const DX: f32 = 1.0 / RESOLUTION as f32;

fn walls<const D: usize>() -> Walls<D> {
    let contact = Contact {
        kind: ContactKind::Separating,
        friction: None,
    };
    Walls::uniform(
        Vector::from_element(0.1),
        Vector::from_element(0.9),
        contact,
    )
}

/// Particles at quasi-random positions in [low, low + side)^D.
fn scattered<const D: usize>(count: usize, low: f32, side: f32) -> Vec<Shown<D>> {
    let part = |k: usize, factor: f32| (k as f32 * factor).fract();
    (0..count)
        .map(|k| Shown {
            x: Vector::from_fn(|axis, _| {
                low + side * part(k, [0.618_03, 0.754_88, 0.569_84][axis])
            }),
            v: Vector::from_element(0.5),
            mass: 1.0 + part(k, 0.381_97),
            volume: 0.25,
            material: 0,
        })
        .collect()
}

fn samples<const D: usize>(matrix: Matrix<D>) -> Vec<Sample<D>> {
    let all = scattered::<D>(400, 0.3, 0.4);
    all.iter()
        .map(|p| Sample {
            x: p.x,
            shift: Vector::from_element(0.01) + matrix * (p.x - Vector::from_element(0.5)),
            gradient: matrix,
            mass: p.mass,
        })
        .collect()
}

fn check_affine<const D: usize>() {
    let matrix = Matrix::<D>::from_fn(|row, column| 0.02 * (row as f32 - 0.7 * column as f32));
    let mut field = Field::new(Layout::unit(RESOLUTION));
    let (team, gravity) = (Team::new(1).unwrap(), Vector::zeros());
    let start = scattered::<D>(100, 0.4, 0.2);
    // The second field must not contain the first.
    for matrix in [matrix, -matrix] {
        field.scatter(&samples(matrix));
        let mut shown = Vec::new();
        advect(&blocks(&start), &mut shown, &field, &gravity, 0.01, &team);
        for (before, after) in start.iter().zip(particles(&shown, 100)) {
            let shift =
                Vector::from_element(0.01) + matrix * (before.x - Vector::from_element(0.5));
            assert!((after.x - before.x - shift).norm() < 1.0e-5);
            assert!((after.v - shift / 0.01).norm() < 1.0e-3);
        }
    }
}

#[test]
fn an_affine_motion_is_interpolated_exactly() {
    check_affine::<2>();
    check_affine::<3>();
}

#[test]
fn particles_away_from_coarse_ones_fly_freely() {
    let mut field = Field::<2>::new(Layout::unit(RESOLUTION));
    field.scatter(&samples(Matrix::zeros()));
    let (team, gravity) = (Team::new(1).unwrap(), Vector::<2>::new(0.0, -10.0));
    let (start, mut far) = (blocks(&scattered::<2>(20, 0.8, 0.02)), Vec::new());
    let before = start[0].position(3);
    advect(&start, &mut far, &field, &gravity, 0.1, &team);
    let (moved, v) = (far[0].position(3) - before, far[0].velocity(3));
    assert!((moved - Vector::<2>::new(0.05, 0.05 - 0.05)).norm() < 1.0e-6);
    assert!((v - Vector::<2>::new(0.5, 0.5 - 1.0)).norm() < 1.0e-6);
    interpolate_velocities(&mut far, &field, &team);
    assert_eq!(far[0].velocity(3), v);
}

fn relaxed<const D: usize>(particles: &[Shown<D>], threads: usize) -> Vec<Shown<D>> {
    let layout = Layout::<D>::unit(RESOLUTION);
    let walls = walls();
    let none = Obstacles::new(Vec::new(), &walls, &layout);
    let team = Team::new(threads).unwrap();
    let mut relaxation = Relaxation::new(layout, 2.0, &walls, &none, threads);
    let mut shown = blocks(particles);
    for _ in 0..3 {
        relaxation.relax(&mut shown, &team);
    }
    super::block::particles(&shown, particles.len())
}

fn check_separation<const D: usize>() {
    // About three times rest density in a cube of four cells.
    let dense = scattered::<D>(12 * 4usize.pow(D as u32), 0.5 - 2.0 * DX, 4.0 * DX);
    let after = relaxed(&dense, 1);
    let spread = |all: &[Shown<D>]| {
        let from_middle = |p: &Shown<D>| (p.x - Vector::from_element(0.5)).norm_squared();
        all.iter().map(from_middle).sum::<f32>()
    };
    assert!(spread(&after) > 1.1 * spread(&dense));
    let farthest = dense
        .iter()
        .zip(&after)
        .map(|(a, b)| (a.x - b.x).norm())
        .fold(0.0, f32::max);
    assert!(farthest > 0.25 * DX && farthest < 0.7501 * DX);
    // A tenth of rest density stays as it is.
    let loose = scattered::<D>(4usize.pow(D as u32) / 2, 0.5 - 2.0 * DX, 4.0 * DX);
    let apart = relaxed(&loose, 1);
    assert!(loose.iter().zip(&apart).all(|(a, b)| a.x == b.x));
}

#[test]
fn dense_particles_separate_and_loose_ones_stay() {
    check_separation::<2>();
    check_separation::<3>();
}

#[test]
fn only_dense_matter_needs_another_pass() {
    // Rest is four particles a cell; tested are three times, one and a half times and once that.
    for (per_cell, again) in [(12, true), (6, true), (4, false)] {
        let layout = Layout::<2>::unit(RESOLUTION);
        let (walls, team) = (walls(), Team::new(1).unwrap());
        let none = Obstacles::new(Vec::new(), &walls, &layout);
        let mut relaxation = Relaxation::new(layout, 2.0, &walls, &none, 1);
        let side = 8.0 * DX;
        let mut shown = blocks(&scattered::<2>(64 * per_cell, 0.5 - 0.5 * side, side));
        assert_eq!(relaxation.relax(&mut shown, &team), again, "{per_cell}");
        // The number of passes is finite.
        let passes = (0..60).take_while(|_| relaxation.relax(&mut shown, &team));
        assert!(passes.count() < 60, "{per_cell}");
    }
}

#[test]
fn nodes_at_a_wall_count_their_free_half() {
    // Rest density from the wall on, without jitter: four particles a cell.
    let place = |k: usize| 0.1 + 0.5 * DX * (k as f32 + 0.5);
    let lattice = |squeeze: f32| -> Vec<_> {
        (0..400)
            .map(|k| Shown {
                x: Vector::<2>::new(0.4 + place(k % 20), 0.1 + squeeze * (place(k / 20) - 0.1)),
                v: Vector::zeros(),
                mass: 1.0,
                volume: 0.25,
                material: 0,
            })
            .collect()
    };
    let lowest = |all: &[Shown<2>]| all[8..12].iter().map(|p| p.x[1]).sum::<f32>() / 4.0;
    let (rest, squeezed) = (lattice(1.0), lattice(0.6));
    assert!((lowest(&relaxed(&rest, 1)) - lowest(&rest)).abs() < 0.1 * DX);
    assert!(lowest(&relaxed(&squeezed, 1)) < lowest(&squeezed));
}

#[test]
fn bits_depend_neither_on_threads_nor_on_instructions() {
    let dense = scattered::<3>(900, 0.4, 0.15);
    let mut results = Vec::new();
    for set in Instructions::ALL.into_iter().filter(|set| set.available()) {
        set.limit();
        for threads in [1, 2, 3] {
            let mut field = Field::<3>::new(Layout::unit(RESOLUTION));
            field.scatter(&samples(Matrix::from_element(0.03)));
            let team = Team::new(threads).unwrap();
            let (gravity, mut shown) = (Vector::from_element(-1.0), Vec::new());
            advect(&blocks(&dense), &mut shown, &field, &gravity, 0.01, &team);
            let moved = relaxed(&particles(&shown, dense.len()), threads);
            let bits = |p: &Shown<3>| (p.x.map(f32::to_bits), p.v.map(f32::to_bits));
            results.push(moved.iter().map(bits).collect::<Vec<_>>());
        }
    }
    assert!(results.iter().all(|other| *other == results[0]));
}
