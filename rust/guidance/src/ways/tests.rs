use super::*;
use crate::ways_file::Followed;

const DT: f64 = 0.0025;

fn lattice(corner: [f64; 2], side: f64, columns: usize, rows: usize) -> Vec<[f64; 2]> {
    let place = |i: usize| [i % columns, i / columns];
    (0..columns * rows)
        .map(|i| std::array::from_fn(|axis| corner[axis] + side * (place(i)[axis] as f64 + 0.5)))
        .collect()
}

/// Forty particles of a block, led to a block beside it that moves with `velocity` then.
fn ways(velocity: Option<[f64; 2]>, frames: u64) -> (Ways<2>, Vec<[f32; 2]>) {
    let x = lattice([0.2, 0.2], 0.02, 8, 5);
    let cells = lattice([0.5, 0.4], 0.01, 16, 10);
    let found = match_to_region(&x, &cells, None).unwrap();
    let rest = vec![[0.0; 2]; x.len()];
    let weight = vec![1.0 / x.len() as f64; x.len()];
    let plan = Plan::of(found, &rest, &weight, None, 40.0 * DT).unwrap();
    let settings = Settings {
        gravity: [0.0, -9.81],
        frame_dt: DT,
        cells: 8,
        cap: 1e3,
        ahead: 24,
        unit: 1.0,
        room: None,
    };
    let settling = Settling::new(cells, 0.01, [40, frames], velocity).unwrap();
    let ids = (0..x.len() as u64).map(|id| 2 * id).collect();
    let weight = weight.iter().map(|&one| one as f32).collect();
    let ways = Ways::new(ids, weight, plan, settings, Some(settling)).unwrap();
    let x = x.iter().map(|row| row.map(|along| along as f32)).collect();
    (ways, x)
}

/// Moves points by the force, which frames hold; they meet nothing.
fn run(ways: &mut Ways<2>, frames: std::ops::Range<u64>, x: &mut [[f32; 2]], v: &mut [[f32; 2]]) {
    let (ids, dt) = (ways.ids().to_vec(), DT as f32);
    for index in frames {
        let present = Present { ids: &ids, x, v };
        let (rows, force) = ways.force(index, present).unwrap();
        assert!(rows.is_none());
        for ((x, v), force) in x.iter_mut().zip(&mut *v).zip(force) {
            for axis in 0..2 {
                let a = force[axis] + [0.0, -9.81][axis];
                x[axis] += dt * v[axis] + 0.5 * dt * dt * a;
                v[axis] += dt * a;
            }
        }
    }
}

/// Particles in the block.
fn inside(x: &[[f32; 2]]) -> usize {
    let block = |x: &&[f32; 2]| (0.5..0.66).contains(&x[0]) && (0.4..0.5).contains(&x[1]);
    x.iter().filter(block).count()
}

#[test]
fn places_are_matched_anew_from_where_particles_were_pushed_to() {
    let (mut ways, mut x) = ways(None, 100);
    let mut v = vec![[0.0; 2]; x.len()];
    run(&mut ways, 0..40, &mut x, &mut v);
    // Something has changed places of all with their mirror images.
    for x in &mut x {
        x[0] = 1.16 - x[0];
    }
    let mirrored = x.clone();
    run(&mut ways, 40..100, &mut x, &mut v);
    assert_eq!(inside(&x), 40, "{x:?}");
    // Nobody goes back to a place of before.
    for (x, before) in x.iter().zip(&mirrored) {
        assert!((x[0] - before[0]).abs() < 0.04, "{x:?} {before:?}");
    }
}

#[test]
fn a_region_that_moves_is_reached_with_its_velocity() {
    let (mut ways, mut x) = ways(Some([0.4, 0.2]), 100);
    let mut v = vec![[0.0; 2]; x.len()];
    run(&mut ways, 0..100, &mut x, &mut v);
    assert_eq!(inside(&x), 40, "{x:?}");
    for v in v {
        assert!(
            (v[0] - 0.4).abs() < 0.02 && (v[1] - 0.2).abs() < 0.02,
            "{v:?}"
        );
    }
}

#[test]
fn bytes_go_on_to_the_same_bits_with_what_was_found() {
    let (mut one, mut x) = ways(None, 100);
    let mut v = vec![[0.0; 2]; x.len()];
    run(&mut one, 0..47, &mut x, &mut v);
    let data = one.to_bytes();
    let mut other = Ways::<2>::from_bytes(&data).unwrap();
    assert_eq!(other.to_bytes(), data);
    let (mut y, mut w) = (x.clone(), v.clone());
    run(&mut one, 47..70, &mut x, &mut v);
    run(&mut other, 47..70, &mut y, &mut w);
    assert_eq!((x, v), (y, w));
}

#[test]
fn damaged_bytes_are_refused() {
    let (mut ways, mut x) = ways(None, 100);
    let mut v = vec![[0.0; 2]; x.len()];
    run(&mut ways, 0..47, &mut x, &mut v);
    let data = ways.to_bytes();
    for length in [0, 3, 11, 40, data.len() / 2, data.len() - 1] {
        assert!(Ways::<2>::from_bytes(&data[..length]).is_err(), "{length}");
    }
    assert!(Ways::<3>::from_bytes(&data).is_err());
    assert!(Ways::<2>::from_bytes(&[&data[..], &[0]].concat()).is_err());
}

#[test]
fn a_page_follows_one_law_after_another_and_leads_those_who_are_there() {
    let (mut first, x) = ways(None, 100);
    let (mut second, _) = ways(Some([0.4, 0.2]), 50);
    let word = |number: u32| number.to_le_bytes().to_vec();
    let data = [
        [7, 90, 2, 0].map(word).concat(),
        first.to_bytes(),
        word(60),
        second.to_bytes(),
    ]
    .concat();
    let mut followed = Followed::<2>::read(&data).unwrap();
    // Of the forty, whose numbers are even, the first is gone, and one with an odd number is not led.
    let ids = [vec![1], (1..40).map(|id| 2 * id).collect()].concat();
    let v = vec![[0.1, 0.0]; 40];
    let (ids, x, v) = (&ids[..], &x[..], &v[..]);
    let present = Present { ids, x, v };
    for frame in [7, 66, 67] {
        let all = followed.force(frame, present).unwrap().unwrap();
        let (ways, begun) = if frame < 67 {
            (&mut first, 7)
        } else {
            (&mut second, 67)
        };
        let (rows, led) = ways.force(frame - begun, present).unwrap();
        assert_eq!(rows, Some((1..40).collect()));
        assert_eq!((all[0], &all[1..]), ([0.0; 2], &led[..]));
    }
    for frame in [6, 97] {
        assert!(followed.force(frame, present).unwrap().is_none());
    }
}
