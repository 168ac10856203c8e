//! Fixed-radius neighbour graph in 2D and 3D by a cell list.
//!
//! Exact, without a cap on the number of neighbours, and the same for the same input: edges are ordered by
//! receiver, then by sender.

use nalgebra::SVector;
use thiserror::Error;

/// Why a graph could not be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GraphError {
    /// The radius is no length.
    #[error("radius must be finite and > 0 m, got {0}")]
    Radius(f32),
    /// A point has no place.
    #[error("x[{index}] must be finite, got {position:?}")]
    Position { index: usize, position: Vec<f32> },
}

/// Edges from sender to receiver, in compressed rows by receiver.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RadiusGraph {
    /// The edges into point i are `senders[starts[i]..starts[i + 1]]`.
    pub starts: Vec<u32>,
    /// Ascending within a receiver; a point is no neighbour of itself.
    pub senders: Vec<u32>,
}

/// Cells along an axis at most; a smaller radius than the extent over this shares cells.
const MOST_CELLS: f32 = 1024.0;

/// Joins all pairs of points at most `radius` apart (`<=`), in both directions.
pub fn radius_graph<const D: usize>(
    points: &[SVector<f32, D>],
    radius: f32,
) -> Result<RadiusGraph, GraphError> {
    if !(radius > 0.0 && radius.is_finite()) {
        return Err(GraphError::Radius(radius));
    }
    if let Some((index, p)) = points
        .iter()
        .enumerate()
        .find(|(_, p)| !p.iter().all(|s| s.is_finite()))
    {
        return Err(GraphError::Position {
            index,
            position: p.as_slice().to_vec(),
        });
    }
    let cells = CellList::new(points, radius);
    let mut graph = RadiusGraph {
        starts: vec![0],
        senders: Vec::new(),
    };
    let radius_squared = f64::from(radius).powi(2);
    for (receiver, x) in points.iter().enumerate() {
        let first = graph.senders.len();
        cells.visit(x, |sender| {
            if sender as usize != receiver
                && distance_squared(x, &points[sender as usize]) <= radius_squared
            {
                graph.senders.push(sender);
            }
        });
        graph.senders[first..].sort_unstable();
        graph.starts.push(graph.senders.len() as u32);
    }
    Ok(graph)
}

/// In double precision, so that the answer is the same from both ends and at the radius itself.
fn distance_squared<const D: usize>(a: &SVector<f32, D>, b: &SVector<f32, D>) -> f64 {
    (0..D)
        .map(|axis| (f64::from(a[axis]) - f64::from(b[axis])).powi(2))
        .sum()
}

