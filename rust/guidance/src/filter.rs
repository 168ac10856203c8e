//! A force as smooth as a coarse grid: from the particles to its nodes, and back.

/// Replaces each particle's acceleration by that of the grid; the momentum that they give is as before.
///
/// `x` lies in [0, 1]^D; what lies outside counts as on its edge. `cells` is the number of cells per metre. Weights
/// are linear.
pub fn smooth<const D: usize>(x: &[[f32; D]], mass: &[f32], cells: u32, force: &mut [[f32; D]]) {
    let strides: [usize; D] = std::array::from_fn(|axis| (cells as usize + 1).pow(axis as u32));
    let mut nodes = vec![Node::<D>::EMPTY; (cells as usize + 1).pow(D as u32)];
    let (scale, last) = (cells as f32, (cells - 1) as f32);
    let places: Vec<Place<D>> = x
        .iter()
        .map(|x| Place::of(x, scale, last, &strides))
        .collect();
    for ((place, &mass), force) in places.iter().zip(mass).zip(&*force) {
        for corner in 0..1_usize << D {
            let weight = mass * place.weight(corner);
            let node = &mut nodes[place.node(corner, &strides)];
            node.mass += weight;
            for axis in 0..D {
                node.momentum[axis] += weight * force[axis];
            }
        }
    }
    for node in nodes.iter_mut().filter(|node| node.mass > 0.0) {
        for axis in 0..D {
            node.momentum[axis] /= node.mass;
        }
    }
    for (place, force) in places.iter().zip(force) {
        let mut smooth = [0.0; D];
        for corner in 0..1_usize << D {
            let weight = place.weight(corner);
            let node = &nodes[place.node(corner, &strides)];
            for axis in 0..D {
                smooth[axis] += weight * node.momentum[axis];
            }
        }
        *force = smooth;
    }
}

/// What the particles give to a node; the momentum then becomes the mean acceleration.
#[derive(Clone, Copy)]
struct Node<const D: usize> {
    momentum: [f32; D],
    mass: f32,
}

impl<const D: usize> Node<D> {
    const EMPTY: Self = Self {
        momentum: [0.0; D],
        mass: 0.0,
    };
}

/// Where a particle lies among the nodes.
struct Place<const D: usize> {
    base: usize,
    /// Along each axis the weights of the lower and the upper nodes.
    weights: [[f32; 2]; D],
}

impl<const D: usize> Place<D> {
    #[inline]
    fn of(x: &[f32; D], scale: f32, last: f32, strides: &[usize; D]) -> Self {
        let mut base = 0;
        let mut weights = [[0.0; 2]; D];
        for axis in 0..D {
            let at = (x[axis] * scale).clamp(0.0, scale);
            // Not negative, so the integer part is the floor.
            let cell = (at as u32 as f32).min(last);
            base += cell as usize * strides[axis];
            weights[axis] = [1.0 - (at - cell), at - cell];
        }
        Self { base, weights }
    }

    #[inline]
    fn weight(&self, corner: usize) -> f32 {
        let mut weight = 1.0;
        for axis in 0..D {
            weight *= self.weights[axis][corner >> axis & 1];
        }
        weight
    }

    #[inline]
    fn node(&self, corner: usize, strides: &[usize; D]) -> usize {
        let mut node = self.base;
        for axis in 0..D {
            node += (corner >> axis & 1) * strides[axis];
        }
        node
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        smooth(&x, &[0.5; 300], 32, &mut force);
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
        smooth(&x, &mass, 32, &mut force);
        assert!((total(&force) - before).abs() < 1e-4 * before);
        let rough: f32 = force.iter().map(|f| (f[0] - 5.0).powi(2)).sum::<f32>() / 2000.0;
        assert!(rough < 0.5, "{rough}");
    }
}
