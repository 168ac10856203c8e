//! Motion of solids, and which grid nodes they can touch for a while.

use super::lines::{LINE_CELLS, lowest_start};
use super::motion::Pose;
use super::node::{BAND_CELLS, ByRow, Nearness, acts_at, reach_until_sort, stencil_reach};
use super::obstacle::Obstacle;
use super::solids::Solids;
use crate::grid::Layout;
use crate::linalg::Vector;
use std::ops::Range;
use threads::interrupted;

/// How far solids may move before the nodes that they can touch are looked for anew: a search costs less than to test more nodes in
/// each substep.
const MARGIN_CELLS: f32 = 1.0;
/// More than rounding changes a distance by [cells].
const ROUNDING_CELLS: f32 = 0.01;

/// A grid node that a moving obstacle may act on before the next search.
#[derive(Debug, Clone, Copy)]
pub struct ReachableNode {
    /// Position in its row.
    pub column: u32,
    pub obstacle: u32,
    /// Distance from it when the nodes were looked for [m].
    pub distance: f32,
}

/// Which nodes the moving solids of a scene can touch, and how fast they are.
#[derive(Debug, Clone)]
pub struct Movement<const D: usize> {
    /// Where rigid bodies were when the nodes were looked for.
    searched_poses: Vec<Pose<D>>,
    /// Bound on the speed of solids in prescribed motion, and of all [m/s].
    scripted_speed: f32,
    pub speed: f32,
    /// Bound on how far the solids have moved since the nodes were looked for [m].
    pub moved: f32,
    /// Nodes that may begin lines across a surface, and those that may lie deep inside.
    pub nodes: ByRow<ReachableNode>,
    pub deep: ByRow<ReachableNode>,
    /// Nodes near to obstacles at rest, as `Obstacles::near`.
    near_resting: Vec<Nearness>,
    /// When the nodes were looked for [s]; None before the first search.
    searched: Option<f64>,
}

impl<const D: usize> Movement<D> {
    pub fn new(near_resting: Vec<Nearness>) -> Self {
        Self {
            searched_poses: Vec::new(),
            scripted_speed: 0.0,
            speed: 0.0,
            moved: 0.0,
            nodes: ByRow::EMPTY,
            deep: ByRow::EMPTY,
            near_resting,
            searched: None,
        }
    }

    /// Moves the solids to a time [s]. When nodes are searched has no influence on the motion: more are found than an
    /// obstacle acts on, and each is tested before it is used. Where the work is `interrupted`, some are missing until
    /// the next call. Returns whether they were searched.
    pub fn move_to(&mut self, solids: &mut Solids<D>, time: f64, near: &mut [Nearness]) -> bool {
        let before = self.scripted_speed;
        let (corner, dx) = (solids.layout.upper(), solids.layout.dx());
        self.speed = 0.0;
        for (obstacle, place) in solids.list.iter().zip(&mut solids.poses) {
            if let Some(motion) = obstacle.motion {
                let pose = motion.pose(time);
                self.speed = self.speed.max(obstacle.speed(&pose, &corner));
                *place = Some(pose);
            }
        }
        self.scripted_speed = self.speed;
        let fastest = f64::from(before.max(self.speed));
        let margin = MARGIN_CELLS * dx;
        let valid = |searched: f64| {
            (time - searched).abs() * fastest <= f64::from(margin)
                && self.bodies_moved(solids) <= margin
        };
        let searches = !self.searched.is_some_and(valid);
        if searches {
            self.search(solids, near);
            self.searched = (!interrupted()).then_some(time);
            self.searched_poses = solids.body_poses().copied().collect();
        }
        let since = self
            .searched
            .map_or(0.0, |searched| (time - searched).abs());
        let moved = ((since * fastest) as f32).max(self.bodies_moved(solids));
        self.moved = moved + ROUNDING_CELLS * dx;
        solids.fill_buckets();
        let of_bodies = solids.body_poses().zip(&solids.reaches);
        self.speed = of_bodies
            .map(|(pose, reach)| pose.speed(*reach))
            .fold(self.speed, f32::max);
        searches
    }

