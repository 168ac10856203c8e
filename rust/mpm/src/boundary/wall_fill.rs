//! How full of material the grid can be near the walls.

use super::contact::Walls;
use crate::grid::{Layout, PADDING, Stencils};
use crate::linalg::{LANES, Lanes};

/// The part of each stencil that lies between the walls.
#[derive(Debug, Clone)]
pub struct WallFill<const D: usize> {
    /// Per axis and node, the part of the node's spline between the walls, in [0, 1].
    nodes: [Vec<f32>; D],
}

impl<const D: usize> WallFill<D> {
    pub fn new(walls: &Walls<D>, layout: &Layout<D>) -> Self {
        let cells = |x: f32| f64::from(x) * layout.resolution as f64 + PADDING as f64;
        let nodes = std::array::from_fn(|axis| {
            let (lower, upper) = (cells(walls.lower[axis]), cells(walls.upper[axis]));
            (0..layout.extents[axis])
                .map(|i| (cumulative(upper - i as f64) - cumulative(lower - i as f64)) as f32)
                .collect()
        });
        Self { nodes }
    }

    /// The same for values that were smoothed along each axis: `mean` takes a node's value from those before, at and
    /// after it.
    pub fn smoothed(mut self, mean: impl Fn(f32, f32, f32) -> f32) -> Self {
        for nodes in &mut self.nodes {
            // The outermost nodes keep their value: no particle gets that far.
            let before = nodes.clone();
            for (node, around) in nodes[1..].iter_mut().zip(before.windows(3)) {
                *node = mean(around[0], around[1], around[2]);
            }
        }
        self
    }

    /// The part of a node's spline that lies between the walls, in [0, 1].
    pub fn at_node(&self, node: [usize; D]) -> f32 {
        (0..D).map(|axis| self.nodes[axis][node[axis]]).product()
    }

    /// For each particle of a block, the part of its stencil that lies between the walls, about 1 far from them,
    /// and the centre of that part in cells from the lowest node.
    #[inline(always)]
    pub fn at(&self, stencils: &Stencils<D>) -> (Lanes, [Lanes; D]) {
        let mut fill = [1.0; LANES];
        let mut centre = [[0.0; LANES]; D];
        for axis in 0..D {
            let mut nodes = [[0.0; LANES]; 3];
            for i in 0..LANES {
                let base = stencils.base[axis][i] as usize;
                let around: &[f32; 3] = self.nodes[axis][base..base + 3]
                    .try_into()
                    .expect("three nodes");
                (0..3).for_each(|step| nodes[step][i] = around[step]);
            }
            let w = &stencils.weights[axis];
            for i in 0..LANES {
                let (middle, end) = (nodes[1][i] * w[1][i], nodes[2][i] * w[2][i]);
                let sum = nodes[0][i] * w[0][i] + middle + end;
                fill[i] *= sum;
                centre[axis][i] = (middle + 2.0 * end) / sum;
            }
        }
        (fill, centre)
    }
}

/// Integral of the quadratic B-spline centred at zero from minus infinity to t.
pub(super) fn cumulative(t: f64) -> f64 {
    match t {
        t if t < -1.5 => 0.0,
        t if t < -0.5 => (t + 1.5).powi(3) / 6.0,
        t if t < 0.5 => 0.5 + t * (0.75 - t * t / 3.0),
        t if t < 1.5 => 1.0 - (1.5 - t).powi(3) / 6.0,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boundary::{Contact, ContactKind};
    use crate::linalg::Vector;

    #[test]
    fn a_stencil_at_a_wall_is_about_half_full_and_in_a_corner_a_quarter() {
        let contact = Contact {
            kind: ContactKind::Separating,
            friction: None,
        };
        let (lower, upper) = (Vector::from_element(0.1), Vector::from_element(0.9));
        let walls = Walls::uniform(lower, upper, contact);
        let layout = Layout::<2>::unit(64);
        let fill = WallFill::new(&walls, &layout);
        let at = |x: f32, y: f32| fill.at(&Stencils::at(&[[x; LANES], [y; LANES]], &layout)).0[0];
        assert!((at(0.5, 0.5) - 1.0).abs() < 1e-6);
        // Not exactly: between nodes, the spline of splines is not symmetric.
        assert!((at(0.1, 0.5) - 0.5).abs() < 0.02 && (at(0.5, 0.9) - 0.5).abs() < 0.02);
        assert!((at(0.9, 0.1) - 0.25).abs() < 0.02);
        assert!((at(0.1 + 3.01 / 64.0, 0.5) - 1.0).abs() < 1e-6);
    }
}
