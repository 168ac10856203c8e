//! The nodes and lines on which obstacles at rest act, found once.

use super::crossings::{Batch, MANY};
use super::lines::lowest_start;
use super::moving::search_row;
use super::node::{Nearness, acts_at, reach_until_sort};
use super::obstacles::{DeepNode, Obstacles};
use crate::linalg::Vector;
use threads::interrupted;

impl<const D: usize> Obstacles<D> {
    pub(super) fn find_resting_nodes(&mut self) {
        let (solids, layout) = (&self.solids, &self.solids.layout);
        let rows_per_plane = layout.rows_per_plane();
        self.near = vec![Nearness::Never; layout.row_count() * layout.row_length];
        let (mut deep, mut batch) = (Vec::new(), Batch::<D, MANY>::new());
        'all: for (index, obstacle) in solids.list.iter().enumerate() {
            if solids.moves(index) {
                continue;
            }
            let within = solids.nodes_within(index, reach_until_sort(layout));
            let (planes, columns) = (within[0].clone(), &within[D - 1]);
            let rows = if D == 3 { within[1].clone() } else { 0..1 };
            for row in planes.flat_map(|plane| rows.clone().map(move |row| (plane, row))) {
                if interrupted() {
                    break 'all;
                }
                let row = row.0 * rows_per_plane + row.1;
                let near = &mut self.near[row * layout.row_length..][..layout.columns()];
                let mut node = layout.row_coordinates(row);
                let found = |column: usize, distance: f32, normal: Vector<D>| {
                    node[D - 1] = column;
                    if acts_at(distance, 0.0, layout) {
                        let (column, obstacle) = (column as u32, index as u32);
                        let node = DeepNode {
                            column,
                            obstacle,
                            normal,
                        };
                        deep.push((row, node));
                    } else if distance > lowest_start(obstacle, layout.dx()) {
                        if batch.ends_before(index) {
                            batch.find(solids, true, |_| 0..D, &mut self.lines);
                        }
                        batch.add(index, (node, row * layout.row_length + column), layout);
                    }
                };
                let nodes = (row, columns.clone());
                search_row((obstacle, None), layout, nodes, 0.0, near, found);
            }
        }
        batch.find(solids, true, |_| 0..D, &mut self.lines);
        for lines in &mut self.lines {
            lines.sort_by_key(|line| (line.node, line.obstacle));
        }
        deep.sort_by_key(|(row, node)| (*row, node.column, node.obstacle));
        self.deep.clear();
        let mut deep = deep.into_iter().peekable();
        for row in 0..layout.row_count() {
            while let Some((_, node)) = deep.next_if(|(of, _)| *of == row) {
                self.deep.nodes.push(node);
            }
            self.deep.end_row();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boundary::lines::Line;
    use crate::boundary::{Contact, ContactKind, Motion, Obstacle, Shape, Walls};
    use crate::grid::Layout;

    const CONTACT: Contact = Contact {
        kind: ContactKind::Separating,
        friction: None,
    };

    fn walls() -> Walls<2> {
        Walls::uniform(Vector::zeros(), Vector::repeat(1.0), CONTACT)
    }

    fn solid(lower: [f32; 2], upper: [f32; 2]) -> Obstacle<2> {
        let [lower, upper] = [lower, upper].map(Vector::from);
        Obstacle::new(Shape::Box { lower, upper }, CONTACT).unwrap()
    }

    #[test]
    fn ramps_along_the_diagonal_of_the_grid_have_all_their_lines() {
        let layout = Layout::<2>::unit(64);
        for cells in [0.1, 0.25, 0.5, 1.0, 4.0] {
            for (up, turn) in [(0.0, 0.0), (0.3, 0.0), (0.0, -2.0e-4), (0.3, 2.0e-4)] {
                let height = 0.75 + up / 64.0;
                let shape = Shape::Segment {
                    start: Vector::from([0.25, height]),
                    end: Vector::from([0.75, height - 0.5 - turn]),
                    thickness: cells / 64.0,
                };
                let ramp = Obstacle::new(shape, CONTACT).unwrap();
                let lines = Obstacles::new(vec![ramp], &walls(), &layout).lines;
                let middle = |line: &&Line<2>| (0.3..0.7).contains(&line.x[0]);
                let count = lines.iter().flatten().filter(middle).count();
                // One in each column from above, and one from below.
                assert!((50..=52).contains(&count), "{count}: {cells} {up} {turn}");
            }
        }
    }

    #[test]
    fn nodes_on_a_surface_begin_one_line_each() {
        let layout = Layout::<2>::unit(32);
        for below in [0.0, 5.0e-4, 0.3] {
            let floor = solid([0.0, 0.0], [1.0, (10.0 - below) / 32.0]);
            let lines = Obstacles::new(vec![floor], &walls(), &layout).lines;
            let middle = |line: &&Line<2>| (0.249..0.751).contains(&line.x[0]);
            assert_eq!(lines[1].iter().filter(middle).count(), 17, "{below}");
        }
    }

    #[test]
    fn faces_have_all_their_lines_at_every_node_of_any_grid() {
        for resolution in [40, 64, 96, 100, 128, 160] {
            let layout = Layout::<2>::unit(resolution);
            for node in 6..resolution - 6 {
                let face = (node as f64 / resolution as f64) as f32;
                for (axis, upper) in [(0, false), (0, true), (1, false), (1, true)] {
                    let mut corners = [[0.0; 2], [1.0; 2]];
                    corners[usize::from(upper)][axis] = face;
                    let lines =
                        Obstacles::new(vec![solid(corners[0], corners[1])], &walls(), &layout)
                            .lines;
                    let middle = |line: &&Line<2>| (0.249..0.751).contains(&line.x[1 - axis]);
                    let count = lines[axis].iter().filter(middle).count();
                    let [first, last] = [0.249, 0.751].map(|x| x * resolution as f32);
                    let nodes = (last.floor() - first.ceil()) as usize + 1;
                    assert_eq!(count, nodes, "{node} of {resolution}, {axis} {upper}");
                }
            }
        }
    }

    #[test]
    fn faces_have_lines_up_to_their_edges() {
        let layout = Layout::<2>::unit(64);
        for place in [0.04, 0.3, 0.5, 0.71, 0.96] {
            let (lower, upper) = ((20.0 + place) / 64.0, (25.0 + place) / 64.0);
            let square = solid([lower; 2], [upper; 2]);
            let lines = Obstacles::new(vec![square], &walls(), &layout).lines;
            let counts: Vec<_> = lines.iter().map(Vec::len).collect();
            assert_eq!(counts, [10, 10], "{place}");
        }
    }

    /// Columns from 0.3 to 0.7 without a line from beside, on plates across an axis with an opening from one place to another [cells].
    fn open_columns(axis: usize, lower: f32, upper: f32) -> usize {
        let layout = Layout::<2>::unit(64);
        let plate = |from: f32, to: f32| {
            let mut corners = [[from, 0.3], [to, 0.4]];
            for corner in &mut corners {
                corner.rotate_left(1 - axis);
            }
            solid(corners[0], corners[1])
        };
        let plates = vec![plate(0.0, lower / 64.0), plate(upper / 64.0, 1.0)];
        let lines = Obstacles::new(plates, &walls(), &layout).lines;
        let is_held = |column: &i32| {
            lines[axis].iter().any(|line| {
                let beside = line.x[1 - axis] * 64.0 - *column as f32;
                line.normal[axis] > 0.5 && beside.abs() < 0.01
            })
        };
        25 - (20..45).filter(is_held).count()
    }

    #[test]
    fn an_opening_of_a_few_cells_has_a_column_more_wherever_it_lies() {
        for place in [0.0, 0.12, 0.3, 0.42, 0.63, 0.88] {
            for (cells, axis) in [(2, 0), (3, 0), (6, 0), (2, 1), (3, 1), (6, 1)] {
                let half = 0.5 * cells as f32;
                let open = open_columns(axis, 32.0 + place - half, 32.0 + place + half);
                // Edges that both lie half a cell beside a node have one more.
                let halfway = (place - half).rem_euclid(1.0) == 0.5;
                assert_eq!(
                    open,
                    cells + 1 + usize::from(halfway),
                    "{cells} cells at {place} along {axis}"
                );
            }
            // A seam of two solids is none, but for the column beside each edge.
            assert!(open_columns(1, 32.0 + place, 32.0 + place) <= 1, "{place}");
        }
        // The edges of a wide one are those of the solids, but for lines on them, and so is that of a solid alone.
        for axis in 0..2 {
            assert_eq!(open_columns(axis, 26.3, 38.3), 12);
            assert_eq!(open_columns(axis, 26.0, 38.0), 13);
        }
    }

    #[test]
    fn what_moves_away_leaves_a_whole_floor() {
        let up = Motion::new(Vector::from([0.0, 1.0]), &[], Vector::zeros(), None).unwrap();
        let floor = solid([0.0, 0.0], [1.0, 0.3]);
        let gate = solid([0.4, 0.3], [0.6, 0.7]);
        let layout = Layout::<2>::unit(32);
        let lines = |list: Vec<Obstacle<2>>| Obstacles::new(list, &walls(), &layout).lines;
        let alone = lines(vec![floor.clone()]);
        assert!(lines(vec![floor.clone(), gate.clone().moving(up)]) == alone);
        assert!(lines(vec![floor, gate]) != alone);
    }
}
