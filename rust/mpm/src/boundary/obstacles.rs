//! All solids of a scene: contact on grid nodes, and particles kept outside.

use super::motion::Pose;
use super::moving::MovingObstacles;
use super::node::{ByRow, MaterialFriction, acts_at, change_velocity, stencil_reach};
use super::obstacle::Obstacle;
use super::wall_fill::cumulative;
use super::walls::Walls;
use crate::grid::{Layout, Span, Window};
use crate::linalg::Vector;

/// A grid node inside an obstacle at rest.
#[derive(Debug, Clone, Copy)]
struct SolidNode<const D: usize> {
    /// Position in its row.
    column: u32,
    obstacle: u32,
    normal: Vector<D>,
}

/// All obstacles of a scene, prepared for one grid.
#[derive(Debug, Clone)]
pub struct Obstacles<const D: usize> {
    list: Vec<Obstacle<D>>,
    walls: Walls<D>,
    layout: Layout<D>,
    /// Nodes inside obstacles at rest.
    solid: ByRow<SolidNode<D>>,
    /// None where all obstacles are at rest.
    moving: Option<MovingObstacles<D>>,
    /// Whether a particle whose stencil starts at this node may touch an obstacle; empty without obstacles.
    near: Vec<bool>,
}

impl<const D: usize> Obstacles<D> {
    pub fn new(list: Vec<Obstacle<D>>, walls: &Walls<D>, layout: &Layout<D>) -> Self {
        let list = list.into_iter();
        let mut prepared = Self {
            list: list.map(|obstacle| obstacle.through(walls)).collect(),
            walls: *walls,
            layout: *layout,
            solid: ByRow::EMPTY,
            moving: None,
            near: Vec::new(),
        };
        if prepared.list.is_empty() {
            return prepared;
        }
        prepared.find_solid_nodes();
        if prepared
            .list
            .iter()
            .any(|obstacle| obstacle.motion.is_some())
        {
            prepared.moving = Some(MovingObstacles::new(
                prepared.list.len(),
                prepared.near.clone(),
            ));
            prepared.move_to(0.0, 0.0);
        }
        prepared
    }

    fn find_solid_nodes(&mut self) {
        let layout = self.layout;
        self.solid.clear();
        for row in 0..layout.row_count() {
            let mut node = layout.row_coordinates(row);
            for column in 0..layout.extent {
                node[D - 1] = column;
                let x = layout.position(node);
                let mut near = false;
                for (index, obstacle) in self.list.iter().enumerate() {
                    if obstacle.motion.is_some() {
                        continue;
                    }
                    let (distance, normal) = obstacle.shape.distance(&x);
                    near |= distance < stencil_reach(&layout);
                    if acts_at(distance, &layout) {
                        self.solid.nodes.push(SolidNode {
                            column: column as u32,
                            obstacle: index as u32,
                            normal,
                        });
                    }
                }
                self.near.push(near);
            }
            let padding = layout.row_length - layout.extent;
            self.near.extend(std::iter::repeat_n(false, padding));
            self.solid.end_row();
        }
    }

    /// Puts the moving obstacles where they are at a time [s], the end of a substep of length `dt` [s].
    pub fn move_to(&mut self, time: f64, dt: f32) {
        if let Some(moving) = &mut self.moving {
            moving.move_to(&self.list, &self.layout, time, dt, &mut self.near);
        }
    }

    /// Bound on the speed of the moving solids [m/s]; 0 where all are at rest.
    pub fn speed(&self) -> f32 {
        self.moving.as_ref().map_or(0.0, |moving| moving.speed)
    }

    /// Bound on how far a particle with this speed moves in a substep, being pushed out included [m].
    pub fn travel(&self, speed: f32, dt: f32) -> f32 {
        match &self.moving {
            None => speed * dt,
            Some(moving) => speed * dt + moving.longest_push(speed, dt),
        }
    }

    /// Applies contact to the grid velocities of some spans in a window, and returns the work that moving obstacles did [J].
    pub fn apply(
        &self,
        window: &mut Window<'_, D>,
        spans: &[Span],
        material_friction: &MaterialFriction,
    ) -> f64 {
        if self.list.is_empty() {
            return 0.0;
        }
        spans
            .iter()
            .map(|&span| self.apply_to_span(window, span, material_friction))
            .sum()
    }

