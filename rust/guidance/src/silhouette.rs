//! The region of a shape or a solid that a fluid is to fill.

use crate::outlines::Outlines;

/// Volume of a shape over that of the fluid that fills it, by dimension. Parts of a fluid that meet stay about one grid
/// cell apart, and the parts of a shape meet along longer lines than those of an oval.
pub const SEAMS: [f64; 4] = [1.0, 1.0, 1.08, 1.15];
/// Cells of the raster for each particle; places are centres of groups of cells.
const CELLS_PER_PARTICLE: f64 = 6.0;
/// Sizes of a shape that are tried until walls and obstacles leave it room for the fluid.
const TRIES: usize = 16;
/// Share of the cells by which a shape may miss the fluid's volume.
const CLOSE: f64 = 0.005;

/// A shape in 2D; in 3D a body of the same section at all depths of an interval.
#[derive(Debug)]
pub struct Silhouette<'a> {
    pub outlines: &'a Outlines,
    /// Middle and half length of the interval along the depth [m]; None in 2D.
    pub depth: Option<[f64; 2]>,
}

/// What a fluid that fills something takes.
#[derive(Clone, Copy, Debug)]
pub struct Filling<const D: usize> {
    /// Lower and upper corner of the walls [m].
    pub walls: [[f64; D]; 2],
    /// Volume at rest [m^D].
    pub volume: f64,
    /// Number of particles.
    pub particles: usize,
    /// Whether what is larger than the fluid is shrunk to it, instead of filled evenly.
    pub shrinks: bool,
}

/// Where something lies that a fluid is to fill.
#[derive(Clone, Copy, Debug)]
pub struct Extent<const D: usize> {
    /// Centre from which it grows [m].
    pub center: [f64; D],
    /// Lower and upper corner of the box around it [m].
    pub bounds: [[f64; D]; 2],
    /// Volume [m^D].
    pub volume: f64,
}

/// Cells all over a box.
#[derive(Clone, Debug)]
pub struct Lattice<const D: usize> {
    /// Lower corner of the first cell [m].
    pub lower: [f64; D],
    /// Side of a cell [m].
    pub side: f64,
    /// Number of cells along each axis.
    pub counts: [usize; D],
    /// Centres of the cells, those along the last axis first [m].
    pub centers: Vec<[f64; D]>,
}

/// The part of something that is filled, at its final size.
#[derive(Debug)]
pub struct Filled<const D: usize> {
    /// Centres of equal cells that make up the region [m].
    pub cells: Vec<[f64; D]>,
    /// Side of a cell [m].
    pub side: f64,
    /// Factor on the size: above 1 where the shape was grown to the fluid's volume.
    pub scale: f64,
}

impl Silhouette<'_> {
    fn extent<const D: usize>(&self) -> Extent<D> {
        let [middle, half] = self.depth.unwrap_or([0.0; 2]);
        let [x, y] = self.outlines.center;
        let [low, high] = self.outlines.bounds;
        let [center, low, high] = [
            [x, y, middle],
            [low[0], low[1], middle - half],
            [high[0], high[1], middle + half],
        ]
        .map(|point| std::array::from_fn(|axis| point[axis]));
        Extent {
            center,
            bounds: [low, high],
            volume: self.outlines.area * self.depth.map_or(1.0, |depth| 2.0 * depth[1]),
        }
    }

    /// Which points lie in the silhouette grown by a factor from its centre.
    pub fn covers<const D: usize>(&self, points: &[[f64; D]], scale: f64) -> Vec<bool> {
        let center = self.extent::<D>().center;
        let at_rest = |axis: usize, x: &[f64; D]| center[axis] + (x[axis] - center[axis]) / scale;
        let front: Vec<_> = points
            .iter()
            .map(|x| [at_rest(0, x), at_rest(1, x)])
            .collect();
        let mut inside = self.outlines.covers(&front);
        if let Some([middle, half]) = self.depth {
            for (inside, x) in inside.iter_mut().zip(points) {
                *inside &= (at_rest(D - 1, x) - middle).abs() <= half;
            }
        }
        inside
    }

    /// Cells for a fluid, as of `Extent::filled`.
    pub fn filled<const D: usize, E>(
        &self,
        fluid: Filling<D>,
        free: impl Fn(&[[f64; D]]) -> Result<Vec<bool>, E>,
    ) -> Result<Filled<D>, E> {
        let covers = |cells: &Lattice<D>, scale: f64| Ok(self.covers(&cells.centers, scale));
        self.extent().filled(fluid, covers, free)
    }
}