    /// Bound on how far rigid bodies have moved since the nodes were looked for [m].
    fn bodies_moved(&self, solids: &Solids<D>) -> f32 {
        let pairs = solids.body_poses().zip(&self.searched_poses);
        pairs
            .zip(&solids.reaches)
            .map(|((pose, searched), reach)| pose.apart(searched, *reach))
            .fold(0.0, f32::max)
    }

    /// Finds the nodes that the solids may touch while they move by the margin.
    fn search(&mut self, solids: &Solids<D>, near: &mut [Nearness]) {
        near.copy_from_slice(&self.near_resting);
        let layout = &solids.layout;
        let most_moved = (MARGIN_CELLS + 2.0 * ROUNDING_CELLS) * layout.dx();
        let reach = most_moved + reach_until_sort(layout);
        let moving = (0..solids.list.len()).filter(|index| solids.pose(*index).is_some());
        let moving: Vec<_> = moving
            .map(|index| (index, solids.nodes_within(index, reach)))
            .collect();
        self.nodes.clear();
        self.deep.clear();
        for row in 0..layout.row_count() {
            let moving = if interrupted() { &[] } else { &moving[..] };
            let place = layout.row_coordinates(row);
            for (index, within) in moving {
                let (index, obstacle) = (*index, &solids.list[*index]);
                if (0..D - 1).all(|axis| within[axis].contains(&place[axis])) {
                    let near = &mut near[row * layout.row_length..][..layout.columns()];
                    let lowest = lowest_start(obstacle, layout.dx()) - most_moved;
                    let found = |column: usize, distance: f32, _| {
                        let node = ReachableNode {
                            column: column as u32,
                            obstacle: index as u32,
                            distance,
                        };
                        if distance > lowest {
                            self.nodes.nodes.push(node);
                        }
                        if acts_at(distance, most_moved, layout) {
                            self.deep.nodes.push(node);
                        }
                    };
                    let solid = (obstacle, solids.pose(index));
                    let nodes = (row, within[D - 1].clone());
                    search_row(solid, layout, nodes, MARGIN_CELLS, near, found);
                }
            }
            self.nodes.end_row();
            self.deep.end_row();
        }
    }
}

/// Walks along columns of a row, in strides as long as the distance allows. Calls back with the column, the distance and the
/// normal of nodes on which the solid may act until it has moved by a margin [cells].
pub(super) fn search_row<const D: usize>(
    (obstacle, pose): (&Obstacle<D>, Option<&Pose<D>>),
    layout: &Layout<D>,
    (row, columns): (usize, Range<usize>),
    margin: f32,
    near: &mut [Nearness],
    mut found: impl FnMut(usize, f32, Vector<D>),
) {
    let dx = layout.dx();
    let margin = margin * dx;
    let (now, until_sort) = (stencil_reach(layout), reach_until_sort(layout));
    let inner = -BAND_CELLS * dx - margin;
    let mut node = layout.row_coordinates(row);
    let mut column = columns.start;
    while column < columns.end {
        node[D - 1] = column;
        let (distance, normal) = obstacle.distance_in(pose, &layout.position(node));
        // A distance changes by at most dx from one node to the next.
        let to_surface = (distance - margin - until_sort).max(inner - distance);
        let stride = ((to_surface / dx) as usize).clamp(1, columns.end - column);
        let nearness = match distance - margin {
            distance if distance < now => Nearness::Now,
            distance if distance < until_sort => Nearness::UntilSort,
            _ => Nearness::Never,
        };
        for near in &mut near[column..column + stride] {
            *near = nearness.max(*near);
        }
        if distance <= margin + LINE_CELLS * dx && distance > inner {
            found(column, distance, normal);
        }
        column += stride;
    }
}
