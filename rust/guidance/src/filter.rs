//! A force as smooth as a coarse grid: from the particles to its nodes, and back.

/// Means of an acceleration, weighted by mass, in the nodes of a grid over the world; weights are linear.
///
/// First all particles `add` theirs, then `finish`, then each particle reads it `at` its place. The momentum that the
/// particles get in all is as before.
pub struct Filter<const D: usize> {
    /// Cells per metre.
    scale: f32,
    /// Largest number of a cell along each axis.
    last: [f32; D],
    /// How far the corners of a cell are from its lowest node.
    corners: [usize; 8],
    strides: [usize; D],
    /// Four numbers each, so that they are one vector: D of momentum, then the mass.
    nodes: Vec<[f32; 4]>,
}

impl<const D: usize> Filter<D> {
    /// For a world of this size [m], which begins at the origin.
    pub fn new(cells: u32, size: &[f32; D]) -> Self {
        let counts = cells_along(cells, size);
        let strides: [usize; D] = std::array::from_fn(|axis| {
            let before = counts[..axis].iter();
            before.map(|count| count + 1).product()
        });
        let corner = |corner: usize| {
            (0..D)
                .map(|axis| (corner >> axis & 1) * strides[axis])
                .sum()
        };
        Self {
            scale: cells as f32,
            last: counts.map(|count| (count - 1) as f32),
            corners: std::array::from_fn(corner),
            strides,
            nodes: vec![[0.0; 4]; counts.iter().map(|count| count + 1).product()],
        }
    }

    /// Position of a point among the nodes, moved to the edge if outside.
    #[inline]
    pub fn place(&self, x: &[f32; D]) -> Place<D> {
        let mut base = 0;
        let mut weights = [[0.0; 2]; D];
        for axis in 0..D {
            let at = (x[axis] * self.scale).clamp(0.0, self.last[axis] + 1.0);
            // Not negative, so the integer part is the floor.
            let cell = (at as u32 as f32).min(self.last[axis]);
            base += cell as usize * self.strides[axis];
            weights[axis] = [1.0 - (at - cell), at - cell];
        }
        Place { base, weights }
    }

    /// Adds the acceleration of a particle.
    #[inline]
    pub fn add(&mut self, place: &Place<D>, mass: f32, force: &[f32; D]) {
        let mut share = [0.0; 4];
        share[..D].copy_from_slice(force);
        share[D] = 1.0;
        for corner in 0..1_usize << D {
            let weight = mass * place.weight(corner);
            let node = &mut self.nodes[place.base + self.corners[corner]];
            for (sum, share) in node.iter_mut().zip(share) {
                *sum += weight * share;
            }
        }
    }

    /// Makes means of the sums.
    pub fn finish(&mut self) {
        for node in self.nodes.iter_mut().filter(|node| node[D] > 0.0) {
            let per_mass = 1.0 / node[D];
            for number in node {
                *number *= per_mass;
            }
        }
    }

    /// The mean acceleration at a place.
    #[inline]
    pub fn at(&self, place: &Place<D>) -> [f32; D] {
        let mut smooth = [0.0; 4];
        for corner in 0..1_usize << D {
            let weight = place.weight(corner);
            let node = &self.nodes[place.base + self.corners[corner]];
            for (sum, number) in smooth.iter_mut().zip(node) {
                *sum += weight * number;
            }
        }
        std::array::from_fn(|axis| smooth[axis])
    }
}

/// Number of cells along each axis of a world of this size [m].
pub fn cells_along<const D: usize>(cells: u32, size: &[f32; D]) -> [usize; D] {
    size.map(|length| ((f64::from(cells) * f64::from(length) - 1.0e-4).ceil() as usize).max(1))
}

/// Where a particle lies among the nodes.
pub struct Place<const D: usize> {
    /// The lowest node of its cell.
    base: usize,
    /// Along each axis the weights of the lower and the upper nodes.
    weights: [[f32; 2]; D],
}

impl<const D: usize> Place<D> {
    #[inline]
    fn weight(&self, corner: usize) -> f32 {
        let mut weight = 1.0;
        for axis in 0..D {
            weight *= self.weights[axis][corner >> axis & 1];
        }
        weight
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn smooth(x: &[[f32; 2]], mass: &[f32], force: &mut [[f32; 2]]) {
        let mut filter = Filter::new(32, &[1.0; 2]);
        for ((x, &mass), force) in x.iter().zip(mass).zip(&*force) {
            filter.add(&filter.place(x), mass, force);
        }
        filter.finish();
        for (x, force) in x.iter().zip(force) {
            *force = filter.at(&filter.place(x));
        }
    }

    fn cloud(count: usize) -> Vec<[f32; 2]> {
        (0..count)
            .map(|i| {
                [
                    0.2 + 0.6 * ((i * 37 % 101) as f32 / 101.0),
                    0.3 + 0.5 * ((i * 53 % 97) as f32 / 97.0),
                ]
            })
            .collect()
    }

    #[test]
    fn a_uniform_force_passes_unchanged() {
        let x = cloud(300);
        let mut force = vec![[3.0, -2.0]; 300];
        smooth(&x, &[0.5; 300], &mut force);
        assert!(
            force
                .iter()
                .all(|f| (f[0] - 3.0).abs() < 1e-5 && (f[1] + 2.0).abs() < 1e-5)
        );
    }

    #[test]
    fn momentum_is_kept_and_noise_is_lowered() {
        let x = cloud(2000);
        let mass: Vec<f32> = (0..2000).map(|i| 1.0 + (i % 3) as f32).collect();
        let noise = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut force: Vec<[f32; 2]> = (0..2000).map(|i| [5.0 + noise(i), noise(i / 2)]).collect();
        let total = |force: &[[f32; 2]]| -> f64 {
            force
                .iter()
                .zip(&mass)
                .map(|(f, &m)| f64::from(m * f[0]))
                .sum()
        };
        let before = total(&force);
        smooth(&x, &mass, &mut force);
        assert!((total(&force) - before).abs() < 1e-4 * before);
        let rough: f32 = force.iter().map(|f| (f[0] - 5.0).powi(2)).sum::<f32>() / 2000.0;
        assert!(rough < 0.5, "{rough}");
    }
}
