//! What is right ahead of a particle. It is asked for each particle in each frame, so it is quick.

use crate::free_space::FreeSpace;

/// How far ahead is looked [spacings]; what is farther is seen in time.
const AHEAD: f32 = 8.0;
/// Shortest step along a line of sight [spacings].
const STEP: f32 = 0.5;

/// The obstacles of a free space, in units of its spacing and in single precision.
#[derive(Debug, Clone)]
pub struct Sight<const D: usize> {
    lower: [f32; D],
    /// Nodes per metre.
    scale: f32,
    /// Largest coordinates of a node, and of the lowest node of a cell.
    last: [f32; D],
    last_cell: [f32; D],
    strides: [usize; D],
    /// How far the corners of a cell are from its lowest node.
    corners: [usize; 8],
    /// Signed distance of the obstacles in each node.
    distance: Vec<f32>,
}

impl<const D: usize> Sight<D> {
    pub fn new(space: &FreeSpace<D>) -> Self {
        let (counts, strides) = (space.counts(), space.strides());
        let corner = |corner: usize| {
            (0..D)
                .filter(|&axis| corner >> axis & 1 == 1 && counts[axis] > 1)
                .map(|axis| strides[axis])
                .sum()
        };
        let scale = 1.0 / space.spacing();
        Self {
            lower: space.lower().map(|lower| lower as f32),
            scale: scale as f32,
            last: counts.map(|count| (count - 1) as f32),
            last_cell: counts.map(|count| count.saturating_sub(2) as f32),
            strides,
            corners: std::array::from_fn(corner),
            distance: space.distances().map(|d| (d * scale) as f32).collect(),
        }
    }

    /// Whether nothing solid is between two points [m], as far as is looked ahead.
    ///
    /// The steps along the line are as long as the nearest obstacle is far. A particle that touches one sees past it.
    #[inline]
    pub fn reaches(&self, from: &[f32; D], to: &[f32; D]) -> bool {
        let start: [f32; D] =
            std::array::from_fn(|axis| (from[axis] - self.lower[axis]) * self.scale);
        let along: [f32; D] = std::array::from_fn(|axis| (to[axis] - from[axis]) * self.scale);
        let square: f32 = along.iter().map(|along| along * along).sum();
        let free = self.at_least(&start);
        free >= AHEAD || (free > 0.0 && free * free >= square) || self.walk(&start, &along, square.sqrt())
    }

    /// Steps along a line from `start`, in units of the spacing.
    fn walk(&self, start: &[f32; D], along: &[f32; D], length: f32) -> bool {
        let (end, per_length) = (length.min(AHEAD), 1.0 / length.max(1e-9));
        let mut done = 0.0;
        while done < end {
            let x = std::array::from_fn(|axis| start[axis] + done * per_length * along[axis]);
            let distance = self.distance_at(&x);
            if distance < 0.0 && done > 0.0 {
                return false;
            }
            done += distance.max(STEP);
        }
        true
    }

    /// The node nearest to a point [m].
    #[inline]
    pub fn nearest(&self, x: &[f32; D]) -> usize {
        let at: [f32; D] = std::array::from_fn(|axis| (x[axis] - self.lower[axis]) * self.scale);
        self.node(&at)
    }

    #[inline]
    fn node(&self, at: &[f32; D]) -> usize {
        let mut node = 0;
        for axis in 0..D {
            node += (at[axis] + 0.5).clamp(0.0, self.last[axis]) as u32 as usize * self.strides[axis];
        }
        node
    }

    /// A bound from below of the distance at a point, which is at most half a diagonal from the nearest node.
    #[inline]
    fn at_least(&self, at: &[f32; D]) -> f32 {
        self.distance[self.node(at)] - 0.5 * (D as f32).sqrt()
    }

    /// The distance at a point, linear between nodes.
    #[inline]
    fn distance_at(&self, at: &[f32; D]) -> f32 {
        let mut base = 0;
        let mut weights = [[0.0; 2]; D];
        for axis in 0..D {
            let at = at[axis].clamp(0.0, self.last[axis]);
            let cell = (at as u32 as f32).min(self.last_cell[axis]);
            base += cell as usize * self.strides[axis];
            weights[axis] = [1.0 - (at - cell), at - cell];
        }
        let mut distance = 0.0;
        for corner in 0..1_usize << D {
            let mut weight = 1.0;
            for axis in 0..D {
                weight *= weights[axis][corner >> axis & 1];
            }
            distance += weight * self.distance[base + self.corners[corner]];
        }
        distance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A room of a metre with a wall of 2 cm at x = 0.5 from the floor up to 0.6 m.
    fn sight() -> Sight<2> {
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
        Sight::new(&FreeSpace::new([0.0; 2], spacing, [count; 2], distance).unwrap())
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
