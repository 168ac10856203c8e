//! Laws of particles that lose their deviations from the grid's velocity at a rate per time.

use super::common::{Bodies, elastic, positions, run, sand, settings, velocities, water};
use crate::{
    Contact, ContactKind, Force, Material, MpmError, Obstacle, Shape, Solver, SolverSettings,
    Substeps, Vector, Walls,
};

/// Rate that the documentation advises at 128 cells/m [1/s].
const LOSS: f32 = 500.0;

fn keeping<const D: usize>(resolution: usize, materials: Vec<Material>) -> SolverSettings<D> {
    SolverSettings {
        transfer_loss: Some(LOSS),
        ..settings(resolution, materials)
    }
}

fn of_substeps(count: u32) -> Substeps {
    Substeps::Fixed {
        count,
        allow_unstable: false,
    }
}

fn contact() -> Contact {
    Contact {
        kind: ContactKind::Separating,
        friction: None,
    }
}

/// Energy of the grid and of deviations, without that of affine velocities, which is never negative.
fn energy<const D: usize>(solver: &Solver<D>) -> f64 {
    let d = solver.diagnostics();
    d.kinetic_energy + d.potential_energy + d.elastic_energy
}

/// Two discs of one material that meet at 1 m/s.
fn discs(substeps: u32) -> (Bodies, Solver<2>) {
    let soft = Material::elastic(1000.0, 3.0e5, 0.2, 0.5).unwrap();
    let bodies = Bodies::default()
        .ball(64, [0.4, 0.5], 0.08, [0.5, 0.0], 0)
        .ball(64, [0.6, 0.5], 0.08, [-0.5, 0.0], 0);
    let mut settings = keeping::<2>(64, vec![soft]);
    settings.gravity = Vector::zeros();
    settings.walls = Walls::uniform(Vector::zeros(), Vector::from_element(1.0), contact());
    settings.substeps = of_substeps(substeps);
    let solver = bodies.solver(settings);
    (bodies, solver)
}

#[test]
fn discs_part_as_fast_with_many_substeps_as_with_few() {
    let parted: Vec<f32> = [12, 40, 160]
        .into_iter()
        .map(|substeps| {
            let (bodies, mut solver) = discs(substeps);
            let before = energy(&solver);
            let mut most = before;
            solver
                .advance(100, Force::None, |_, s| most = most.max(energy(s)))
                .unwrap();
            assert!(most <= before * 1.0001, "{before} J grew to {most} J");
            let v = velocities(&solver);
            let of = |body: u32| {
                let mine = v.chunks(2).zip(&bodies.body).filter(|(_, of)| **of == body);
                let (count, sum) = mine.fold((0, 0.0), |(n, sum), (v, _)| (n + 1, sum + v[0]));
                sum / count as f32
            };
            of(1) - of(0)
        })
        .collect();
    let (least, most) = (
        parted.iter().copied().fold(1.0, f32::min),
        parted.iter().copied().fold(0.0, f32::max),
    );
    assert!(least > 0.85 && most - least < 0.05, "{parted:?}");
}

/// Share of the flow of an ideal fluid that passes a slot of 2 cells in a floor.
fn discharge(substeps: u32) -> f64 {
    let (resolution, width) = (64, 2.0 / 64.0);
    let bodies = Bodies::default().block(resolution, [0.2, 0.44], [0.8, 0.84], [0.0, 0.0], 0);
    let mut settings = keeping::<2>(resolution, vec![water()]);
    // In proportion to the resolution.
    settings.transfer_loss = Some(LOSS * 64.0 / 128.0);
    settings.substeps = of_substeps(substeps);
    settings.walls = Walls::uniform(
        Vector::<2>::new(0.2, 0.05),
        Vector::<2>::new(0.8, 0.95),
        contact(),
    );
    let plate = |lower: f32, upper: f32| {
        let shape = Shape::Box {
            lower: Vector::<2>::new(lower, 0.36),
            upper: Vector::<2>::new(upper, 0.44),
        };
        Obstacle::new(shape, contact()).unwrap()
    };
    settings.obstacles = vec![plate(0.0, 0.5 - width / 2.0), plate(0.5 + width / 2.0, 1.0)];
    let mut solver = bodies.solver(settings);
    let above = |solver: &Solver<2>| {
        let x = positions(solver);
        let count = x.chunks(2).filter(|x| x[1] > 0.4).count();
        0.4 * count as f64 / (x.len() / 2) as f64
    };
    run(&mut solver, 100);
    let before = above(&solver);
    run(&mut solver, 40);
    let flow = 0.6 * (before - above(&solver)) / 0.1;
    flow / (f64::from(width) * (2.0 * 9.81 * before).sqrt())
}

