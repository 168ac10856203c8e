use super::*;

const WINDOW: usize = 5;
const PARTICLES: usize = 60;

fn settings(dim: usize) -> HistorySettings {
    HistorySettings {
        particles: PARTICLES,
        dim,
        window: WINDOW,
        dt: 0.01,
        calm_acceleration: 0.5,
        min_active_share: 0.02,
    }
}

/// Numbers in [-1, 1] that look random.
fn noise(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 40) as f32 / 8_388_608.0 - 1.0
    }
}

/// Positions of particles of which a third rests, a third falls and a third is shaken.
fn positions(steps: usize, dim: usize) -> Vec<Vec<f32>> {
    let mut random = noise(7);
    let shaken: Vec<f32> = (0..steps * PARTICLES * dim)
        .map(|_| 0.01 * random())
        .collect();
    let at = |t: usize, i: usize, axis: usize| match i % 3 {
        0 => 0.3,
        1 if axis == 1 => 0.5 - 4.905 * (0.01 * t as f32).powi(2),
        1 => 0.4,
        _ => 0.5 + shaken[(t * PARTICLES + i) * dim + axis],
    };
    (0..steps)
        .map(|t| {
            (0..PARTICLES * dim)
                .map(|k| at(t, k / dim, k % dim))
                .collect()
        })
        .collect()
}

/// Cosine of each particle and whether it is calm, from all positions at once.
fn direct(path: &[Vec<f32>], dim: usize) -> Vec<(f64, bool)> {
    let accelerations: Vec<Vec<f64>> = path
        .windows(3)
        .map(|x| {
            (0..x[0].len())
                .map(|k| {
                    f64::from(
                        ((x[2][k] - x[1][k]) - (x[1][k] - x[0][k]))
                            * (1.0f32 / (0.01f32 * 0.01f32)),
                    )
                })
                .collect()
        })
        .collect();
    let last = accelerations.len();
    (0..PARTICLES)
        .map(|i| {
            let window = |from: usize| -> Vec<f64> {
                accelerations[from..from + WINDOW]
                    .iter()
                    .flat_map(|a| a[i * dim..(i + 1) * dim].to_vec())
                    .collect()
            };
            let (older, newer) = (window(last - 2 * WINDOW), window(last - WINDOW));
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let (o, n) = (dot(&older, &older), dot(&newer, &newer));
            let cosine = if o * n > 0.0 {
                dot(&older, &newer) / (o * n).sqrt()
            } else {
                0.0
            };
            let limit = 0.25 * WINDOW as f64;
            (cosine, o < limit && n < limit)
        })
        .collect()
}

#[test]
fn rolling_sums_agree_with_the_definition() {
    for dim in [2, 3] {
        let path = positions(40, dim);
        let mut history = AccelerationHistory::new(settings(dim)).unwrap();
        for (step, x) in path.iter().enumerate() {
            let signal = history.push(x).unwrap();
            if step < 2 * WINDOW + 1 {
                assert_eq!((signal.cosine, signal.plain), (None, None));
                continue;
            }
            let expected = direct(&path[..=step], dim);
            let plain = expected.iter().map(|(c, _)| c).sum::<f64>() / PARTICLES as f64;
            let active: Vec<_> = expected.iter().filter(|(_, calm)| !calm).collect();
            let cosine = active.iter().map(|(c, _)| c).sum::<f64>() / active.len() as f64;
            assert!((f64::from(signal.plain.unwrap()) - plain).abs() < 1e-5);
            assert!((f64::from(signal.cosine.unwrap()) - cosine).abs() < 1e-5);
            assert!(
                (f64::from(signal.active) - active.len() as f64 / PARTICLES as f64).abs() < 1e-6
            );
        }
    }
}

#[test]
fn an_undone_step_leaves_no_trace() {
    let path = positions(30, 2);
    let mut plain = AccelerationHistory::new(settings(2)).unwrap();
    let mut tried = plain.clone();
    let wild: Vec<f32> = path[0].iter().map(|x| x * 1e3).collect();
    for x in &path {
        tried.push(&wild).unwrap();
        assert!(tried.undo() && !tried.undo());
        let (a, b) = (plain.push(x).unwrap(), tried.push(x).unwrap());
        assert_eq!(a, b);
    }
}

