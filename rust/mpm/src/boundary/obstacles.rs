//! All solids of a scene on one grid: where they act, and where they are.

use super::contact::Walls;
use super::lines::Line;
use super::motion::Pose;
use super::moving::Movement;
use super::node::{ByRow, Nearness};
use super::obstacle::Obstacle;
use super::shape::Shape;
use super::solids::Solids;
use crate::grid::Layout;
use crate::linalg::Vector;

/// A grid node deep inside an obstacle at rest.
#[derive(Debug, Clone, Copy)]
pub(super) struct DeepNode<const D: usize> {
    /// Position in its row.
    pub column: u32,
    pub obstacle: u32,
    pub normal: Vector<D>,
}

/// The solids of a scene, with the nodes on which they act. How they do is told in `resting` and `moving` (where), in
/// `obstacle_contact` (on velocities) and in `inside` (on particles).
#[derive(Debug, Clone)]
pub struct Obstacles<const D: usize> {
    pub(super) solids: Solids<D>,
    /// Nodes deep inside obstacles at rest.
    pub(super) deep: ByRow<DeepNode<D>>,
    /// Lines of nodes across the surfaces of obstacles at rest, by the axis along which they lie.
    pub(super) lines: [Vec<Line<D>>; D],
    /// None where all are at rest.
    pub(super) movement: Option<Movement<D>>,
    /// Whether what is at a node may touch a solid; empty without any.
    pub(super) near: Vec<Nearness>,
}

impl<const D: usize> Obstacles<D> {
    /// Incomplete where the work is `interrupted`.
    pub fn new(list: Vec<Obstacle<D>>, walls: &Walls<D>, layout: &Layout<D>) -> Self {
        Self::with_bodies(list, &[], walls, layout)
    }

    /// The same with rigid bodies, given by their shapes about their centres and their poses.
    pub fn with_bodies(
        list: Vec<Obstacle<D>>,
        bodies: &[(Shape<D>, Pose<D>)],
        walls: &Walls<D>,
        layout: &Layout<D>,
    ) -> Self {
        let shapes = bodies.iter().map(|(shape, _)| shape);
        let mut prepared = Self {
            solids: Solids::new(list, shapes, walls, layout),
            deep: ByRow::EMPTY,
            lines: std::array::from_fn(|_| Vec::new()),
            movement: None,
            near: Vec::new(),
        };
        let count = prepared.solids.list.len();
        if count == 0 {
            return prepared;
        }
        prepared.find_resting_nodes();
        if (0..count).any(|index| prepared.solids.moves(index)) {
            prepared.movement = Some(Movement::new(prepared.near.clone()));
            prepared.place_bodies(bodies.iter().map(|(_, pose)| *pose));
            prepared.move_to(0.0, 0.0);
        }
        prepared
    }

    /// Puts the rigid bodies where they are; `move_to` follows.
    pub fn place_bodies(&mut self, poses: impl Iterator<Item = Pose<D>>) {
        self.solids.place_bodies(poses);
    }

    /// Where the rigid bodies are.
    pub fn body_poses(&self) -> impl Iterator<Item = &Pose<D>> {
        self.solids.body_poses()
    }

    /// Takes the end of a substep of length `dt` [s], and puts the moving obstacles where they are then [s]. Returns whether
    /// `near_until_sort` may have changed.
    pub fn move_to(&mut self, time: f64, dt: f32) -> bool {
        self.solids.dt = dt;
        let movement = self.movement.as_mut();
        movement.is_some_and(|moves| moves.move_to(&mut self.solids, time, &mut self.near))
    }

    /// Bound on the speed of the moving solids [m/s]; 0 where all are at rest.
    pub fn speed(&self) -> f32 {
        (self.movement.as_ref()).map_or(0.0, |movement| movement.speed)
    }

    /// Whether there are any.
    pub fn any(&self) -> bool {
        !self.near.is_empty()
    }

    /// Whether one of them moves.
    pub fn any_moves(&self) -> bool {
        self.movement.is_some()
    }

    /// Whether a moving one is nearer to `x` than `reach` [m].
    pub fn moving_within(&self, reach: f32, x: &Vector<D>) -> bool {
        let solids = &self.solids;
        let is_near = |index| solids.pose(index).is_some() && solids.distance(index, x).0 < reach;
        (0..solids.list.len()).any(is_near)
    }

    /// Whether a particle with this lowest node of its stencil has to be tested in this substep.
    #[inline(always)]
    pub fn near_stencil(&self, start: usize) -> bool {
        self.near_node(start + self.solids.layout.stencil_middle())
    }

    /// Whether it may have to be before the next sort.
    #[inline(always)]
    pub fn near_until_sort(&self, start: usize) -> bool {
        self.near[start + self.solids.layout.stencil_middle()] != Nearness::Never
    }

    /// Whether a solid reaches the spline of a node.
    #[inline(always)]
    pub fn near_node(&self, node: usize) -> bool {
        self.near[node] == Nearness::Now
    }
}
