//! A start file gives the solver that wrote it, or is refused.

mod common;

use common::{Bodies, elastic, run, sand, settings, water};
use mpm::{Contact, ContactKind, Motion, MpmError, Obstacle, Shape, Solver, Vector};

/// Three materials in mid-splash, around an obstacle that turns.
fn splash<const D: usize>() -> Solver<D> {
    let cell = 1.0 / 32.0;
    let corner = |cells: f32| std::array::from_fn(|axis| cell * (cells + axis as f32));
    let bodies = Bodies::default()
        .block::<D>(32, corner(4.0), corner(8.0), [0.7; D], 0)
        .block::<D>(32, corner(10.0), corner(13.0), [-2.0; D], 1)
        .block::<D>(32, corner(14.0), corner(17.0), [-1.0; D], 2)
        .block::<D>(32, corner(18.0), corner(21.0), [-1.0; D], 2);
    let mut settings = settings::<D>(32, vec![water(), sand(), elastic()]);
    let center = Vector::from_element(0.7);
    let turning = [0.0, 0.0, 3.0];
    let motion = Motion::new(
        Vector::zeros(),
        if D == 2 { &turning[2..] } else { &turning },
        center,
        None,
    );
    let shape = Shape::Box {
        lower: Vector::from_element(0.65),
        upper: Vector::from_element(0.75),
    };
    let contact = Contact {
        kind: ContactKind::Separating,
        friction: Some(0.3),
    };
    let mut obstacle = Obstacle::new(shape, contact).unwrap();
    obstacle.motion = Some(motion.unwrap());
    settings.obstacles.push(obstacle);
    let mut solver = bodies.solver(settings);
    run(&mut solver, 25);
    solver
}

fn check<const D: usize>() {
    let mut solver = splash::<D>();
    let mut again = Solver::<D>::from_start(&solver.start()).unwrap();
    assert_eq!(again.snapshot(), solver.snapshot());
    run(&mut solver, 15);
    run(&mut again, 15);
    assert_eq!(again.snapshot(), solver.snapshot());
}

#[test]
fn a_start_file_goes_on_with_the_same_bits() {
    check::<2>();
    check::<3>();
}

fn refusal<const D: usize>(data: &[u8]) -> String {
    match Solver::<D>::from_start(data) {
        Err(error @ MpmError::Start { .. }) => error.to_string(),
        Err(error) => panic!("refused as {error:?}"),
        Ok(_) => panic!("taken"),
    }
}

#[test]
fn damaged_and_foreign_files_are_refused() {
    let data = splash::<2>().start();
    assert!(refusal::<3>(&data).contains("of a scene in 2D, and this build plays those in 3D"));
    for length in [0, 7, 27, data.len() - 1] {
        assert!(refusal::<2>(&data[..length]).contains("cut off"));
    }
    for place in [30, data.len() / 2, data.len() - 1] {
        let mut damaged = data.clone();
        damaged[place] ^= 4;
        assert!(refusal::<2>(&damaged).contains("damaged"));
    }
    let mut other = data.clone();
    other[8] += 1;
    assert!(refusal::<2>(&other).contains("this build reads version"));
}
