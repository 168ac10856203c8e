//! External accelerations: for each particle, for all of them alike, and where particles come and go.

use super::common::{Bodies, FRAME, GRAVITY, run, sand, settings, velocities, water};
use crate::{Emitter, Force, Material, Openings, Shape, Sleep, Solver, SolverSettings, Vector};

#[test]
fn external_acceleration_moves_each_particle_by_its_own() {
    let bodies = Bodies::default()
        .block(64, [0.2, 0.5], [0.3, 0.6], [0.0, 0.0], 0)
        .block(64, [0.6, 0.5], [0.7, 0.6], [0.0, 0.0], 0);
    let mut solver = bodies.solver(settings::<2>(64, vec![water()]));
    let force: Vec<f32> = bodies
        .x
        .chunks(2)
        .flat_map(|x| [if x[0] < 0.5 { 4.0 } else { -4.0 }, GRAVITY])
        .collect();
    solver.advance(40, Force::Held(&force), |_, _| ()).unwrap();
    let speed = 4.0 * 40.0 * FRAME;
    for (v, start) in velocities(&solver).chunks(2).zip(bodies.x.chunks(2)) {
        let expected = if start[0] < 0.5 { speed } else { -speed };
        assert!(
            (v[0] - expected).abs() < 1.0e-4 && v[1].abs() < 1.0e-4,
            "{v:?}"
        );
    }
}

#[test]
fn forces_are_checked() {
    let mut solver = Bodies::default()
        .block(32, [0.4, 0.4], [0.6, 0.6], [0.0; 2], 0)
        .solver(settings::<2>(32, vec![water()]));
    let n = solver.count();
    let refuse = |solver: &mut Solver<2>, force: Force<'_>| {
        solver.advance(3, force, |_, _| ()).unwrap_err().to_string()
    };
    assert!(refuse(&mut solver, Force::Held(&[0.0; 3])).starts_with("force must have"));
    assert!(refuse(&mut solver, Force::PerFrame(&vec![0.0; 2 * n])).starts_with("force must have"));
    assert!(
        refuse(&mut solver, Force::Held(&vec![f32::NAN; 2 * n]))
            .starts_with("force must be finite")
    );
    assert!(
        refuse(&mut solver, Force::Held(&vec![1.0e12; 2 * n])).contains("lower the velocities")
    );
    assert!(refuse(&mut solver, Force::Uniform(&[1.0; 3])).contains("one number for each axis"));
    assert!(
        refuse(&mut solver, Force::Uniform(&[0.0, f32::NAN])).starts_with("force must be finite")
    );
    assert!(refuse(&mut solver, Force::Uniform(&[1.0e12, 0.0])).contains("lower the velocities"));
    assert_eq!(solver.frame(), 0);
}

/// Compares the two forces on a falling block after each of some calls, of so many frames.
fn same_bits<const D: usize>(settings: &SolverSettings<D>, wind: [f32; D], calls: &[usize]) {
    let (lower, upper) = ([0.3; D], [0.5; D]);
    let bodies = Bodies::default().block(settings.resolution, lower, upper, [0.0; D], 0);
    let mut uniform = bodies.solver(settings.clone());
    let mut each = bodies.solver(settings.clone());
    for &frames in calls {
        uniform
            .advance(frames, Force::Uniform(&wind), |_, _| ())
            .unwrap();
        let rows = wind.repeat(each.count());
        each.advance(frames, Force::Held(&rows), |_, _| ()).unwrap();
        assert_eq!(uniform.snapshot(), each.snapshot());
        assert_eq!(uniform.last_frame(), each.last_frame());
    }
}

#[test]
fn a_uniform_force_gives_the_bits_of_one_that_names_each_particle() {
    for material in [water(), sand()] {
        same_bits::<2>(&settings(64, vec![material]), [6.0, -1.5], &[1, 7, 2]);
        same_bits::<3>(&settings(32, vec![material]), [6.0, -1.5, 0.25], &[1, 7, 2]);
        // Strong enough to choose the substeps.
        same_bits::<2>(&settings(64, vec![material]), [60_000.0, 0.0], &[1]);
    }
}