#[test]
fn a_slot_of_two_cells_passes_an_orifice_s_flow_whatever_the_substeps() {
    for substeps in [6, 48] {
        let share = discharge(substeps);
        assert!(
            (0.55..0.8).contains(&share),
            "{share} with {substeps} substeps"
        );
    }
}

#[test]
fn energy_never_grows() {
    for (material, upper) in [(water(), 0.5), (sand(), 0.5), (elastic(), 0.3)] {
        for substeps in [10, 40] {
            let bodies = Bodies::default().block(64, [0.1, 0.1], [0.3, upper], [0.0, 0.0], 0);
            let mut settings = keeping::<2>(64, vec![material]);
            settings.substeps = of_substeps(substeps);
            let mut solver = bodies.solver(settings);
            let start = solver.diagnostics();
            // Over that of the weight on the floor.
            let floor = start.mass * 9.81 * 0.1;
            let before = energy(&solver) - floor;
            let mut most = before;
            solver
                .advance(200, Force::None, |_, s| most = most.max(energy(s) - floor))
                .unwrap();
            assert!(
                most <= before * 1.001,
                "{material:?}, {substeps} substeps: {before} J grew to {most} J"
            );
        }
    }
}

#[test]
fn threads_do_not_change_the_result() {
    fn check<const D: usize>(resolution: usize, upper: f32) {
        let corner = |x: f32, y: f32| std::array::from_fn(|axis| if axis == 1 { y } else { x });
        let bodies = Bodies::default()
            .block::<D>(
                resolution,
                corner(0.25, 0.1),
                corner(0.59, upper),
                [0.0; D],
                0,
            )
            .ball::<D>(resolution, corner(0.45, upper + 0.08), 0.07, [0.0; D], 1);
        let result = |threads| {
            let mut solver = bodies.solver(SolverSettings {
                threads,
                ..keeping::<D>(resolution, vec![water(), elastic()])
            });
            run(&mut solver, 30);
            solver.snapshot()
        };
        assert!(result(1) == result(2), "{D}D");
    }
    check::<2>(128, 0.5);
    check::<3>(40, 0.3);
}

#[test]
fn a_rate_that_is_negative_or_no_number_is_refused() {
    for rate in [-1.0, f32::NAN, f32::INFINITY] {
        let mut settings = settings::<2>(64, vec![water()]);
        settings.transfer_loss = Some(rate);
        let bodies = Bodies::default().block(64, [0.4, 0.4], [0.5, 0.5], [0.0, 0.0], 0);
        let mass = vec![1.0; bodies.volume.len()];
        let particles = crate::Particles {
            x: &bodies.x,
            v: &bodies.v,
            material: &bodies.material,
            mass: &mass,
            volume: &bodies.volume,
            volume_ratio: None,
            body: None,
        };
        let error = Solver::new(settings, particles).err().expect("refused");
        assert!(matches!(error, MpmError::Parameter { .. }), "{error}");
        assert!(error.to_string().contains("transfer_loss"), "{error}");
    }
}

#[test]
fn a_very_large_rate_loses_all_in_each_substep() {
    let state = |loss: Option<f32>| {
        let bodies = Bodies::default().block(64, [0.1, 0.1], [0.3, 0.5], [0.0, 0.0], 0);
        let mut settings = settings::<2>(64, vec![water()]);
        settings.transfer_loss = loss;
        let mut solver = bodies.solver(settings);
        run(&mut solver, 100);
        positions(&solver)
    };
    assert_eq!(state(None), state(Some(1.0e6)));
}
