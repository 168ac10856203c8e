use super::*;

const LAW: Law<2> = Law {
    gravity: [0.0, -9.81],
    shortest: 0.04,
    ahead: 0.06,
    cells: 0,
    size: [1.0; 2],
    cap: 1e6,
};

fn paths(times: &[f32], x: &[[f32; 2]], v: &[[f32; 2]]) -> Paths<2> {
    Paths {
        starts: vec![0, times.len() as u32],
        times: times.to_vec(),
        x: x.to_vec(),
        v: v.to_vec(),
    }
}

/// Moves a point by the force, which frames of 2.5 ms hold, and returns where it ends.
fn run(
    tracks: &Tracks<2>,
    mut x: [f32; 2],
    mut v: [f32; 2],
    frames: usize,
) -> ([f32; 2], [f32; 2]) {
    for frame in 0..frames {
        let a = tracks.force(&[x], &[v], &[1.0], frame as f32 * 0.0025, None)[0];
        for axis in 0..2 {
            let a = a[axis] + LAW.gravity[axis];
            x[axis] += 0.0025 * v[axis] + 0.5 * 0.0025_f32.powi(2) * a;
            v[axis] += 0.0025 * a;
        }
    }
    (x, v)
}

#[test]
fn a_free_point_arrives_in_time_and_rests() {
    let paths = paths(&[0.0, 0.25], &[[0.3, 0.3], [0.6, 0.5]], &[[0.0; 2]; 2]);
    let tracks = Tracks::new(paths, vec![0], vec![[0.01, 0.0]], LAW, None).unwrap();
    let (x, v) = run(&tracks, [0.31, 0.3], [1.0, -2.0], 100);
    assert!(
        (x[0] - 0.61).abs() < 0.01 && (x[1] - 0.5).abs() < 0.01,
        "{x:?}"
    );
    let (x, v2) = run(&tracks, [0.31, 0.3], [1.0, -2.0], 150);
    assert!(
        (x[0] - 0.61).abs() < 1e-3 && (x[1] - 0.5).abs() < 1e-3,
        "{x:?}"
    );
    assert!(v2[0].abs() + v2[1].abs() < v[0].abs() + v[1].abs() + 1e-6);
}

#[test]
fn the_first_force_is_the_formula() {
    let paths = paths(&[0.0, 0.2], &[[0.3, 0.3], [0.6, 0.5]], &[[0.0; 2]; 2]);
    let tracks = Tracks::new(paths, vec![0], vec![[0.0; 2]], LAW, None).unwrap();
    let a = tracks.force(&[[0.3, 0.3]], &[[0.5, 1.0]], &[1.0], 0.0, None)[0];
    assert!(
        (a[0] - (6.0 * 0.3 / 0.04 - 4.0 * 0.5 / 0.2)).abs() < 1e-3,
        "{a:?}"
    );
    assert!(
        (a[1] - (6.0 * 0.2 / 0.04 - 4.0 / 0.2 + 9.81)).abs() < 1e-3,
        "{a:?}"
    );
}

#[test]
fn a_way_of_two_pieces_is_followed() {
    let timing = crate::least_acceleration(
        &[[0.2, 0.2], [0.6, 0.2], [0.6, 0.6]],
        [0.0; 2],
        [0.0; 2],
        0.5,
    )
    .unwrap();
    let times: Vec<f32> = timing.times.iter().map(|&t| t as f32).collect();
    let v: Vec<[f32; 2]> = timing
        .velocities
        .iter()
        .map(|v| v.map(|v| v as f32))
        .collect();
    let paths = paths(&times, &[[0.2, 0.2], [0.6, 0.2], [0.6, 0.6]], &v);
    let tracks = Tracks::new(paths, vec![0], vec![[0.0; 2]], LAW, None).unwrap();
    let corner = (times[1] / 0.0025).round() as usize;
    let (x, _) = run(&tracks, [0.2, 0.2], [0.0; 2], corner);
    assert!(
        (x[0] - 0.6).abs() < 0.01 && (x[1] - 0.2).abs() < 0.01,
        "{x:?}"
    );
    let (x, _) = run(&tracks, [0.2, 0.2], [0.0; 2], 240);
    assert!(
        (x[0] - 0.6).abs() < 2e-3 && (x[1] - 0.6).abs() < 2e-3,
        "{x:?}"
    );
}

#[test]
fn no_force_is_above_the_cap() {
    let paths = paths(&[0.0, 0.05], &[[0.1, 0.1], [0.9, 0.9]], &[[0.0; 2]; 2]);
    let tracks = Tracks::new(
        paths,
        vec![0],
        vec![[0.0; 2]],
        Law { cap: 50.0, ..LAW },
        None,
    )
    .unwrap();
    let a = tracks.force(&[[0.1, 0.1]], &[[0.0; 2]], &[1.0], 0.0, None)[0];
    assert!((a[0].hypot(a[1]) - 50.0).abs() < 1e-3);
}

#[test]
fn paths_that_fit_nothing_are_refused() {
    let good = || paths(&[0.0, 0.1], &[[0.0; 2]; 2], &[[0.0; 2]; 2]);
    let named = |tracks: Result<Tracks<2>, GuidanceError>| tracks.unwrap_err().name;
    assert_eq!(
        named(Tracks::new(Paths::default(), vec![], vec![], LAW, None)),
        "starts"
    );
    assert_eq!(
        named(Tracks::new(good(), vec![1], vec![[0.0; 2]], LAW, None)),
        "path"
    );
    assert_eq!(
        named(Tracks::new(good(), vec![0], vec![], LAW, None)),
        "offset"
    );
    let backwards = paths(&[0.1, 0.0], &[[0.0; 2]; 2], &[[0.0; 2]; 2]);
    assert_eq!(
        named(Tracks::new(backwards, vec![0], vec![[0.0; 2]], LAW, None)),
        "times"
    );
    assert_eq!(
        named(Tracks::new(
            good(),
            vec![0],
            vec![[0.0; 2]],
            Law {
                cap: f32::NAN,
                ..LAW
            },
            None
        )),
        "law"
    );
}
