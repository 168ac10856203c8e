//! Where moving obstacles are, and which grid nodes they can touch for a while.

use super::buckets::{BUCKET_MARGIN_CELLS, Buckets};
use super::lines::LINE_CELLS;
use super::motion::Pose;
use super::node::{BAND_CELLS, ByRow, Nearness, reach_until_sort, stencil_reach};
use super::obstacle::Obstacle;
use crate::grid::Layout;
use crate::linalg::Vector;
use threads::interrupted;

/// How far solids may move before the nodes that they can touch are looked for anew.
const MARGIN_CELLS: f32 = 2.0;
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

/// The moving obstacles of a scene at one instant.
#[derive(Debug, Clone)]
pub struct MovingObstacles<const D: usize> {
    /// Pose of each obstacle of the scene; None where it is at rest.
    pub poses: Vec<Option<Pose<D>>>,
    /// Rigid bodies, which end the list of obstacles: the distance that each reaches from its centre [m], and its pose when
    /// the nodes were looked for.
    pub reaches: Vec<f32>,
    searched_poses: Vec<Pose<D>>,
    pub buckets: Buckets<D>,
    /// Bound on the speed of solids in prescribed motion, and of all [m/s].
    scripted_speed: f32,
    pub speed: f32,
    /// Length of the present substep [s].
    pub dt: f32,
    /// Bound on how far the solids have moved since the nodes were looked for [m].
    pub moved: f32,
    pub nodes: ByRow<ReachableNode>,
    /// Nodes near to obstacles at rest, as `Obstacles::near`.
    near_solid: Vec<Nearness>,
    /// When the nodes were looked for [s]; None before the first search.
    searched: Option<f64>,
}

impl<const D: usize> MovingObstacles<D> {
    pub fn new(
        obstacle_count: usize,
        reaches: Vec<f32>,
        near_solid: Vec<Nearness>,
        layout: &Layout<D>,
    ) -> Self {
        Self {
            buckets: Buckets::new(layout),
            poses: vec![None; obstacle_count],
            reaches,
            searched_poses: Vec::new(),
            scripted_speed: 0.0,
            speed: 0.0,
            dt: 0.0,
            moved: 0.0,
            nodes: ByRow::EMPTY,
            near_solid,
            searched: None,
        }
    }

    /// Goes to a time [s]. When nodes are searched has no influence on the motion: more are found than an
    /// obstacle acts on, and each is tested before it is used. Where the work is `interrupted`, some are missing until
    /// the next call. Returns whether they were searched.
    pub fn move_to(
        &mut self,
        list: &[Obstacle<D>],
        layout: &Layout<D>,
        time: f64,
        dt: f32,
        near: &mut [Nearness],
    ) -> bool {
        let before = self.scripted_speed;
        let corner = layout.upper();
        (self.speed, self.dt) = (0.0, dt);
        for (obstacle, place) in list.iter().zip(&mut self.poses) {
            if let Some(motion) = obstacle.motion {
                let pose = motion.pose(time);
                self.speed = self.speed.max(obstacle.speed(&pose, &corner));
                *place = Some(pose);
            }
        }
        self.scripted_speed = self.speed;
        let fastest = f64::from(before.max(self.speed));
        let margin = MARGIN_CELLS * layout.dx();
        let valid = |searched: f64| {
            (time - searched).abs() * fastest <= f64::from(margin) && self.bodies_moved() <= margin
        };
        let searches = !self.searched.is_some_and(valid);
        if searches {
            self.search(list, layout, near);
            self.searched = (!interrupted()).then_some(time);
            self.searched_poses = self.body_poses().copied().collect();
        }
        let since = self
            .searched
            .map_or(0.0, |searched| (time - searched).abs());
        let moved = ((since * fastest) as f32).max(self.bodies_moved());
        self.moved = moved + ROUNDING_CELLS * layout.dx();
        self.fill_buckets(layout.dx());
        let of_bodies = self.body_poses().zip(&self.reaches);
        self.speed = of_bodies
            .map(|(pose, reach)| pose.speed(*reach))
            .fold(self.speed, f32::max);
        searches
    }

