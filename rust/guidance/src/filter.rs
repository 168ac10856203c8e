//! A force as smooth as a coarse grid: from the particles to its nodes, and back.

/// Linear weights on a grid over the box of the particles.
#[derive(Debug, Default)]
pub struct Filter<const D: usize> {
    base: Vec<u32>,
    place: Vec<[f32; D]>,
    nodes: Vec<[f32; D]>,
    mass: Vec<f32>,
}

impl<const D: usize> Filter<D> {
    /// Replaces each particle's acceleration by that of the grid, where the momentum that they give is as before.
    ///
    /// `x` lies in [0, 1]^D; what lies outside counts as on its edge. `cells` is the number of cells per metre.
    pub fn smooth(&mut self, x: &[[f32; D]], mass: &[f32], cells: u32, force: &mut [[f32; D]]) {
        let strides: [u32; D] = std::array::from_fn(|axis| (cells + 1).pow(axis as u32));
        let corners: Vec<u32> = (0..1_usize << D)
            .map(|corner| {
                (0..D)
                    .map(|axis| (corner >> axis & 1) as u32 * strides[axis])
                    .sum()
            })
            .collect();
        let size = (cells + 1).pow(D as u32) as usize;
        self.nodes.clear();
        self.nodes.resize(size, [0.0; D]);
        self.mass.clear();
        self.mass.resize(size, 0.0);
        self.base.clear();
        self.place.clear();
        let (scale, last) = (cells as f32, (cells - 1) as f32);
        for ((x, &mass), force) in x.iter().zip(mass).zip(&*force) {
            let mut base = 0;
            let mut place = [0.0; D];
            for axis in 0..D {
                let at = (x[axis] * scale).clamp(0.0, scale);
                let cell = at.floor().min(last);
                base += cell as u32 * strides[axis];
                place[axis] = at - cell;
            }
            for (corner, step) in corners.iter().enumerate() {
                let weight = mass * weight(corner, &place);
                let node = (base + step) as usize;
                self.mass[node] += weight;
                for axis in 0..D {
                    self.nodes[node][axis] += weight * force[axis];
                }
            }
            self.base.push(base);
            self.place.push(place);
        }
        for (node, &mass) in self.nodes.iter_mut().zip(&self.mass) {
            if mass > 0.0 {
                for number in node {
                    *number /= mass;
                }
            }
        }
        for ((force, &base), place) in force.iter_mut().zip(&self.base).zip(&self.place) {
            let mut smooth = [0.0; D];
            for (corner, step) in corners.iter().enumerate() {
                let weight = weight(corner, place);
                let node = &self.nodes[(base + step) as usize];
                for axis in 0..D {
                    smooth[axis] += weight * node[axis];
                }
            }
            *force = smooth;
        }
    }
}

#[inline]
fn weight<const D: usize>(corner: usize, place: &[f32; D]) -> f32 {
    let mut weight = 1.0;
    for axis in 0..D {
        weight *= if corner >> axis & 1 == 1 {
            place[axis]
        } else {
            1.0 - place[axis]
        };
    }
    weight
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
        Filter::default().smooth(&x, &[0.5; 300], 32, &mut force);
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
        Filter::default().smooth(&x, &mass, 32, &mut force);
        assert!((total(&force) - before).abs() < 1e-4 * before);
        let rough: f32 = force.iter().map(|f| (f[0] - 5.0).powi(2)).sum::<f32>() / 2000.0;
        assert!(rough < 0.5, "{rough}");
    }
}
