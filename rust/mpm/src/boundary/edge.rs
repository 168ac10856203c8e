//! Lines at the edges of rigid bodies.
//!
//! Lines are a cell apart, so a face whose lines each held their own column of nodes would count as wider or narrower by up to
//! half a cell at each edge, by its place between the nodes, and bodies would float too high or too deep. Uniform pressure on a
//! face pushes each column by the part of its spline that the face covers, also columns beside the last one under it. Those get
//! one contact in common with that one, and take its impulse in proportion to these parts: then all columns are in balance.

use super::lines::{Line, SMOOTH};
use super::solids::Solids;
use super::wall_fill::cumulative;
use crate::linalg::Vector;

/// Depth below a face at which the edge beside a line is looked for [cells].
const UNDER: f32 = 0.02;
/// Most columns of an edge line: those at a corner.
const COLUMNS: usize = 4;
/// Nodes of an edge line.
const EDGE_NODES: usize = 3 * COLUMNS;

/// A line of a rigid body at the edge of a face, with the columns of nodes beside it.
#[derive(Debug, Clone, Copy)]
pub struct EdgeLine<const D: usize> {
    pub line: Line<D>,
    /// Steps in memory from the line's own column, the first, to others, and the share that each has; 0 of those that are none.
    columns: [(isize, f32); COLUMNS],
}

impl<const D: usize> EdgeLine<D> {
    /// Memory indices of the nodes of all columns, those of the line first, and their weights; 0 of nodes that are none.
    pub fn nodes(&self) -> ([usize; EDGE_NODES], [f32; EDGE_NODES]) {
        let (nodes, weights) = self.line.nodes();
        let column = |k: usize| self.columns[k / 3];
        (
            std::array::from_fn(|k| nodes[k % 3].wrapping_add_signed(column(k).0)),
            std::array::from_fn(|k| weights[k % 3] * column(k).1),
        )
    }
}