    fn fill_buckets(&mut self, dx: f32) {
        self.buckets.clear();
        let first = self.poses.len() - self.reaches.len();
        for (number, reach) in self.reaches.iter().enumerate() {
            if let Some(pose) = &self.poses[first + number] {
                let radius = reach + BUCKET_MARGIN_CELLS * dx;
                let body = (first + number) as u32;
                self.buckets.add(body, &pose.center(), radius);
            }
        }
    }

    /// Where rigid bodies are.
    pub fn body_poses(&self) -> impl Iterator<Item = &Pose<D>> {
        let first = self.poses.len() - self.reaches.len();
        self.poses[first..].iter().flatten()
    }

    /// Bound on how far rigid bodies have moved since the nodes were looked for [m].
    fn bodies_moved(&self) -> f32 {
        let pairs = self.body_poses().zip(&self.searched_poses);
        pairs
            .zip(&self.reaches)
            .map(|((pose, searched), reach)| pose.apart(searched, *reach))
            .fold(0.0, f32::max)
    }

    /// Whether a rigid body, if it is one, is farther from a row than it can act.
    fn is_far(&self, index: usize, layout: &Layout<D>, row: usize) -> bool {
        let first = self.poses.len() - self.reaches.len();
        let (Some(number), Some(pose)) = (index.checked_sub(first), &self.poses[index]) else {
            return false;
        };
        let place = layout.position(layout.row_coordinates(row));
        let away = place - pose.center();
        let beside: f32 = (0..D - 1).map(|axis| away[axis] * away[axis]).sum();
        let most =
            self.reaches[number] + stencil_reach(layout) + (MARGIN_CELLS + 1.0) * layout.dx();
        beside > most * most
    }

    /// Bound on how far a particle with this speed is pushed in a substep [m]. On the way into a solid the
    /// two of them close by at most the sum of their speeds; the rest leads trapped particles out.
    pub fn longest_push(&self, speed: f32, dt: f32) -> f32 {
        (speed + 2.0 * self.speed) * dt
    }

    /// Finds the nodes that the solids may touch while they move by the margin.
    fn search(&mut self, list: &[Obstacle<D>], layout: &Layout<D>, near: &mut [Nearness]) {
        near.copy_from_slice(&self.near_solid);
        self.nodes.clear();
        for row in 0..layout.row_count() {
            let solids = if interrupted() { &[] } else { list };
            for (index, obstacle) in solids.iter().enumerate() {
                if let Some(pose) = &self.poses[index]
                    && !self.is_far(index, layout, row)
                {
                    let nodes = &mut self.nodes.nodes;
                    let near = &mut near[row * layout.row_length..][..layout.columns()];
                    let solid = (obstacle, Some(pose));
                    search_row(
                        solid,
                        layout,
                        row,
                        MARGIN_CELLS,
                        near,
                        |column, distance, _| {
                            nodes.push(ReachableNode {
                                column: column as u32,
                                obstacle: index as u32,
                                distance,
                            });
                        },
                    );
                }
            }
            self.nodes.end_row();
        }
    }
}

/// Walks along a row, in strides as long as the distance allows. Calls back with the column, the distance and the normal of
/// nodes on which the solid may act until it has moved by a margin [cells].
pub(super) fn search_row<const D: usize>(
    (obstacle, pose): (&Obstacle<D>, Option<&Pose<D>>),
    layout: &Layout<D>,
    row: usize,
    margin: f32,
    near: &mut [Nearness],
    mut found: impl FnMut(usize, f32, Vector<D>),
) {
    let dx = layout.dx();
    let margin = margin * dx;
    let (now, until_sort) = (stencil_reach(layout), reach_until_sort(layout));
    let inner = -BAND_CELLS * dx - margin;
    let mut node = layout.row_coordinates(row);
    let mut column = 0;
    while column < layout.columns() {
        node[D - 1] = column;
        let (distance, normal) = obstacle.distance_in(pose, &layout.position(node));
        // A distance changes by at most dx from one node to the next.
        let to_surface = (distance - margin - until_sort).max(inner - distance);
        let stride = ((to_surface / dx) as usize).clamp(1, layout.columns() - column);
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
