//! A start file gives the solver that wrote it, or is refused.

use super::common::{Bodies, elastic, liquid, run, sand, settings, water};
use crate::{
    CoarseParticles, Contact, ContactKind, Motion, MpmError, Obstacle, Particles, Shape, Solver,
    Start, Upsampler, UpsamplingConstants, Vector,
};

/// Four materials in mid-splash, around an obstacle that turns.
fn splash<const D: usize>() -> Solver<D> {
    let cell = 1.0 / 32.0;
    let corner = |cells: f32| std::array::from_fn(|axis| cell * (cells + axis as f32));
    let bodies = Bodies::default()
        .block::<D>(32, corner(4.0), corner(8.0), [0.7; D], 0)
        .block::<D>(32, corner(10.0), corner(13.0), [-2.0; D], 1)
        .block::<D>(32, corner(14.0), corner(17.0), [-1.0; D], 2)
        .block::<D>(32, corner(18.0), corner(21.0), [-1.0; D], 2)
        .block::<D>(32, corner(21.5), corner(23.5), [-1.0; D], 3);
    let mut settings = settings::<D>(32, vec![water(), sand(), elastic(), liquid()]);
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
    settings.transfer_loss = Some(500.0);
    let mut solver = bodies.solver(settings);
    run(&mut solver, 25);
    solver
}

fn check<const D: usize>() {
    let mut solver = splash::<D>();
    let mut again = Start::<D>::read(&solver.start(None, false)).unwrap().solver;
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

/// Particles on a fine lattice, shown by those of `splash`.
fn shown<const D: usize>(solver: &Solver<D>) -> Upsampler<D> {
    let mut settings = solver.settings().clone();
    settings.resolution *= 2;
    settings.cells = settings.cells.map(|cells| 2 * cells);
    let corner = |cells: f32| std::array::from_fn(|_| cells / 64.0);
    let all = Bodies::default().block::<D>(64, corner(8.0), corner(16.0), [0.7; D], 0);
    let (mut x, mut mass) = (vec![0.0; solver.count() * D], vec![0.0; solver.count()]);
    solver.write_positions(&mut x);
    solver.write_masses(&mut mass);
    let coarse = CoarseParticles {
        ids: solver.ids(),
        x: &x,
        affine: None,
        mass: &mass,
        rigid: &[],
    };
    let grid = (solver.settings().resolution, solver.settings().cells);
    let constants = UpsamplingConstants::default();
    let particles = Particles {
        x: &all.x,
        v: &all.v,
        material: &all.material,
        mass: &vec![1.0; all.volume.len()],
        volume: &all.volume,
        volume_ratio: None,
        body: None,
    };
    Upsampler::new(&settings, grid, constants, particles, &coarse).unwrap()
}

#[test]
fn particles_that_are_shown_come_along() {
    let solver = splash::<2>();
    let upsampler = shown(&solver);
    let again = Start::<2>::read(&solver.start(Some(&upsampler), true)).unwrap();
    let carried = again.upsampler.expect("shown particles");
    assert_eq!(carried.snapshot(), upsampler.snapshot());
    assert_eq!(carried.every(), upsampler.every());
    assert!(again.safe.is_some());
    assert!(
        Start::<2>::read(&solver.start(None, false))
            .unwrap()
            .safe
            .is_none()
    );
}

fn refusal<const D: usize>(data: &[u8]) -> String {
    match Start::<D>::read(data) {
        Err(error @ MpmError::Start { .. }) => error.to_string(),
        Err(error) => panic!("refused as {error:?}"),
        Ok(_) => panic!("taken"),
    }
}

#[test]
fn damaged_and_foreign_files_are_refused() {
    let data = splash::<2>().start(None, false);
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