impl<const D: usize> Solids<D> {
    /// The line with what it holds beside it; None where its face goes on for a cell, or the grid ends, and where nothing has room to
    /// flow there from beside the face, for it all but lies on a wall.
    pub fn at_edge(&self, line: &Line<D>, node: [usize; D], axis: usize) -> Option<EdgeLine<D>> {
        let (dx, normal) = (self.layout.dx(), line.normal);
        let room = if normal[axis] < 0.0 {
            line.x[axis] - self.walls.lower[axis]
        } else {
            self.walls.upper[axis] - line.x[axis]
        };
        if room < dx {
            return None;
        }
        let mut columns = [(0, 0.0); COLUMNS];
        columns[0].1 = 1.0;
        let (mut count, mut x) = (1, line.x);
        for other in (0..D).filter(|other| *other != axis) {
            if node[other] == 0 || node[other] + 1 >= self.layout.extents[other] {
                return None;
            }
            // A column farther on, along the face.
            let mut along = Vector::<D>::zeros();
            along[other] = 1.0;
            along[axis] = -normal[other] / normal[axis];
            let share = |side: f32| {
                let beside = line.x + (along * side - normal * UNDER) * dx;
                let (distance, across) = self.distance(line.obstacle as usize, &beside);
                let slope = across.dot(&along) * side;
                if distance <= 0.0 || across.dot(&normal) > SMOOTH || slope <= 0.0 {
                    return 0.0;
                }
                let beyond = f64::from((distance / (slope * dx)).min(1.0));
                let (own, its) = (cumulative(1.0 - beyond), cumulative(-beyond));
                (its / (own + its)) as f32
            };
            let shares = [share(1.0), share(-1.0)];
            let (side, share) = if shares[0] >= shares[1] {
                (1.0, shares[0])
            } else {
                (-1.0, shares[1])
            };
            if share > 0.0 {
                let step = self.layout.stride(other) as isize * side as isize;
                for k in 0..count {
                    let (column, whole) = columns[k];
                    columns[count + k] = (column + step, whole * share);
                    columns[k].1 = whole * (1.0 - share);
                }
                count *= 2;
                x += along * (side * share * dx);
            }
        }
        (count > 1).then_some(EdgeLine {
            line: line.at(x),
            columns,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::boundary::crossings::Batch;
    use crate::boundary::lines::{LINE_CELLS, LineNodes};
    use crate::boundary::{Contact, ContactKind, Obstacles, Pose, Shape, Walls};
    use crate::grid::Layout;
    use crate::linalg::Matrix;

    const DX: f32 = 1.0 / 16.0;

    fn pose(center: Vector<3>, turn: f32) -> Pose<3> {
        let (sin, cos) = turn.sin_cos();
        let turn = Matrix::<3>::new(cos, 0.0, sin, 0.0, 1.0, 0.0, -sin, 0.0, cos);
        Pose::of_body(center, turn, Vector::zeros(), Matrix::zeros())
    }

    fn walls() -> Walls<3> {
        let contact = Contact {
            kind: ContactKind::Separating,
            friction: None,
        };
        Walls::uniform(Vector::zeros(), Vector::repeat(1.0), contact)
    }

    fn block(half: [f32; 3]) -> Shape<3> {
        let half = Vector::from(half) * DX;
        Shape::Box {
            lower: -half,
            upper: half,
        }
    }

    /// The part of the spline of a node along an axis that lies between two places [cells from it].
    fn covered(lower: f32, upper: f32) -> f32 {
        (cumulative(f64::from(upper)) - cumulative(f64::from(lower))) as f32
    }

    #[test]
    fn uniform_pressure_on_a_face_stops_at_all_its_columns_wherever_it_lies() {
        let layout = Layout::<3>::unit(16);
        let half = [2.6, 2.3, 3.05];
        for place in [
            [0.0; 3],
            [0.21, 0.4, 0.63],
            [0.45, 0.1, 0.86],
            [0.38, 0.7, 0.31],
        ] {
            let center = (Vector::repeat(8.0) + Vector::from(place)) * DX;
            let shape = block(half);
            let mut solids = Solids::new(Vec::new(), [&shape].into_iter(), &walls(), &layout);
            solids.place_bodies([pose(center, 0.0)].into_iter());
            solids.dt = 1.0e-3;
            // Nodes of unit mass, which pressure on the lower face pushed up by the part of their splines on it.
            let mut nodes = BTreeMap::new();
            let (mut lines, mut edges) = (Vec::new(), Vec::new());
            for number in 0..16_usize.pow(3) {
                let node = [number / 256, number / 16 % 16, number % 16].map(|k| k + 3);
                let x = layout.position(node);
                let memory = (0..3).map(|axis| node[axis] * layout.stride(axis)).sum();
                let from =
                    |axis: usize, side: f32| (center[axis] - x[axis]) / DX + side * half[axis];
                let weight = weight_at(from(1, -1.0));
                let beside =
                    covered(from(0, -1.0), from(0, 1.0)) * covered(from(2, -1.0), from(2, 1.0));
                nodes.insert(memory, [0.0, weight * beside, 0.0, 1.0]);
                let at = solids.distance(0, &x).0;
                if at > 0.0 && at <= LINE_CELLS * DX {
                    let (mut batch, mut found) = (Batch::<3, 1>::new(), [const { Vec::new() }; 3]);
                    batch.add(0, (node, memory), &layout);
                    batch.find(&solids, false, |_| 1..2, &mut found);
                    for line in found[1].iter().filter(|line| line.normal.y < 0.0) {
                        match solids.at_edge(line, node, 1) {
                            Some(edge) => edges.push(edge),
                            None => lines.push(*line),
                        }
                    }
                }
            }
            let mut sum = 0.0;
            let mut act = |line: &Line<3>, places: &[usize], weights: &[f32]| {
                let mut held = LineNodes {
                    values: [[0.0; 4]; EDGE_NODES],
                    weights: [0.0; EDGE_NODES],
                    is_elastic: false,
                    friction: 0.0,
                };
                for (k, place) in places.iter().enumerate().filter(|(k, _)| weights[*k] > 0.0) {
                    (held.values[k], held.weights[k]) = (nodes[place], weights[k]);
                }
                sum -= line.act(&mut held, &solids).expect("it touches").0.y;
                for (k, place) in places.iter().enumerate().filter(|(k, _)| weights[*k] > 0.0) {
                    nodes.insert(*place, held.values[k]);
                }
            };
            for line in &lines {
                let (places, weights) = line.nodes();
                act(line, &places, &weights);
            }
            for edge in &edges {
                let (places, weights) = edge.nodes();
                act(&edge.line, &places, &weights);
            }
            let area = 4.0 * half[0] * half[2];
            assert!(
                (sum / area - 1.0).abs() < 0.01,
                "{place:?}: {sum} of {area}"
            );
            let left = nodes.values().map(|node| node[1].abs()).fold(0.0, f32::max);
            assert!(left < 0.03, "{place:?}: {left}");
        }
    }

    /// Weight of a node at a distance [cells].
    fn weight_at(distance: f32) -> f32 {
        let away = distance.abs();
        if away < 0.5 {
            0.75 - away * away
        } else {
            0.5 * (1.5 - away).max(0.0).powi(2)
        }
    }

    #[test]
    fn nodes_are_filled_by_the_volume_of_a_body() {
        let layout = Layout::<3>::unit(16);
        let (up, radius) = (Vector::<3>::y() * (2.7 * DX), 3.1 * DX);
        let cylinder = Shape::Cylinder {
            start: -up,
            end: up,
            radius,
        };
        let ball = Shape::Ball {
            center: Vector::zeros(),
            radius,
        };
        let disc = std::f32::consts::PI * 3.1 * 3.1;
        for (shape, turn, volume) in [
            (block([2.6, 2.3, 3.05]), 0.0, 8.0 * 2.6 * 2.3 * 3.05),
            (block([2.6, 2.3, 3.05]), 0.7, 8.0 * 2.6 * 2.3 * 3.05),
            (cylinder, 0.0, disc * 5.4),
            (ball, 0.0, disc * 3.1 * 4.0 / 3.0),
        ] {
            let pose = pose(Vector::<3>::new(8.2, 7.9, 8.45) * DX, turn);
            let solids = Obstacles::with_bodies(Vec::new(), &[(shape, pose)], &walls(), &layout);
            let fill = |number: usize| {
                solids.fill([number / 256, number / 16 % 16, number % 16].map(|k| k + 3))
            };
            let sum: f32 = (0..16_usize.pow(3)).map(fill).sum();
            assert!((sum / volume - 1.0).abs() < 0.015, "{sum} of {volume}");
        }
    }
}
