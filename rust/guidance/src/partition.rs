//! Division of points into compact parts of equal size.

use std::ops::Range;

/// Orders the points by the cells of a k-d tree, and returns the `parts` ranges of these.
///
/// A range has floor(n / parts) points or one more. Consecutive ranges are neighbours in the tree.
/// Cuts are across the longest side of the box around the points; equal coordinates are ordered by index.
pub fn divide<const D: usize>(
    points: &[[f64; D]],
    order: &mut [usize],
    parts: usize,
) -> Vec<Range<usize>> {
    let mut ranges = Vec::with_capacity(parts);
    cut(points, order, 0, parts, &mut ranges);
    ranges
}

fn cut<const D: usize>(
    points: &[[f64; D]],
    order: &mut [usize],
    first: usize,
    parts: usize,
    ranges: &mut Vec<Range<usize>>,
) {
    if parts == 1 {
        ranges.push(first..first + order.len());
        return;
    }
    let left_parts = parts / 2;
    let left = (order.len() * left_parts + parts / 2) / parts;
    if left > 0 && left < order.len() {
        let axis = longest_side(points, order);
        order.select_nth_unstable_by(left, |&a, &b| {
            points[a][axis].total_cmp(&points[b][axis]).then(a.cmp(&b))
        });
    }
    let (before, after) = order.split_at_mut(left);
    cut(points, before, first, left_parts, ranges);
    cut(points, after, first + left, parts - left_parts, ranges);
}

fn longest_side<const D: usize>(points: &[[f64; D]], order: &[usize]) -> usize {
    let side = |axis: usize| {
        let (low, high) = order
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &point| {
                (low.min(points[point][axis]), high.max(points[point][axis]))
            });
        high - low
    };
    let sides: [f64; D] = std::array::from_fn(side);
    (1..D).fold(0, |best, axis| {
        if sides[axis] > sides[best] {
            axis
        } else {
            best
        }
    })
}

/// Mean of the points that `members` name.
pub fn mean<const D: usize>(points: &[[f64; D]], members: &[usize]) -> [f64; D] {
    let count = members.len().max(1) as f64;
    std::array::from_fn(|axis| {
        members
            .iter()
            .map(|&member| points[member][axis])
            .sum::<f64>()
            / count
    })
}

/// Square of the distance between two points.
pub fn square_distance<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    (0..D).map(|axis| (a[axis] - b[axis]).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_differ_by_at_most_one_point_and_hold_each_point_once() {
        for count in 1..60_usize {
            let points: Vec<[f64; 2]> = (0..count)
                .map(|i| [((i * 37) % 23) as f64, ((i * 11) % 19) as f64])
                .collect();
            for parts in 1..=count {
                let mut order: Vec<usize> = (0..count).collect();
                let ranges = divide(&points, &mut order, parts);
                assert_eq!(ranges.len(), parts);
                assert!(
                    ranges
                        .iter()
                        .all(|r| r.len() == count / parts || r.len() == count.div_ceil(parts))
                );
                order.sort_unstable();
                assert_eq!(order, (0..count).collect::<Vec<_>>());
            }
        }
    }
}