/// Points sorted into cells no smaller than the radius.
struct CellList<const D: usize> {
    lower: SVector<f32, D>,
    per_metre: f32,
    extent: [usize; D],
    /// Points of cell c are `order[starts[c]..starts[c + 1]]`.
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl<const D: usize> CellList<D> {
    fn new(points: &[SVector<f32, D>], radius: f32) -> Self {
        let start = points.first().copied().unwrap_or_else(SVector::zeros);
        let lower = points.iter().fold(start, |low, p| low.inf(p));
        let upper = points.iter().fold(start, |high, p| high.sup(p));
        let span = (upper - lower).max();
        // A hair wider than the radius: rounding of the cell index must not lose a neighbour. And not
        // many more cells than points.
        let finest = (points.len() as f32)
            .powf(1.0 / D as f32)
            .ceil()
            .clamp(1.0, MOST_CELLS);
        let size = (radius * 1.0001).max(span / finest);
        let mut list = Self {
            lower,
            per_metre: 1.0 / size,
            extent: [1; D],
            starts: Vec::new(),
            order: vec![0; points.len()],
        };
        let top = list.coordinates(&upper);
        list.extent = top.map(|coordinate| coordinate + 1);
        let keys: Vec<usize> = points
            .iter()
            .map(|p| list.index(list.coordinates(p)))
            .collect();
        let mut starts = vec![0u32; list.extent.iter().product::<usize>() + 1];
        for &key in &keys {
            starts[key + 1] += 1;
        }
        for cell in 1..starts.len() {
            starts[cell] += starts[cell - 1];
        }
        let mut next = starts.clone();
        for (point, &key) in keys.iter().enumerate() {
            list.order[next[key] as usize] = point as u32;
            next[key] += 1;
        }
        list.starts = starts;
        list
    }

    fn coordinates(&self, x: &SVector<f32, D>) -> [usize; D] {
        std::array::from_fn(|axis| ((x[axis] - self.lower[axis]) * self.per_metre) as usize)
    }

    fn index(&self, cell: [usize; D]) -> usize {
        cell.iter()
            .zip(self.extent)
            .fold(0, |index, (coordinate, extent)| index * extent + coordinate)
    }

    /// Calls back with every point of the 3^D cells around x.
    fn visit(&self, x: &SVector<f32, D>, mut with: impl FnMut(u32)) {
        let centre = self.coordinates(x);
        for flat in 0..3usize.pow(D as u32) {
            let mut cell = [0; D];
            let mut rest = flat;
            let inside = (0..D).all(|axis| {
                let coordinate = centre[axis] + rest % 3;
                rest /= 3;
                cell[axis] = coordinate.wrapping_sub(1);
                (1..=self.extent[axis]).contains(&coordinate)
            });
            if inside {
                let cell = self.index(cell);
                self.order[self.starts[cell] as usize..self.starts[cell + 1] as usize]
                    .iter()
                    .for_each(|&point| with(point));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute_force<const D: usize>(points: &[SVector<f32, D>], radius: f32) -> RadiusGraph {
        let mut graph = RadiusGraph {
            starts: vec![0],
            senders: Vec::new(),
        };
        for (i, a) in points.iter().enumerate() {
            graph.senders.extend((0..points.len() as u32).filter(|&j| {
                j as usize != i
                    && distance_squared(a, &points[j as usize]) <= f64::from(radius).powi(2)
            }));
            graph.starts.push(graph.senders.len() as u32);
        }
        graph
    }

    fn clouds<const D: usize>() -> impl Strategy<Value = Vec<SVector<f32, D>>> {
        // A coarse lattice makes coincident points and distances of exactly the radius; small scales clump.
        let coordinate = prop_oneof![
            (0i32..40).prop_map(|k| k as f32 / 32.0),
            0.0f32..1.0,
            0.5f32..0.51
        ];
        let point = prop::collection::vec(coordinate, D);
        prop::collection::vec(point.prop_map(|p| SVector::from_column_slice(&p)), 0..120)
    }

    proptest! {
        #[test]
        fn equals_brute_force_2d(points in clouds::<2>(), radius in prop_oneof![Just(1.0f32 / 32.0), 0.001f32..3.0]) {
            prop_assert_eq!(radius_graph(&points, radius).unwrap(), brute_force(&points, radius));
        }

        #[test]
        fn equals_brute_force_3d(points in clouds::<3>(), radius in prop_oneof![Just(1.0f32 / 16.0), 0.001f32..3.0]) {
            prop_assert_eq!(radius_graph(&points, radius).unwrap(), brute_force(&points, radius));
        }
    }

    #[test]
    fn nothing_and_nonsense() {
        let none = radius_graph::<2>(&[], 0.1).unwrap();
        assert_eq!(
            none,
            RadiusGraph {
                starts: vec![0],
                senders: vec![]
            }
        );
        let far = [
            SVector::<f32, 2>::new(0.0, 0.0),
            SVector::<f32, 2>::new(1.0e30, 0.0),
        ];
        assert!(radius_graph(&far, 1.0e-3).unwrap().senders.is_empty());
        let error = |points: &[SVector<f32, 2>], radius| {
            radius_graph(points, radius).unwrap_err().to_string()
        };
        assert_eq!(error(&[], 0.0), "radius must be finite and > 0 m, got 0");
        assert!(
            error(&[SVector::<f32, 2>::new(f32::NAN, 0.0)], 0.1).starts_with("x[0] must be finite")
        );
    }
}
