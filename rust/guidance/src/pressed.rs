//! Places of a region, pressed together along its edge.
//!
//! A fluid that has splashed contains voids, which closing needs pressure. Places that fill a region evenly exert none,
//! so that fluid stays outside of it. Those near to the edge are therefore moved inwards: up the gradient of a mean of
//! the region over its surroundings.

use crate::silhouette::{Filling, SEAMS, root};

/// Displacement of places at a straight edge, over the distance of particles at rest, by dimension. In 3D shapes are few
/// grid cells thick.
const DISPLACEMENT: [f64; 4] = [0.0, 0.0, 5.0, 1.5];
/// Width of the mean, likewise.
const WIDTH: [f64; 4] = [0.0, 0.0, 8.0, 4.0];
/// Decrease of the displacement with the volume of the region, over that which the fluid fills.
const LOOSENS: f64 = 4.0;
/// Steepest part of the integral of a Gaussian.
const STEEPEST: f64 = 0.4;
/// Means of means, near to a Gaussian.
const PASSES: usize = 2;

impl<const D: usize> Filling<D> {
    /// The cells of a region that the fluid is to fill, moved inwards from its edges. `free` says which points no
    /// obstacle takes; edges at walls and obstacles do not count.
    pub fn pressed<E>(
        &self,
        cells: &[[f64; D]],
        side: f64,
        free: impl Fn(&[[f64; D]]) -> Result<Vec<bool>, E>,
    ) -> Result<Vec<[f64; D]>, E> {
        let spacing = root::<D>(self.volume / self.particles as f64);
        let fullness = cells.len() as f64 * side.powi(D as i32) / (SEAMS[D] * self.volume);
        let share = (1.0 - LOOSENS * (fullness - 1.0)).clamp(0.0, 1.0);
        if share <= 0.0 {
            return Ok(cells.to_vec());
        }
        let half = ((WIDTH[D] * spacing / side / 2.0).round() as usize).max(1);
        let raster = Raster::around(cells, side, PASSES * half + 2);
        let mut mean = raster.filled(cells, self, free)?;
        for _ in 0..PASSES {
            raster.average(&mut mean, half);
        }
        let across = (2 * half + 1) as f64;
        let deviation = (PASSES as f64 * (across * across - 1.0) / 12.0).sqrt();
        let size = share * DISPLACEMENT[D] * spacing * deviation / STEEPEST;
        let moved = |cell: &[f64; D]| -> [f64; D] {
            let index = raster.index(cell);
            std::array::from_fn(|axis| {
                let step = raster.steps[axis];
                cell[axis] + size * (mean[index + step] - mean[index - step]) / 2.0
            })
        };
        Ok(cells.iter().map(moved).collect())
    }
}

/// A box of cells around others.
struct Raster<const D: usize> {
    /// Centre of the first one [m].
    first: [f64; D],
    side: f64,
    counts: [usize; D],
    /// Distance of neighbours along each axis in one row of all.
    steps: [usize; D],
}

impl<const D: usize> Raster<D> {
    fn around(cells: &[[f64; D]], side: f64, margin: usize) -> Self {
        let along = |better: fn(f64, f64) -> f64| -> [f64; D] {
            std::array::from_fn(|axis| cells.iter().map(|x| x[axis]).reduce(better).unwrap_or(0.0))
        };
        let (low, high) = (along(f64::min), along(f64::max));
        let first = low.map(|low| low - margin as f64 * side);
        let counts: [usize; D] = std::array::from_fn(|axis| {
            ((high[axis] - low[axis]) / side).round() as usize + 1 + 2 * margin
        });
        let steps = std::array::from_fn(|axis| counts[axis + 1..].iter().product());
        Self {
            first,
            side,
            counts,
            steps,
        }
    }

    fn index(&self, x: &[f64; D]) -> usize {
        let along = |axis: usize| ((x[axis] - self.first[axis]) / self.side).round() as usize;
        (0..D).map(|axis| along(axis) * self.steps[axis]).sum()
    }

    fn center(&self, index: usize) -> [f64; D] {
        std::array::from_fn(|axis| {
            let along = index / self.steps[axis] % self.counts[axis];
            self.first[axis] + along as f64 * self.side
        })
    }

