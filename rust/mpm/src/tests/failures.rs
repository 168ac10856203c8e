//! Errors of users, after which the state is unchanged.

use super::common::{Bodies, elastic, positions, run, settings, water};
use crate::{Force, Material, MpmError, Particles, Solver, Substeps};

fn drop() -> Bodies {
    Bodies::default().block(32, [0.3, 0.3], [0.5, 0.5], [0.0, 0.0], 0)
}

#[test]
fn bad_materials_and_particles_are_named() {
    let message = |error: MpmError| error.to_string();
    let negative = Material::water(-1.0, 1.0, 0.0, 0.0, true).unwrap_err();
    assert_eq!(
        message(negative),
        "density must be finite and > 0, got -1.0"
    );
    let ratio = Material::elastic(1000.0, 1.0e6, 0.5, 0.0).unwrap_err();
    assert_eq!(
        message(ratio),
        "poisson_ratio must be in (-1, 0.5), got 0.5"
    );
    let refuse = |change: &dyn Fn(&mut Bodies)| {
        let mut bodies = drop();
        change(&mut bodies);
        let mass = vec![1.0; bodies.material.len()];
        let Bodies {
            x,
            v,
            material,
            volume,
            ..
        } = &bodies;
        let particles = Particles {
            x,
            v,
            material,
            mass: &mass,
            volume,
            volume_ratio: None,
            body: None,
        };
        message(
            Solver::new(settings::<2>(32, vec![water()]), particles)
                .err()
                .expect("refused"),
        )
    };
    assert_eq!(
        refuse(&|b| b.x[5] = 0.95),
        "x[2] must be inside the walls, got [0.33846155, 0.95]"
    );
    assert!(refuse(&|b| b.x[0] = f32::NAN).starts_with("x[0] must be inside the walls"));
    assert!(refuse(&|b| b.v[3] = f32::INFINITY).starts_with("v[1] must be finite"));
    assert!(
        refuse(&|b| b.material[7] = 1).starts_with("material[7] must be an index into materials")
    );
    assert!(refuse(&|b| b.volume[4] = 0.0).starts_with("volume[4] must be finite and > 0"));
    assert!(refuse(&|b| b.v.truncate(10)).starts_with("v must have"));
}

#[test]
fn a_failed_frame_leaves_the_state_before_it() {
    let mut settings = settings::<2>(32, vec![elastic()]);
    settings.substeps = Substeps::Fixed {
        count: 1,
        allow_unstable: true,
    };
    let mut solver = drop().solver(settings);
    let mut last = positions(&solver);
    let mut frames = 0;
    let error = loop {
        match solver.advance(1, Force::None, |_, s| last = positions(s)) {
            Ok(()) => frames += 1,
            Err(error) => break error,
        }
        assert!(
            frames < 2000,
            "one substep a frame must blow an elastic block up"
        );
    };
    assert!(
        matches!(
            error,
            MpmError::LeftDomain { .. } | MpmError::Inverted { .. } | MpmError::NonFinite { .. }
        ),
        "{error}"
    );
    assert!(
        error.to_string().contains(&format!("frame {frames}")),
        "{error}"
    );
    assert_eq!(solver.frame(), frames);
    assert_eq!(positions(&solver), last);
}

#[test]
fn steps_above_the_limit_are_refused_with_what_to_do() {
    let mut settings = settings::<2>(32, vec![water()]);
    settings.substeps = Substeps::Fixed {
        count: 2,
        allow_unstable: false,
    };
    let error = drop()
        .solver(settings)
        .advance(1, Force::None, |_, _| ())
        .unwrap_err();
    let MpmError::UnstableStep { substeps, .. } = error else {
        panic!("{error}")
    };
    assert!(
        substeps > 2
            && error
                .to_string()
                .contains(&format!("at least {substeps} substeps"))
    );
}

#[test]
fn snapshots_continue_with_the_same_bits_and_refuse_anything_else() {
    let fresh = || drop().solver(settings::<2>(32, vec![water()]));
    let mut solver = fresh();
    run(&mut solver, 37);
    let snapshot = solver.snapshot();
    run(&mut solver, 50);
    let mut other = fresh();
    other.restore(&snapshot).unwrap();
    assert_eq!(other.frame(), 37);
    run(&mut other, 50);
    assert!(
        positions(&solver)
            .iter()
            .zip(positions(&other))
            .all(|(a, b)| a.to_bits() == b.to_bits())
    );

    let refuse = |data: &[u8]| fresh().restore(data).unwrap_err().to_string();
    assert!(refuse(b"PK").contains("no hybridmpm snapshot"));
    assert!(refuse(&snapshot[..snapshot.len() - 9]).contains("damaged or cut off"));
    let mut flipped = snapshot.clone();
    flipped[200] ^= 1;
    assert!(refuse(&flipped).contains("checksum"));
    let mut newer = snapshot.clone();
    newer[8] = 99;
    assert!(refuse(&newer).contains("version 99"));
    let mut elsewhere = drop().solver(settings::<2>(32, vec![elastic()]));
    assert!(
        elsewhere
            .restore(&snapshot)
            .unwrap_err()
            .to_string()
            .contains("other settings")
    );
    let bigger = Bodies::default().block(32, [0.3, 0.3], [0.6, 0.5], [0.0, 0.0], 0);
    let mut bigger = bigger.solver(settings::<2>(32, vec![water()]));
    assert!(
        bigger
            .restore(&snapshot)
            .unwrap_err()
            .to_string()
            .contains("other particles")
    );
    assert_eq!(bigger.frame(), 0);
}