    fn apply_to_span(
        &self,
        window: &mut Window<'_, D>,
        span: Span,
        material_friction: &MaterialFriction,
    ) -> f64 {
        let within = |column: u32| (span.lo..span.hi).contains(&(column as usize));
        let start = span.row * self.layout.row_length - window.first;
        for node in self.solid.row(span.row) {
            if within(node.column) {
                let contact = self.list[node.obstacle as usize].contact;
                let index = start + node.column as usize;
                change_velocity(window, index, material_friction, |v, friction| {
                    contact.resolve(v, &node.normal, friction)
                });
            }
        }
        let mut work = 0.0;
        let Some(moving) = &self.moving else {
            return work;
        };
        let mut place = self.layout.row_coordinates(span.row);
        for node in moving.nodes.row(span.row) {
            if within(node.column) {
                place[D - 1] = node.column as usize;
                let x = self.layout.position(place);
                let obstacle = &self.list[node.obstacle as usize];
                let pose = moving.poses[node.obstacle as usize].as_ref();
                let (distance, normal) = obstacle.distance_in(pose, &x);
                if acts_at(distance, &self.layout) {
                    let index = start + node.column as usize;
                    let impulse =
                        change_velocity(window, index, material_friction, |v, friction| {
                            obstacle.resolve(pose, &x, v, &normal, friction)
                        });
                    work += f64::from(impulse.dot(&velocity_of(pose, &x)));
                }
            }
        }
        work
    }

    /// Whether one of them moves.
    pub fn any_moves(&self) -> bool {
        self.moving.is_some()
    }

    /// Whether a moving one is nearer to `x` than `reach` [m].
    pub fn moving_within(&self, reach: f32, x: &Vector<D>) -> bool {
        self.moving.as_ref().is_some_and(|moving| {
            let mut posed = self.list.iter().zip(&moving.poses);
            posed.any(|(obstacle, pose)| {
                pose.is_some() && obstacle.distance_in(pose.as_ref(), x).0 < reach
            })
        })
    }

    /// Whether there are any.
    pub fn any(&self) -> bool {
        !self.near.is_empty()
    }

    /// Whether the particle with this lowest stencil node has to be tested.
    #[inline(always)]
    pub fn near(&self, node: usize) -> bool {
        self.near[node]
    }

    /// The part of a node's spline [-] that lies in the nearest obstacle, whose face counts as plane.
    pub fn fill(&self, node: [usize; D]) -> f32 {
        let x = self.layout.position(node);
        let pose = |index: usize| self.moving.as_ref()?.poses[index].as_ref();
        let numbered = self.list.iter().enumerate();
        let distance = numbered
            .map(|(index, obstacle)| obstacle.distance_in(pose(index), &x).0)
            .fold(f32::INFINITY, f32::min);
        cumulative(f64::from(-distance / self.layout.dx())) as f32
    }

    /// Whether a point lies inside of one, as they are now.
    pub fn contains(&self, x: &Vector<D>) -> bool {
        let pose = |index: usize| self.moving.as_ref()?.poses[index].as_ref();
        let mut numbered = self.list.iter().enumerate();
        numbered.any(|(index, obstacle)| obstacle.distance_in(pose(index), x).0 < 0.0)
    }

    /// Moves a particle inside an obstacle to its surface. Returns the work of moving obstacles for the change of its
    /// velocity [J/kg].
    pub fn push_out(&self, x: &mut Vector<D>, v: &mut Vector<D>, material_friction: f32) -> f64 {
        let mut work = 0.0;
        for (index, obstacle) in self.list.iter().enumerate() {
            let pose = self
                .moving
                .as_ref()
                .and_then(|moving| moving.poses[index].as_ref());
            let (distance, normal) = obstacle.distance_in(pose, x);
            if distance < 0.0 {
                *x -= normal * self.correction(distance, pose, v);
                if pose.is_some() {
                    // A particle between an obstacle and a wall stays in the box; the obstacle passes it.
                    *x = Vector::from_fn(|axis, _| {
                        x[axis].clamp(self.walls.lower[axis], self.walls.upper[axis])
                    });
                }
                let changed = obstacle.resolve(pose, x, v, &normal, material_friction);
                work += f64::from((changed - *v).dot(&velocity_of(pose, x)));
                *v = changed;
            }
        }
        work
    }

    /// Displacement of a particle at this negative distance.
    ///
    /// A particle enters an obstacle at rest by at most the distance of one substep. A moving one may have trapped it deep
    /// inside against a wall; moved out at once, it would leave the active nodes around it.
    fn correction(&self, distance: f32, pose: Option<&Pose<D>>, v: &Vector<D>) -> f32 {
        match (&self.moving, pose) {
            (Some(moving), Some(_)) => distance.max(-moving.longest_push(v.norm(), moving.dt)),
            _ => distance,
        }
    }
}

/// Velocity of a solid at a point [m/s]; zero at rest.
fn velocity_of<const D: usize>(pose: Option<&Pose<D>>, x: &Vector<D>) -> Vector<D> {
    pose.map_or_else(Vector::zeros, |pose| pose.velocity_at(x))
}