    /// 1 in the cells, and where walls and obstacles are; else 0.
    fn filled<E>(
        &self,
        cells: &[[f64; D]],
        filling: &Filling<D>,
        free: impl Fn(&[[f64; D]]) -> Result<Vec<bool>, E>,
    ) -> Result<Vec<f64>, E> {
        let mut filled = vec![1.0; self.counts.iter().product()];
        let [lower, upper] = filling.walls;
        let within =
            |x: &[f64; D]| (0..D).all(|axis| lower[axis] <= x[axis] && x[axis] <= upper[axis]);
        let (places, centers): (Vec<usize>, Vec<[f64; D]>) = (0..filled.len())
            .map(|index| (index, self.center(index)))
            .filter(|(_, x)| within(x))
            .unzip();
        for (index, is_free) in places.into_iter().zip(free(&centers)?) {
            if is_free {
                filled[index] = 0.0;
            }
        }
        for cell in cells {
            filled[self.index(cell)] = 1.0;
        }
        Ok(filled)
    }

    /// Replaces values by their means over boxes that reach so many cells to each side.
    fn average(&self, values: &mut [f64], half: usize) {
        for axis in 0..D {
            let (count, step) = (self.counts[axis], self.steps[axis]);
            let mut sums = vec![0.0; count + 1];
            for start in 0..values.len() {
                if start / step % count != 0 {
                    continue;
                }
                for along in 0..count {
                    sums[along + 1] = sums[along] + values[start + along * step];
                }
                for along in 0..count {
                    let (low, high) = (along.saturating_sub(half), (along + half + 1).min(count));
                    values[start + along * step] = (sums[high] - sums[low]) / (2 * half + 1) as f64;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;

    const SIDE: f64 = 0.002;

    fn rows() -> Vec<[f64; 2]> {
        let lattice = (0..100).flat_map(|i| (0..100).map(move |j| [i, j]));
        lattice
            .map(|at| at.map(|along| 0.4 + SIDE * (f64::from(along) + 0.5)))
            .collect()
    }

    fn pressed(volume: f64, walls: [[f64; 2]; 2], free: fn(&[f64; 2]) -> bool) -> Vec<[f64; 2]> {
        let filling = Filling {
            walls,
            volume,
            particles: 1500,
            shrinks: false,
        };
        let all = |x: &[[f64; 2]]| Ok::<_, Infallible>(x.iter().map(free).collect());
        filling.pressed(&rows(), SIDE, all).unwrap()
    }

    #[test]
    fn places_at_an_edge_move_inwards_and_keep_their_middle() {
        let (full, walls) = (0.04 / SEAMS[2], [[0.1; 2], [0.9; 2]]);
        let spacing = (full / 1500.0).sqrt();
        let moved = pressed(full, walls, |_| true);
        let [edge, deep] = [0.0, 0.05].map(|depth| {
            let near = |x: &&([f64; 2], [f64; 2])| {
                (x.0[0] - 0.4 - depth).abs() < SIDE && (x.0[1] - 0.5).abs() < SIDE
            };
            let both: Vec<_> = rows().into_iter().zip(moved.clone()).collect();
            let (before, after) = *both.iter().find(near).unwrap();
            (after[0] - before[0]) / spacing
        });
        assert!((edge - DISPLACEMENT[2]).abs() < 0.3, "{edge}");
        assert!(deep.abs() < 0.05, "{deep}");
        let mean = moved.iter().map(|x| x[0]).sum::<f64>() / 1e4;
        assert!((mean - 0.5).abs() < 1e-9, "{mean}");
    }

    #[test]
    fn walls_and_obstacles_are_no_edges_and_what_is_loose_is_not_pressed() {
        let full = 0.04 / SEAMS[2];
        let leftmost = |cells: Vec<[f64; 2]>| {
            let middle = cells.into_iter().filter(|x| (x[1] - 0.5).abs() < SIDE);
            middle.map(|x| x[0]).fold(1.0, f64::min)
        };
        let start = 0.4 + SIDE / 2.0;
        let walls = [[0.4, 0.1], [0.9; 2]];
        assert!((leftmost(pressed(full, walls, |_| true)) - start).abs() < 1e-12);
        let walls = [[0.1; 2], [0.9; 2]];
        assert!((leftmost(pressed(full, walls, |x| x[0] > 0.4)) - start).abs() < 1e-12);
        assert!(leftmost(pressed(full, walls, |_| true)) > start + 0.01);
        assert_eq!(pressed(full / 1.3, walls, |_| true), rows());
    }
}
