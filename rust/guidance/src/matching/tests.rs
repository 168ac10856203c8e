use super::*;

fn lattice(lower: [f64; 2], spacing: f64, columns: usize, rows: usize) -> Vec<[f64; 2]> {
    (0..columns * rows)
        .map(|i| {
            [
                lower[0] + spacing * (i % columns) as f64,
                lower[1] + spacing * (i / columns) as f64,
            ]
        })
        .collect()
}

#[test]
fn a_block_that_is_moved_keeps_its_order() {
    let x = lattice([0.2, 0.2], 0.01, 20, 10);
    // Four cells for each particle, so that the places are those of the block, shifted.
    let cells = lattice([0.4975, 0.3975], 0.005, 40, 20);
    let matching = match_to_region(&x, &cells, None).unwrap();
    let square: f64 = x
        .iter()
        .zip(&matching.places)
        .map(|(x, place)| square_distance(&[x[0] + 0.3, x[1] + 0.2], place))
        .sum();
    // Places are centres of parts of the lattice, which are not all square.
    assert!((square / 200.0).sqrt() < 0.01, "{square}");
    assert!(matching.ways.iter().all(|way| way.len() == 2));
}

#[test]
fn no_place_is_given_twice() {
    for count in [1, 7, 63, 500, 2100, 9000] {
        let x: Vec<[f64; 2]> = (0..count)
            .map(|i| {
                [
                    (i * 7919 % 997) as f64 / 997.0,
                    (i * 104_729 % 991) as f64 / 991.0,
                ]
            })
            .collect();
        let cells = lattice([0.0; 2], 0.001, 300, 300);
        let matching = match_to_region(&x, &cells, None).unwrap();
        let mut keys: Vec<[u64; 2]> = matching
            .places
            .iter()
            .map(|p| p.map(f64::to_bits))
            .collect();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), count);
    }
}

#[test]
fn few_places_stay_empty() {
    for count in [100, 1000, 2100, 3333, 4000, 16_000, 100_000] {
        let sizes = Sizes::of(count);
        let places = sizes.groups * sizes.places;
        assert!(
            places >= count && places as f64 <= 1.05 * count as f64 + 8.0,
            "{count}: {places}"
        );
    }
}

#[test]
fn a_region_of_too_few_cells_is_refused() {
    let error = match_to_region(&[[0.5, 0.5]; 20], &[[0.5, 0.5]; 3], None).unwrap_err();
    assert_eq!(error.name, "cells");
}

#[test]
fn places_between_two_arms_are_moved_into_a_cell() {
    let mut cells = lattice([0.1, 0.1], 0.01, 5, 20);
    cells.extend(lattice([0.2, 0.1], 0.01, 5, 20));
    let mut places = vec![[0.121, 0.133], [0.156, 0.15], [0.19, 0.2]];
    in_cells(&mut places, &cells, 0.01);
    let moved = [[0.121, 0.133], [0.14, 0.15], [0.2, 0.2]];
    for (place, moved) in places.iter().zip(moved) {
        assert!(square_distance(place, &moved) < 1e-20, "{places:?}");
    }
}