#[test]
fn rest_is_calm_and_free_fall_is_alike() {
    let mut rest = AccelerationHistory::new(settings(2)).unwrap();
    let mut fall = rest.clone();
    for t in 0..30 {
        let height = 0.9 - 4.905 * (0.01 * t as f32).powi(2);
        let at_rest = rest.push(&[0.25; 2 * PARTICLES]).unwrap();
        let falling: Vec<f32> = (0..PARTICLES).flat_map(|_| [0.5, height]).collect();
        let in_fall = fall.push(&falling).unwrap();
        if t > 2 * WINDOW {
            assert_eq!(
                (at_rest.cosine, at_rest.plain, at_rest.active),
                (Some(1.0), Some(0.0), 0.0)
            );
            assert!(in_fall.cosine.unwrap() > 0.999 && (in_fall.largest - 9.81).abs() < 0.1);
        }
    }
}

#[test]
fn what_large_numbers_leave_behind_is_below_the_floor() {
    let mut history = AccelerationHistory::new(settings(2)).unwrap();
    let mut random = noise(3);
    for _ in 0..100 {
        let x: Vec<f32> = (0..2 * PARTICLES).map(|_| random()).collect();
        history.push(&x).unwrap();
    }
    let mut signal = None;
    for _ in 0..2 * WINDOW + 2 {
        signal = Some(history.push(&[0.5; 2 * PARTICLES]).unwrap());
    }
    assert_eq!(signal.unwrap().cosine, Some(1.0));
    assert_eq!(signal.unwrap().active, 0.0);
}

#[test]
fn settings_are_refused_by_name() {
    let good = settings(2);
    for (bad, name) in [
        (HistorySettings { dim: 4, ..good }, "dim"),
        (HistorySettings { window: 0, ..good }, "window"),
        (
            HistorySettings {
                dt: f32::NAN,
                ..good
            },
            "dt",
        ),
        (
            HistorySettings {
                calm_acceleration: -1.0,
                ..good
            },
            "calm_acceleration",
        ),
        (
            HistorySettings {
                min_active_share: 2.0,
                ..good
            },
            "min_active_share",
        ),
    ] {
        let error = AccelerationHistory::new(bad).unwrap_err();
        assert!(error.to_string().starts_with(name), "{error}");
    }
    let short = AccelerationHistory::new(good)
        .unwrap()
        .push(&[0.0; 3])
        .unwrap_err();
    assert!(short.to_string().contains("120 numbers"));
}

#[test]
fn going_on_from_a_snapshot_gives_the_same_bits() {
    for dim in [2, 3] {
        let path = positions(4 * WINDOW, dim);
        for stop in [0, 1, 3, 2 * WINDOW, 3 * WINDOW] {
            let mut history = AccelerationHistory::new(settings(dim)).unwrap();
            for x in &path[..stop] {
                history.push(x).unwrap();
            }
            let mut other = AccelerationHistory::new(settings(dim)).unwrap();
            other.push(&path[7]).unwrap();
            other.restore(&history.snapshot()).unwrap();
            assert_eq!(other.undo(), history.undo());
            for x in &path[stop.saturating_sub(1)..] {
                assert_eq!(other.push(x).unwrap(), history.push(x).unwrap());
            }
            assert_eq!(other.snapshot(), history.snapshot());
        }
    }
}

#[test]
fn a_foreign_or_damaged_snapshot_changes_nothing() {
    let path = positions(WINDOW, 2);
    let mut history = AccelerationHistory::new(settings(2)).unwrap();
    history.push(&path[0]).unwrap();
    let data = history.snapshot();
    let other = HistorySettings {
        window: WINDOW + 1,
        ..settings(2)
    };
    let foreign = AccelerationHistory::new(other).unwrap().snapshot();
    let longer = [data.as_slice(), &[0]].concat();
    for bad in [&foreign[..], &data[..data.len() - 1], &longer, &[]] {
        assert!(matches!(
            history.restore(bad),
            Err(SafeguardError::Snapshot(_))
        ));
        assert_eq!(history.snapshot(), data);
    }
}