impl<const D: usize> Extent<D> {
    /// Cells for a fluid. `covers` says which centres of cells are inside after growth by a factor from the centre, and
    /// `free` which of them no obstacle takes.
    ///
    /// Where the free part is smaller than the fluid, the whole grows, with its holes, until that part is as large.
    /// Where it is larger, it is filled evenly, or shrunk.
    pub fn filled<E>(
        &self,
        fluid: Filling<D>,
        covers: impl Fn(&Lattice<D>, f64) -> Result<Vec<bool>, E>,
        free: impl Fn(&[[f64; D]]) -> Result<Vec<bool>, E>,
    ) -> Result<Filled<D>, E> {
        let Filling {
            walls: [lower, upper],
            particles,
            shrinks,
            ..
        } = fluid;
        let volume = fluid.volume * SEAMS[D];
        let wanted = volume.max(if shrinks { 0.0 } else { self.volume });
        let side = root::<D>(wanted / (CELLS_PER_PARTICLE * particles as f64));
        let cell = side.powi(D as i32);
        let needed = (volume / cell).round_ties_even().max(1.0);
        let cells = |scale: f64| -> Result<Vec<[f64; D]>, E> {
            let lattice = self.lattice([lower, upper], side, scale);
            let within =
                |x: &[f64; D]| (0..D).all(|axis| lower[axis] <= x[axis] && x[axis] <= upper[axis]);
            let covered = covers(&lattice, scale)?;
            let covered = lattice.centers.into_iter().zip(covered);
            let cells: Vec<_> = covered
                .filter_map(|(x, covered)| (covered && within(&x)).then_some(x))
                .collect();
            let is_free = free(&cells)?;
            let cells = cells.into_iter().zip(is_free);
            Ok(cells
                .filter_map(|(x, is_free)| is_free.then_some(x))
                .collect())
        };
        let mut scale = root::<D>(needed * cell / self.volume);
        if !shrinks && scale < 1.0 + CLOSE {
            scale = 1.0;
        }
        let smallest = scale;
        let mut found = cells(scale)?;
        for _ in 0..TRIES {
            let missing = needed - found.len() as f64;
            let close = CLOSE * needed;
            if missing <= close && (scale == smallest || -missing <= close) {
                break;
            }
            let there = (found.len() as f64).max(needed / 4.0);
            scale = smallest.max(scale * root::<D>(needed / there));
            found = cells(scale)?;
        }
        Ok(Filled {
            cells: found,
            side,
            scale,
        })
    }

    /// Centres of cells in the box around it after growth by a factor; their lattice begins at the walls.
    fn lattice(&self, [lower, upper]: [[f64; D]; 2], side: f64, scale: f64) -> Lattice<D> {
        let center = self.center;
        let (mut from, mut counts) = ([0.0; D], [0; D]);
        let mut centers = vec![[0.0; D]];
        for axis in 0..D {
            let [low, high] =
                (self.bounds).map(|end| center[axis] + scale * (end[axis] - center[axis]));
            let first = ((low.max(lower[axis]) - lower[axis]) / side).floor() as i64;
            let last = ((high.min(upper[axis]) - lower[axis]) / side).ceil() as i64;
            let along = |index: i64| lower[axis] + side * (index as f64 + 0.5);
            from[axis] = lower[axis] + side * first as f64;
            counts[axis] = usize::try_from(last - first).unwrap_or(0);
            centers = centers
                .into_iter()
                .flat_map(|x| {
                    (first..last).map(move |index| {
                        let mut x = x;
                        x[axis] = along(index);
                        x
                    })
                })
                .collect();
        }
        Lattice {
            lower: from,
            side,
            counts,
            centers,
        }
    }
}

/// Root of order D. That of order 2 is the same on all machines.
pub(crate) fn root<const D: usize>(number: f64) -> f64 {
    if D == 2 {
        number.sqrt()
    } else {
        number.powf(1.0 / D as f64)
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;

    const WALLS: [[f64; 2]; 2] = [[0.1; 2], [0.9; 2]];

    fn square() -> Outlines {
        Outlines::new(&[vec![[0.4, 0.4], [0.6, 0.4], [0.6, 0.6], [0.4, 0.6]]])
    }

    fn filled(volume: f64, shrinks: bool, free: fn(&[f64; 2]) -> bool) -> Filled<2> {
        let (outlines, depth) = (square(), None);
        let silhouette = Silhouette {
            outlines: &outlines,
            depth,
        };
        let all = |x: &[[f64; 2]]| Ok::<_, Infallible>(x.iter().map(free).collect());
        let fluid = Filling {
            walls: WALLS,
            volume,
            particles: 400,
            shrinks,
        };
        silhouette.filled(fluid, all).unwrap()
    }

    #[test]
    fn a_shape_grows_to_the_fluid_and_is_filled_where_it_is_larger() {
        for (volume, shrinks, scale) in [
            (0.16, false, (1.08_f64 * 4.0).sqrt()),
            (0.02, false, 1.0),
            (0.02, true, (1.08_f64 / 2.0).sqrt()),
        ] {
            let found = filled(volume, shrinks, |_| true);
            assert!((found.scale - scale).abs() < 0.02, "{}", found.scale);
            let area = found.cells.len() as f64 * found.side.powi(2);
            assert!((area - 0.04 * scale * scale).abs() < 0.03 * area, "{area}");
        }
    }

    #[test]
    fn a_shape_grows_until_its_free_part_is_large_enough() {
        let found = filled(0.03, false, |x| x[0] > 0.5);
        let area = found.cells.len() as f64 * found.side.powi(2);
        assert!((area - 1.08 * 0.03).abs() < 0.01 * area, "{area}");
        assert!(found.cells.iter().all(|x| x[0] > 0.5));
    }

    #[test]
    fn a_silhouette_in_space_has_the_same_section_at_all_its_depths() {
        let outlines = square();
        let silhouette = Silhouette {
            outlines: &outlines,
            depth: Some([0.5, 0.1]),
        };
        let points = [[0.5, 0.5, 0.55], [0.5, 0.5, 0.65], [0.7, 0.5, 0.5]];
        assert_eq!(silhouette.covers(&points, 1.0), [true, false, false]);
        assert_eq!(silhouette.covers(&points, 2.5), [true; 3]);
    }
}
