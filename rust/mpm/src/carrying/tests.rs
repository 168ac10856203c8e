use super::block::{Carried, blocks, particles};
use super::density::Crowding;
use super::field::{Field, Mover};
use super::gather::{move_along, take_velocities};
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

/// Particles at places that look random, in [low, low + side)^D.
fn scattered<const D: usize>(count: usize, low: f32, side: f32) -> Vec<Carried<D>> {
    let part = |k: usize, factor: f32| (k as f32 * factor).fract();
    (0..count)
        .map(|k| Carried {
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

fn movers<const D: usize>(matrix: Matrix<D>) -> Vec<Mover<D>> {
    let all = scattered::<D>(400, 0.3, 0.4);
    all.iter()
        .map(|p| Mover {
            x: p.x,
            shift: Vector::from_element(0.01) + matrix * (p.x - Vector::from_element(0.5)),
            gradient: matrix,
            mass: p.mass,
        })
        .collect()
}

fn check_affine<const D: usize>() {
    let matrix = Matrix::<D>::from_fn(|row, column| 0.02 * (row as f32 - 0.7 * column as f32));
    let mut field = Field::new(RESOLUTION);
    let (team, gravity) = (Team::new(1).unwrap(), Vector::zeros());
    let start = scattered::<D>(100, 0.4, 0.2);
    // The second time nothing may be left over from the first.
    for matrix in [matrix, -matrix] {
        field.spread(&movers(matrix));
        let mut carried = blocks(&start);
        move_along(&mut carried, &field, &gravity, 0.01, &team);
        for (before, after) in start.iter().zip(particles(&carried, 100)) {
            let shift =
                Vector::from_element(0.01) + matrix * (before.x - Vector::from_element(0.5));
            assert!((after.x - before.x - shift).norm() < 1.0e-5);
            assert!((after.v - shift / 0.01).norm() < 1.0e-3);
        }
    }
}

#[test]
fn an_affine_motion_is_carried_exactly() {
    check_affine::<2>();
    check_affine::<3>();
}

#[test]
fn what_nothing_carries_flies_on() {
    let mut field = Field::<2>::new(RESOLUTION);
    field.spread(&movers(Matrix::zeros()));
    let (team, gravity) = (Team::new(1).unwrap(), Vector::<2>::new(0.0, -10.0));
    let mut far = blocks(&scattered::<2>(20, 0.8, 0.02));
    let before = far[0].position(3);
    move_along(&mut far, &field, &gravity, 0.1, &team);
    let (moved, v) = (far[0].position(3) - before, far[0].velocity(3));
    assert!((moved - Vector::<2>::new(0.05, 0.05 - 0.05)).norm() < 1.0e-6);
    assert!((v - Vector::<2>::new(0.5, 0.5 - 1.0)).norm() < 1.0e-6);
    take_velocities(&mut far, &field, &team);
    assert_eq!(far[0].velocity(3), v);
}

fn crowded<const D: usize>(particles: &[Carried<D>], threads: usize) -> Vec<Carried<D>> {
    let layout = Layout::<D>::new(RESOLUTION);
    let walls = walls();
    let none = Obstacles::new(Vec::new(), &walls, &layout);
    let team = Team::new(threads).unwrap();
    let mut crowding = Crowding::new(layout, 2.0, &walls, &none, threads);
    let mut carried = blocks(particles);
    for _ in 0..3 {
        crowding.relax(&mut carried, &team);
    }
    super::block::particles(&carried, particles.len())
}

fn check_parting<const D: usize>() {
    // About three times rest density in a cube of four cells.
    let dense = scattered::<D>(12 * 4usize.pow(D as u32), 0.5 - 2.0 * DX, 4.0 * DX);
    let after = crowded(&dense, 1);
    let spread = |all: &[Carried<D>]| {
        let from_middle = |p: &Carried<D>| (p.x - Vector::from_element(0.5)).norm_squared();
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
    let apart = crowded(&loose, 1);
    assert!(loose.iter().zip(&apart).all(|(a, b)| a.x == b.x));
}

#[test]
fn the_dense_part_and_the_loose_stay() {
    check_parting::<2>();
    check_parting::<3>();
}

#[test]
fn only_what_is_crowded_asks_for_another_pass() {
    // Four particles a cell are rest: three times that, one and a half of it, and itself.
    for (per_cell, again) in [(12, true), (6, true), (4, false)] {
        let layout = Layout::<2>::new(RESOLUTION);
        let (walls, team) = (walls(), Team::new(1).unwrap());
        let none = Obstacles::new(Vec::new(), &walls, &layout);
        let mut crowding = Crowding::new(layout, 2.0, &walls, &none, 1);
        let side = 8.0 * DX;
        let mut carried = blocks(&scattered::<2>(64 * per_cell, 0.5 - 0.5 * side, side));
        assert_eq!(crowding.relax(&mut carried, &team), again, "{per_cell}");
        // Passes end: what is crowded has parted after some.
        let passes = (0..60).take_while(|_| crowding.relax(&mut carried, &team));
        assert!(passes.count() < 60, "{per_cell}");
    }
}

#[test]
fn at_a_wall_half_of_the_room_is_full_twice_as_soon() {
    // Rest density from the wall on, jittered by nothing: four particles a cell.
    let place = |k: usize| 0.1 + 0.5 * DX * (k as f32 + 0.5);
    let lattice = |squeeze: f32| -> Vec<_> {
        (0..400)
            .map(|k| Carried {
                x: Vector::<2>::new(0.4 + place(k % 20), 0.1 + squeeze * (place(k / 20) - 0.1)),
                v: Vector::zeros(),
                mass: 1.0,
                volume: 0.25,
                material: 0,
            })
            .collect()
    };
    let lowest = |all: &[Carried<2>]| all[8..12].iter().map(|p| p.x[1]).sum::<f32>() / 4.0;
    let (rest, squeezed) = (lattice(1.0), lattice(0.6));
    assert!((lowest(&crowded(&rest, 1)) - lowest(&rest)).abs() < 0.1 * DX);
    assert!(lowest(&crowded(&squeezed, 1)) < lowest(&squeezed));
}

#[test]
fn bits_depend_neither_on_threads_nor_on_instructions() {
    let dense = scattered::<3>(900, 0.4, 0.15);
    let mut results = Vec::new();
    for set in Instructions::ALL.into_iter().filter(|set| set.available()) {
        set.limit();
        for threads in [1, 2, 3] {
            let mut field = Field::<3>::new(RESOLUTION);
            field.spread(&movers(Matrix::from_element(0.03)));
            let team = Team::new(threads).unwrap();
            let mut carried = blocks(&dense);
            move_along(
                &mut carried,
                &field,
                &Vector::from_element(-1.0),
                0.01,
                &team,
            );
            let moved = crowded(&particles(&carried, dense.len()), threads);
            let bits = |p: &Carried<3>| (p.x.map(f32::to_bits), p.v.map(f32::to_bits));
            results.push(moved.iter().map(bits).collect::<Vec<_>>());
        }
    }
    assert!(results.iter().all(|other| *other == results[0]));
}