#[test]
fn a_uniform_force_wakes_a_heap_unless_it_is_zero() {
    let mut settings: SolverSettings<2> = settings(64, vec![sand()]);
    settings.sleep = Some(Sleep {
        speed: 0.02,
        frames: 20,
    });
    let bodies = Bodies::default().block(64, [0.3, 0.1], [0.7, 0.3], [0.0; 2], 0);
    let mut solver = bodies.solver(settings);
    let awake = |solver: &Solver<2>| {
        let mut asleep = vec![false; solver.count()];
        solver.write_asleep(&mut asleep);
        asleep.iter().filter(|&&asleep| !asleep).count()
    };
    run(&mut solver, 360);
    let resting = awake(&solver);
    solver
        .advance(4, Force::Uniform(&[0.0; 2]), |_, _| ())
        .unwrap();
    assert!(resting < solver.count() / 10 && awake(&solver) <= resting);
    let mut each = solver.clone();
    solver
        .advance(4, Force::Uniform(&[20.0, 0.0]), |_, _| ())
        .unwrap();
    let rows = [20.0, 0.0].repeat(each.count());
    each.advance(4, Force::Held(&rows), |_, _| ()).unwrap();
    assert_eq!(awake(&solver), solver.count());
    assert_eq!(solver.snapshot(), each.snapshot());
}

/// Water that comes from an opening at the left and leaves at the right.
fn open(material: Material) -> Solver<2> {
    let spacing = 0.5 / 64.0;
    let emitter = Emitter {
        material: 0,
        velocity: Vector::<2>::new(1.0, 0.0),
        spacing,
        sites: (0..16)
            .map(|k| Vector::<2>::new(0.2, 0.3 + k as f32 * spacing))
            .collect(),
        jitter: vec![Vector::<2>::zeros(); 16],
        mass: material.density * spacing * spacing,
        volume: spacing * spacing,
        start: 0.0,
        stop: f64::INFINITY,
    };
    let mut settings: SolverSettings<2> = settings(64, vec![material]);
    settings.openings = Openings {
        emitters: vec![emitter],
        sinks: vec![Shape::Box {
            lower: Vector::<2>::new(0.5, 0.0),
            upper: Vector::<2>::new(1.0, 1.0),
        }],
        max_particles: 4000,
    };
    Bodies::default().solver(settings)
}

#[test]
fn where_particles_come_and_go_a_uniform_force_acts_in_all_frames_of_a_call() {
    let (mut whole, mut single) = (open(water()), open(water()));
    let wind = [5.0, 2.0];
    let mut counts = Vec::new();
    let count = |_: usize, solver: &Solver<2>| counts.push(solver.count());
    whole.advance(120, Force::Uniform(&wind), count).unwrap();
    for _ in 0..120 {
        let rows = wind.repeat(single.count());
        single.advance(1, Force::Held(&rows), |_, _| ()).unwrap();
    }
    assert_eq!(whole.snapshot(), single.snapshot());
    assert!(counts.windows(2).any(|pair| pair[0] < pair[1]));
    assert!(counts.windows(2).any(|pair| pair[0] > pair[1]));
}

#[test]
fn where_particles_come_and_go_a_force_for_each_serves_one_frame() {
    let mut solver = open(water());
    for force in [Force::Held(&[]), Force::PerFrame(&[])] {
        let error = solver.advance(2, force, |_, _| ()).unwrap_err().to_string();
        assert!(
            error.starts_with("frames must be 1") && error.contains("uniform force"),
            "{error}"
        );
    }
    solver.advance(1, Force::Held(&[]), |_, _| ()).unwrap();
    assert_eq!(solver.frame(), 1);
}
