//! The solids of a scene where they are at one instant: obstacles, then rigid bodies.

use super::buckets::{BUCKET_MARGIN_CELLS, Buckets};
use super::contact::Walls;
use super::motion::Pose;
use super::obstacle::Obstacle;
use super::shape::Shape;
use crate::grid::{Layout, PADDING};
use crate::linalg::Vector;
use std::ops::Range;

#[derive(Debug, Clone)]
pub struct Solids<const D: usize> {
    pub list: Vec<Obstacle<D>>,
    /// Number of the first rigid body.
    pub first_body: usize,
    /// None of what is at rest.
    pub poses: Vec<Option<Pose<D>>>,
    /// The distance that each rigid body reaches from its centre [m].
    pub reaches: Vec<f32>,
    /// Where rigid bodies are looked for; None without any.
    buckets: Option<Buckets<D>>,
    pub walls: Walls<D>,
    pub layout: Layout<D>,
    /// Duration of the substep [s].
    pub dt: f32,
}

impl<const D: usize> Solids<D> {
    /// Obstacles, and rigid bodies by their shapes about their centres, which `place_bodies` places.
    pub fn new<'s>(
        obstacles: Vec<Obstacle<D>>,
        bodies: impl Iterator<Item = &'s Shape<D>> + Clone,
        walls: &Walls<D>,
        layout: &Layout<D>,
    ) -> Self {
        let (length, dx) = (layout.upper().max(), layout.dx());
        let obstacles = obstacles.into_iter();
        let mut list: Vec<_> = obstacles
            .map(|obstacle| obstacle.prepared(walls, length, dx))
            .collect();
        let first_body = list.len();
        list.extend(bodies.clone().map(|shape| Obstacle::of_body(shape, dx)));
        let reaches: Vec<_> = bodies.map(|shape| shape.reach(&Vector::zeros())).collect();
        Self {
            first_body,
            poses: vec![None; list.len()],
            buckets: (!reaches.is_empty()).then(|| Buckets::new(layout)),
            reaches,
            list,
            walls: *walls,
            layout: *layout,
            dt: f32::INFINITY,
        }
    }

    /// Whether one is not at rest.
    pub fn moves(&self, index: usize) -> bool {
        self.list[index].motion.is_some() || self.is_body(index)
    }

    /// Whether this is a rigid body, whose work is no gain of the scene.
    pub fn is_body(&self, index: usize) -> bool {
        index >= self.first_body
    }

    pub fn has_bodies(&self) -> bool {
        !self.reaches.is_empty()
    }

    pub fn pose(&self, index: usize) -> Option<&Pose<D>> {
        self.poses[index].as_ref()
    }

    /// Where rigid bodies are.
    pub fn body_poses(&self) -> impl Iterator<Item = &Pose<D>> {
        self.poses[self.first_body..].iter().flatten()
    }

    pub fn place_bodies(&mut self, poses: impl Iterator<Item = Pose<D>>) {
        for (place, pose) in self.poses[self.first_body..].iter_mut().zip(poses) {
            *place = Some(pose);
        }
    }

    /// Finds rigid bodies where they are now from here on.
    pub fn fill_buckets(&mut self) {
        let Some(buckets) = &mut self.buckets else {
            return;
        };
        buckets.clear();
        let margin = BUCKET_MARGIN_CELLS * self.layout.dx();
        for (number, reach) in self.reaches.iter().enumerate() {
            let body = self.first_body + number;
            if let Some(pose) = &self.poses[body] {
                buckets.add(body as u32, &pose.center(), reach + margin);
            }
        }
    }

    /// The numbers of all obstacles, then of the rigid bodies that may be near to a point.
    #[inline(always)]
    pub fn near(&self, x: &Vector<D>) -> impl Iterator<Item = usize> + use<'_, D> {
        let bodies = (self.buckets.as_ref()).map_or(&[][..], |buckets| buckets.at(x));
        (0..self.first_body).chain(bodies.iter().map(|body| *body as usize))
    }

    /// Whether a point may lie inside of one: false for those far from a rigid body.
    #[inline(always)]
    pub fn may_contain(&self, index: usize, x: &Vector<D>) -> bool {
        !self.is_body(index)
            || self.pose(index).is_none_or(|pose| {
                let reach = self.reaches[index - self.first_body];
                (x - pose.center()).norm_squared() <= reach * reach
            })
    }

    /// Nodes along each axis, among which are all that are nearer to one than `reach` [m].
    pub fn nodes_within(&self, index: usize, reach: f32) -> [Range<usize>; D] {
        let layout = &self.layout;
        let [lower, upper] = self.list[index].bounds_in(self.pose(index));
        std::array::from_fn(|axis| {
            // Solids may reach to infinity.
            let farthest = layout.upper()[axis] + 1.0;
            let resolution = layout.resolution as f32;
            let cells = |x: f32| x.clamp(-1.0, farthest) * resolution + PADDING as f32;
            let (lo, hi) = (cells(lower[axis] - reach), cells(upper[axis] + reach));
            // Conversion saturates at zero.
            let node = |cell: f32| (cell as usize).min(layout.extents[axis]);
            node(lo.floor())..node(hi.ceil() + 1.0)
        })
    }

    /// Signed distance of a point from one [m], and unit normal.
    pub fn distance(&self, index: usize, x: &Vector<D>) -> (f32, Vector<D>) {
        self.list[index].distance_in(self.pose(index), x)
    }

    /// Velocity of one at a point [m/s].
    pub fn velocity(&self, index: usize, x: &Vector<D>) -> Vector<D> {
        (self.pose(index)).map_or_else(Vector::zeros, |pose| pose.velocity_at(x))
    }
    /// Velocity of material after contact with one, at a point of it with this normal.
    pub fn resolve(
        &self,
        index: usize,
        x: &Vector<D>,
        v: &Vector<D>,
        normal: &Vector<D>,
        friction: f32,
    ) -> Vector<D> {
        let (contact, surface) = (&self.list[index].contact, self.velocity(index, x));
        contact.resolve(&(v - surface), normal, friction) + surface
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boundary::{Contact, ContactKind, Motion};

    const CONTACT: Contact = Contact {
        kind: ContactKind::Separating,
        friction: None,
    };

    #[test]
    fn all_nodes_near_to_what_has_turned_are_within_its_ranges() {
        let (layout, reach) = (Layout::<2>::unit(32), 0.11);
        let side = layout.extents[0];
        let walls = Walls::uniform(Vector::zeros(), Vector::repeat(1.0), CONTACT);
        let (lower, upper) = (Vector::<2>::new(0.4, 0.2), Vector::<2>::new(0.45, 0.8));
        let (point, normal) = (upper, Vector::<2>::new(0.6, 0.8));
        for (shape, widest) in [
            (Shape::Box { lower, upper }, 26),
            (Shape::HalfSpace { point, normal }, side),
        ] {
            let motion = Motion::new(Vector::zeros(), &[1.0], lower, None).unwrap();
            let obstacle = Obstacle::new(shape, CONTACT).unwrap().moving(motion);
            let mut solids = Solids::new(vec![obstacle], [].into_iter(), &walls, &layout);
            solids.poses[0] = Some(motion.pose(0.6));
            let within = solids.nodes_within(0, reach);
            let near = |node: [usize; 2]| solids.distance(0, &layout.position(node)).0 < reach;
            let nodes = (0..side * side).map(|k| [k % side, k / side]);
            for node in nodes.filter(|node| near(*node)) {
                assert!((0..2).all(|axis| within[axis].contains(&node[axis])));
            }
            assert!(within[0].len() <= widest, "{within:?}");
        }
    }
}
