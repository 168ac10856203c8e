use super::*;

/// A room of a metre with a wall of 2 cm at x = 0.5 from the floor up to 0.6 m.
pub(crate) fn walled_room() -> FreeSpace<2> {
    let (spacing, count) = (1.0 / 64.0, 65);
    let distance = (0..count * count)
        .map(|flat| {
            let (x, y) = (
                (flat / count) as f64 * spacing,
                (flat % count) as f64 * spacing,
            );
            (x - 0.5).hypot((y - 0.6).max(0.0)) - 0.01
        })
        .collect();
    FreeSpace::new([0.0; 2], spacing, [count; 2], distance).unwrap()
}

/// A room of a metre with a wall at x = 0.5 from the floor up to a height.
fn room(height: f64) -> FreeSpace<2> {
    let (spacing, count) = (1.0 / 64.0, 65);
    let distance = (0..count * count)
        .map(|flat| {
            let (x, y) = (
                (flat / count) as f64 * spacing,
                (flat % count) as f64 * spacing,
            );
            (x - 0.5).hypot((y - height).max(0.0)) - 0.01
        })
        .collect();
    FreeSpace::new([0.0; 2], spacing, [count; 2], distance).unwrap()
}

#[test]
fn a_wall_hides_what_is_behind_it() {
    let room = room(0.6);
    assert!(!room.sees(&[0.2, 0.2], &[0.8, 0.2]));
    assert!(room.sees(&[0.2, 0.2], &[0.4, 0.7]));
    assert!(room.sees(&[0.2, 0.8], &[0.8, 0.8]));
}

#[test]
fn the_way_leads_over_the_top_of_the_wall() {
    let room = room(0.6);
    let (from, to) = ([0.2, 0.2], [0.8, 0.2]);
    let lengths = room.lengths_to(&[to]);
    let way = room.way(&from, &to, &lengths).unwrap();
    assert_eq!((way[0], way[way.len() - 1]), (from, to));
    assert!((3..=5).contains(&way.len()), "{way:?}");
    assert!(
        way.iter().any(|x| (x[0] - 0.5).abs() < 0.06 && x[1] > 0.6),
        "{way:?}"
    );
    let length: f64 = way
        .windows(2)
        .map(|w| crate::partition::square_distance(&w[0], &w[1]).sqrt())
        .sum();
    assert!((1.0..1.12).contains(&length), "{length}");
    assert!((room.length_at(&lengths, &from) - length).abs() < 0.12);
}

#[test]
fn behind_a_wall_without_a_gap_there_is_no_way() {
    let room = room(2.0);
    let lengths = room.lengths_to(&[[0.8, 0.2]]);
    assert!(room.length_at(&lengths, &[0.2, 0.2]).is_infinite());
    assert!(room.way(&[0.2, 0.2], &[0.8, 0.2], &lengths).is_none());
}

#[test]
fn a_point_in_the_wall_is_led_out_of_it() {
    let room = room(0.6);
    let lengths = room.lengths_to(&[[0.8, 0.8]]);
    assert!(room.length_at(&lengths, &[0.5, 0.3]).is_finite());
}
