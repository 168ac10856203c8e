//! Distance to obstacles ahead of a particle; fast, since it is computed for each particle in each frame.

use crate::free_space::FreeSpace;

/// Length of sight [spacings]; farther obstacles come into sight in time.
const AHEAD: f32 = 8.0;
/// Distance of the points along a line that are looked at [spacings].
const STEP: f32 = 0.75;
/// Cells of the map for each spacing, by dimension.
const CELLS: [usize; 4] = [0, 1, 4, 2];
/// Digits of a fixed-point number behind the point.
const DIGITS: u32 = 16;

/// The obstacles of a free space, in units of its spacing and in single precision.
#[derive(Debug, Clone)]
pub struct Sight<const D: usize> {
    lower: [f32; D],
    /// Nodes per metre.
    scale: f32,
    /// Largest coordinates of a node.
    last: [f32; D],
    strides: [usize; D],
    /// Signed distance of the obstacles in each node.
    distance: Vec<f32>,
    /// Which cells of a finer grid are solid in their middle.
    solid: Vec<bool>,
    solid_strides: [usize; D],
}

impl<const D: usize> Sight<D> {
    pub fn new(space: &FreeSpace<D>) -> Self {
        let scale = 1.0 / space.spacing();
        let counts = space.counts();
        let sides = counts.map(|count| (count - 1) * CELLS[D] + 1);
        let solid_strides: [usize; D] =
            std::array::from_fn(|axis| sides[axis + 1..].iter().product());
        let solid = (0..sides.iter().product::<usize>()).map(|flat| {
            let x = std::array::from_fn(|axis| {
                let along = flat / solid_strides[axis] % sides[axis];
                space.lower()[axis] + space.spacing() * along as f64 / CELLS[D] as f64
            });
            space.distance_at(&x) < 0.0
        });
        Self {
            lower: space.lower().map(|lower| lower as f32),
            scale: scale as f32,
            last: counts.map(|count| (count - 1) as f32),
            strides: space.strides(),
            distance: space.distances().map(|d| (d * scale) as f32).collect(),
            solid: solid.collect(),
            solid_strides,
        }
    }

    /// Whether nothing solid is between two points [m], as far as is looked ahead.
    ///
    /// The sight of a particle that touches an obstacle goes past it.
    #[inline]
    pub fn reaches(&self, from: &[f32; D], to: &[f32; D]) -> bool {
        let start = self.in_grid(from);
        let goal = self.in_grid(to);
        let along: [f32; D] = std::array::from_fn(|axis| goal[axis] - start[axis]);
        let square: f32 = along.iter().map(|along| along * along).sum();
        let length = square.sqrt();
        let free = self.at_least(&start);
        if free >= length.min(AHEAD) {
            return true;
        }
        let share = (AHEAD / length).min(1.0);
        let end = std::array::from_fn(|axis| start[axis] + share * along[axis]);
        // Most lines are free because the balls around their ends are, which together are as long.
        let length = share * length;
        free.max(0.0) + self.at_least(&end) >= length || self.is_free(&start, &end, length)
    }

    /// Whether the points between two others are free; in units of the spacing, as is the distance of the two.
    ///
    /// Steps as long as the nearest obstacle is far would be fewer, but each would have to wait for the one before.
    fn is_free(&self, start: &[f32; D], end: &[f32; D], length: f32) -> bool {
        let count = (length / STEP).ceil().max(1.0);
        let unit = CELLS[D] as f32 * (1_i64 << DIGITS) as f32;
        let half = 1_i64 << (DIGITS - 1);
        let mut at: [i64; D] = std::array::from_fn(|axis| (start[axis] * unit) as i64 + half);
        let step: [i64; D] =
            std::array::from_fn(|axis| ((end[axis] - start[axis]) * unit / count) as i64);
        (1..count as u32).all(|_| {
            let mut cell = 0;
            for axis in 0..D {
                at[axis] += step[axis];
                cell += (at[axis] >> DIGITS) as usize * self.solid_strides[axis];
            }
            !self.solid[cell]
        })
    }

    /// The node nearest to a point [m].
    #[inline]
    pub fn nearest(&self, x: &[f32; D]) -> usize {
        self.node(&self.in_grid(x))
    }

    /// A point [m] in units of the spacing, moved to the edge of the grid if outside.
    #[inline]
    fn in_grid(&self, x: &[f32; D]) -> [f32; D] {
        std::array::from_fn(|axis| {
            ((x[axis] - self.lower[axis]) * self.scale).clamp(0.0, self.last[axis])
        })
    }

    #[inline]
    fn node(&self, at: &[f32; D]) -> usize {
        (0..D)
            .map(|axis| (at[axis] + 0.5) as u32 as usize * self.strides[axis])
            .sum()
    }

    /// A bound from below of the distance at a point, which is at most half a diagonal from the nearest node.
    #[inline]
    fn at_least(&self, at: &[f32; D]) -> f32 {
        self.distance[self.node(at)] - 0.5 * (D as f32).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::free_space::tests::walled_room;

    fn sight() -> Sight<2> {
        Sight::new(&walled_room())
    }

    #[test]
    fn a_wall_ahead_is_seen_and_one_far_off_is_not() {
        let sight = sight();
        assert!(!sight.reaches(&[0.45, 0.3], &[0.8, 0.3]));
        assert!(!sight.reaches(&[0.55, 0.1], &[0.1, 0.4]));
        assert!(sight.reaches(&[0.45, 0.3], &[0.2, 0.3]));
        assert!(sight.reaches(&[0.45, 0.65], &[0.8, 0.7]));
        assert!(sight.reaches(&[0.2, 0.3], &[0.8, 0.3]));
        assert!(sight.reaches(&[0.45, 0.3], &[0.46, 0.3]));
    }

    #[test]
    fn points_at_the_edge_and_beyond_are_answered() {
        let sight = sight();
        for x in [[0.0, 0.0], [1.0, 1.0], [-0.2, 0.5], [1.3, 1.2]] {
            assert!(sight.reaches(&x, &[x[0], 0.9]), "{x:?}");
        }
    }

    #[test]
    fn what_touches_a_wall_sees_away_from_it() {
        let sight = sight();
        assert!(sight.reaches(&[0.492, 0.3], &[0.2, 0.3]));
        assert!(!sight.reaches(&[0.492, 0.3], &[0.8, 0.3]));
    }
}
