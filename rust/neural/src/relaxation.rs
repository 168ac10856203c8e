//! Relaxation of density along the edges of a graph, as in Neural SPH (Toshev et al. 2024, arXiv:2402.06275).

/// Added under the root, so that coincident points have a direction, if none that matters.
const SMALLEST: f32 = 1e-12;

/// How points that have crowded together push each other apart. The kernel is (1 - d/R)^2.
#[derive(Debug, Clone, Copy)]
pub struct Relaxation<const D: usize> {
    /// Radius of the graph, R [m].
    pub radius: f32,
    /// Sum of the kernel over the neighbours of a point at rest; above 0.
    pub rest_density: f32,
    /// Displacement over R that one neighbour at distance 0 gives at twice the density of rest.
    pub strength: f32,
    /// How often densities are computed and points moved.
    pub rounds: usize,
    /// Corners of the box that nothing leaves [m].
    pub lower: [f32; D],
    pub upper: [f32; D],
}

impl<const D: usize> Relaxation<D> {
    /// Moves each point by its `answer_weight` times the displacement. Edges are ordered by receiver: those into
    /// point i come from `senders[starts[i]..starts[i + 1]]`.
    pub fn apply(
        &self,
        x: &mut [[f32; D]],
        answer_weight: &[f32],
        starts: &[u32],
        senders: &[u32],
    ) {
        let mut excess = vec![0.0; x.len()];
        for _ in 0..self.rounds {
            let into = |point: usize| {
                let edges = starts[point] as usize..starts[point + 1] as usize;
                senders[edges].iter().map(|&sender| sender as usize)
            };
            for (point, excess) in excess.iter_mut().enumerate() {
                let density: f32 = into(point)
                    .map(|sender| self.pair(&x[sender], &x[point]).near.powi(2))
                    .sum();
                *excess = (density / self.rest_density - 1.0).max(0.0);
            }
            let before = x.to_vec();
            for point in (0..x.len()).filter(|&point| answer_weight[point] != 0.0) {
                let mut push = [0.0; D];
                for sender in into(point) {
                    let both = excess[sender] + excess[point];
                    let pair = self.pair(&before[sender], &before[point]);
                    // Points out of reach do not act, also where their place is no number.
                    if both * pair.near == 0.0 {
                        continue;
                    }
                    let size = both * pair.near / pair.distance;
                    for (push, offset) in push.iter_mut().zip(pair.offset) {
                        *push -= size * offset;
                    }
                }
                let length = answer_weight[point] * (0.5 * self.strength * self.radius);
                for axis in 0..D {
                    let moved = x[point][axis] + push[axis] * length;
                    // Not `max` and `min`, which would put NaN on a wall.
                    x[point][axis] = moved.clamp(self.lower[axis], self.upper[axis]);
                }
            }
        }
    }

    fn pair(&self, sender: &[f32; D], receiver: &[f32; D]) -> Pair<D> {
        let offset: [f32; D] =
            std::array::from_fn(|axis| (sender[axis] - receiver[axis]) / self.radius);
        let square: f32 = offset.iter().map(|number| number * number).sum();
        let distance = (square + SMALLEST).sqrt();
        Pair {
            offset,
            distance,
            near: (1.0 - distance).max(0.0),
        }
    }
}

/// A pair of points: the way from receiver to sender, in radii.
struct Pair<const D: usize> {
    offset: [f32; D],
    distance: f32,
    near: f32,
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: Relaxation<2> = Relaxation {
        radius: 0.1,
        rest_density: 0.25,
        strength: 0.15,
        rounds: 1,
        lower: [0.0; 2],
        upper: [1.0; 2],
    };

    /// Two points half a radius apart or less have twice the density of rest or more.
    fn pair(distance: f32) -> [[f32; 2]; 2] {
        [[0.5, 0.5], [0.5 + distance, 0.5]]
    }

    #[test]
    fn points_at_rest_stay() {
        let mut x = pair(0.05);
        SETTINGS.apply(&mut x, &[1.0; 2], &[0, 1, 2], &[1, 0]);
        assert_eq!(x, pair(0.05));
    }

    #[test]
    fn crowded_points_part_evenly_and_as_far_as_the_formula_says() {
        let mut x = pair(0.02);
        SETTINGS.apply(&mut x, &[1.0; 2], &[0, 1, 2], &[1, 0]);
        // near = 0.8, density 0.64, excess 1.56 each; the push is 2 * 1.56 * 0.8 * 0.5 * 0.15 * 0.1.
        let moved = 2.0 * 1.56 * 0.8 * 0.0075;
        assert!((x[1][0] - 0.52 - moved).abs() < 1e-6, "{x:?}");
        assert!((x[0][0] - 0.5 + moved).abs() < 1e-6, "{x:?}");
        assert_eq!((x[0][1], x[1][1]), (0.5, 0.5));
    }

    #[test]
    fn points_without_weight_and_walls_hold() {
        let mut x = pair(0.02);
        let narrow = Relaxation {
            upper: [0.521, 1.0],
            ..SETTINGS
        };
        narrow.apply(&mut x, &[0.0, 1.0], &[0, 1, 2], &[1, 0]);
        assert_eq!(x, [[0.5, 0.5], [0.521, 0.5]]);
    }

    #[test]
    fn nan_stays_where_it_is() {
        let mut x = [[0.5, 0.5], [f32::NAN, 0.5], [0.51, 0.5]];
        SETTINGS.apply(&mut x, &[1.0; 3], &[0, 2, 4, 6], &[1, 2, 0, 2, 0, 1]);
        assert!(x[1][0].is_nan());
        assert!(x[0][0] < 0.5 && x[2][0] > 0.51, "{x:?}");
    }
}
