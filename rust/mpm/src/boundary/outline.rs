//! Outlines in the plane.

use std::collections::{BTreeMap, BTreeSet};

type Place = [f32; 2];

/// Returns vertices and segments of a closed polygon, each with the inside on its left.
///
/// What is inside follows the even-odd rule. An edge that is run along an even number of times, there or back, counts as none,
/// as ways between outlines are.
pub fn segments_around(corners: &[Place]) -> (Vec<Place>, Vec<[u32; 2]>) {
    let count = corners.len();
    let bits = |k: usize| corners[k % count].map(|s| (s + 0.0).to_bits());
    let ends = |k: usize| {
        let (one, other) = (bits(k), bits(k + 1));
        (one.min(other), one.max(other))
    };
    let mut times = BTreeMap::new();
    for k in 0..count {
        *times.entry(ends(k)).or_insert(0) += 1;
    }
    let mut taken = BTreeSet::new();
    let kept: Vec<bool> = (0..count)
        .map(|k| bits(k) != bits(k + 1) && times[&ends(k)] % 2 == 1 && taken.insert(ends(k)))
        .collect();
    // Where outlines touch in a corner, each passes a vertex of its own. A corner at an end of a way is met twice, and is one.
    let (mut vertices, mut known) = (Vec::new(), BTreeMap::new());
    let mut numbers = Vec::new();
    for k in 0..count {
        let mut add = || {
            vertices.push(corners[k]);
            vertices.len() as u32 - 1
        };
        let passes = kept[k] && kept[(k + count - 1) % count];
        numbers.push(if passes {
            add()
        } else {
            *known.entry(bits(k)).or_insert_with(add)
        });
    }
    let edges: Vec<[u32; 2]> = (0..count)
        .filter(|k| kept[*k])
        .map(|k| [numbers[k], numbers[(k + 1) % count]])
        .collect();
    let pieces = cut_at_crossings(&mut vertices, &edges);
    let turned = pieces.iter().map(|&[a, b]| {
        if inside_is_left(&pieces, &vertices, [a, b]) {
            [a, b]
        } else {
            [b, a]
        }
    });
    let segments = turned.collect();
    (vertices, segments)
}

/// Cuts edges where two of them cross: the inside changes sides there.
fn cut_at_crossings(vertices: &mut Vec<Place>, edges: &[[u32; 2]]) -> Vec<[u32; 2]> {
    let mut cuts = vec![Vec::new(); edges.len()];
    for (one, first) in edges.iter().enumerate() {
        for (other, second) in edges.iter().enumerate().skip(one + 1) {
            if let Some((along, place)) = crossing(vertices, *first, *second) {
                let number = vertices.len() as u32;
                vertices.push(place);
                cuts[one].push((along[0], number));
                cuts[other].push((along[1], number));
            }
        }
    }
    let mut pieces = Vec::with_capacity(edges.len());
    for ([start, end], mut cuts) in edges.iter().zip(cuts) {
        cuts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut from = *start;
        for (_, number) in cuts {
            pieces.push([from, number]);
            from = number;
        }
        pieces.push([from, *end]);
    }
    pieces
}

/// How far along each of two edges they cross, in (0, 1), and where; None where they do not, or only touch.
fn crossing(vertices: &[Place], one: [u32; 2], other: [u32; 2]) -> Option<([f64; 2], Place)> {
    let at = |k: u32| vertices[k as usize].map(f64::from);
    let ([a, b], [c, d]) = (one.map(at), other.map(at));
    let side = |from: [f64; 2], to: [f64; 2], x: [f64; 2]| {
        (to[0] - from[0]) * (x[1] - from[1]) - (to[1] - from[1]) * (x[0] - from[0])
    };
    let of_one = [side(c, d, a), side(c, d, b)];
    let of_other = [side(a, b, c), side(a, b, d)];
    if of_one[0] * of_one[1] >= 0.0 || of_other[0] * of_other[1] >= 0.0 {
        return None;
    }
    let along = [of_one, of_other].map(|[start, end]| start / (start - end));
    let place = [0, 1].map(|axis| (a[axis] + along[0] * (b[axis] - a[axis])) as f32);
    Some((along, place))
}

/// Whether the inside is on the left of an edge: what a ray from its middle, along the axis that is nearest to its normal, crosses.
fn inside_is_left(edges: &[[u32; 2]], vertices: &[Place], edge: [u32; 2]) -> bool {
    let at = |k: u32| vertices[k as usize].map(f64::from);
    let (a, b) = (at(edge[0]), at(edge[1]));
    let along = [b[0] - a[0], b[1] - a[1]];
    let axis = usize::from(along[0].abs() > along[1].abs());
    let across = 1 - axis;
    let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
    let crossed = edges.iter().filter(|other| {
        if **other == edge {
            return false;
        }
        let (c, d) = (at(other[0]), at(other[1]));
        let share = (middle[across] - c[across]) / (d[across] - c[across]);
        (c[across] <= middle[across]) != (d[across] <= middle[across])
            && c[axis] + share * (d[axis] - c[axis]) > middle[axis]
    });
    // The ray goes right of an edge that leads up, and left of one that leads right.
    let is_ahead = crossed.count() % 2 == 1;
    let goes_left = if axis == 0 {
        along[1] < 0.0
    } else {
        along[0] > 0.0
    };
    is_ahead == goes_left
}
