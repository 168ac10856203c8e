//! Graphs against the comparison of all pairs, whatever the cloud of points.

use neighbors::{GraphError, GraphSettings, Search};
use proptest::prelude::*;
use threads::Pool;

#[derive(Debug, PartialEq)]
struct Graph {
    starts: Vec<u32>,
    senders: Vec<u32>,
}

/// All pairs, in double precision.
fn brute_force<const D: usize>(
    x: &[f32],
    fixed: Option<&[bool]>,
    settings: &GraphSettings,
) -> Graph {
    let (points, _) = x.as_chunks::<D>();
    let radius_squared = f64::from(settings.radius).powi(2);
    let mut graph = Graph {
        starts: vec![0],
        senders: Vec::new(),
    };
    for (i, a) in points.iter().enumerate() {
        for (j, b) in points.iter().enumerate() {
            let squared: f64 = (0..D)
                .map(|axis| (f64::from(a[axis]) - f64::from(b[axis])).powi(2))
                .sum();
            let near =
                squared < radius_squared || (settings.inclusive && squared == radius_squared);
            let joined = if i == j {
                settings.self_edges
            } else {
                near && !fixed.is_some_and(|fixed| fixed[i] && fixed[j])
            };
            if joined {
                graph.senders.push(j as u32);
            }
        }
        graph.starts.push(graph.senders.len() as u32);
    }
    graph
}

fn search<const D: usize>(
    search: &mut Search<D>,
    x: &[f32],
    fixed: Option<&[bool]>,
    settings: &GraphSettings,
    pool: &Pool,
) -> Graph {
    let edges = search.find(x, fixed, settings, pool).unwrap();
    let mut senders = vec![0; edges];
    search.write_senders(&mut senders, pool);
    Graph {
        starts: search.starts().to_vec(),
        senders,
    }
}

/// Coordinates of up to 150 points: a coarse lattice makes coincident points and distances of exactly the radius,
/// small scales clump, and some are far away.
fn clouds(dim: usize) -> impl Strategy<Value = Vec<f32>> {
    let coordinate = prop_oneof![
        8 => (0i32..40).prop_map(|k| k as f32 / 32.0),
        8 => 0.0f32..1.0,
        4 => 0.5f32..0.51,
        1 => Just(-3.0e3f32),
    ];
    let clump = (0usize..150).prop_map(move |count| vec![0.25; count * dim]);
    let cloud = prop::collection::vec(prop::collection::vec(coordinate, dim), 0..150)
        .prop_map(|points| points.concat());
    prop_oneof![15 => cloud, 1 => clump]
}

fn settings() -> impl Strategy<Value = GraphSettings> {
    let radius = prop_oneof![
        Just(1.0f32 / 32.0),
        Just(1.0 / 16.0),
        0.001f32..3.0,
        Just(1.0e-20),
        Just(1.0e20)
    ];
    (radius, any::<bool>(), any::<bool>()).prop_map(|(radius, inclusive, self_edges)| {
        GraphSettings {
            inclusive,
            self_edges,
            ..GraphSettings::new(radius)
        }
    })
}

fn same_as_brute_force<const D: usize>(x: &[f32], settings: &GraphSettings, flags: u64) {
    let fixed: Vec<bool> = (0..x.len() / D)
        .map(|i| flags >> (i % 64) & 1 == 1)
        .collect();
    let (one, three) = (Pool::new(1).unwrap(), Pool::new(3).unwrap());
    let mut reused = Search::<D>::new();
    for fixed in [None, Some(fixed.as_slice())] {
        let expected = brute_force::<D>(x, fixed, settings);
        assert_eq!(search(&mut reused, x, fixed, settings, &one), expected);
        assert_eq!(search(&mut reused, x, fixed, settings, &three), expected);
    }
}

proptest! {
    #[test]
    fn equals_brute_force_2d(x in clouds(2), settings in settings(), flags: u64) {
        same_as_brute_force::<2>(&x, &settings, flags);
    }

    #[test]
    fn equals_brute_force_3d(x in clouds(3), settings in settings(), flags: u64) {
        same_as_brute_force::<3>(&x, &settings, flags);
    }
}

/// A jittered lattice with several thousand points, more than one piece of work for each thread.
fn jittered<const D: usize>(per_axis: usize) -> Vec<f32> {
    let mut state = 1u64;
    let mut jitter = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 40) as f32 / 16_777_216.0
    };
    (0..per_axis.pow(D as u32))
        .flat_map(|flat| {
            std::array::from_fn::<_, D, _>(|axis| {
                let site = flat / per_axis.pow(axis as u32) % per_axis;
                (site as f32 + 0.8 * jitter()) / per_axis as f32
            })
        })
        .collect()
}

#[test]
fn threads_do_not_change_a_large_graph() {
    fn check<const D: usize>(x: &[f32], radius: f32) {
        let settings = GraphSettings::new(radius);
        let mut reused = Search::<D>::new();
        let expected = brute_force::<D>(x, None, &settings);
        for threads in [1, 2, 4] {
            let pool = Pool::new(threads).unwrap();
            assert_eq!(search(&mut reused, x, None, &settings, &pool), expected);
        }
    }
    check::<2>(&jittered::<2>(70), 0.04);
    check::<3>(&jittered::<3>(17), 0.12);
}

#[test]
fn nonsense_is_named() {
    let pool = Pool::new(1).unwrap();
    let error = |x: &[f32], fixed: Option<&[bool]>, settings: &GraphSettings| {
        let error = Search::<2>::new().find(x, fixed, settings, &pool);
        error.unwrap_err()
    };
    assert_eq!(
        error(&[], None, &GraphSettings::new(0.0)).to_string(),
        "radius must be finite and > 0 m, got 0"
    );
    let bad = error(&[0.0, 0.0, f32::NAN, 0.0], None, &GraphSettings::new(1.0));
    assert!(bad.to_string().starts_with("x[1] must be finite"));
    assert_eq!(
        error(&[0.0; 4], Some(&[true]), &GraphSettings::new(1.0)),
        GraphError::Flags {
            points: 2,
            flags: 1
        }
    );
    let few = GraphSettings {
        max_edges: 5,
        ..GraphSettings::new(1.0)
    };
    let edges = error(&[0.0; 6], None, &few).to_string();
    assert!(edges.contains("3 points has more than max_edges = 5"));
}
