//! Points inside of solids: particles are moved out, and nodes count as filled.

use super::obstacles::Obstacles;
use super::wall_fill::cumulative;
use crate::linalg::{LANES, Lanes, Vector};

/// More than rounding changes a place by [lengths of the world].
const SLACK: f32 = 1.0e-5;
/// Distance from a node at which its spline ends [cells].
const SPLINE_CELLS: f32 = 1.5;

impl<const D: usize> Obstacles<D> {
    /// Whether a point lies inside of one, as they are now.
    pub fn contains(&self, x: &Vector<D>) -> bool {
        self.solids
            .near(x)
            .any(|index| self.depth(index, x).is_some())
    }

    /// Those of some points that may lie inside of one, among which are all that do.
    #[inline(always)]
    pub fn may_contain(&self, x: &[Lanes; D]) -> [bool; LANES] {
        if self.solids.has_bodies() {
            return [true; LANES];
        }
        let slack = SLACK * self.solids.layout.upper().max();
        let mut may = [false; LANES];
        for (index, obstacle) in self.solids.list.iter().enumerate() {
            let within = obstacle.may_contain(self.solids.pose(index), x, slack);
            for i in 0..LANES {
                may[i] |= within[i];
            }
        }
        may
    }

    /// Distance of a point inside of one, which is negative [m], and the normal; None outside.
    fn depth(&self, index: usize, x: &Vector<D>) -> Option<(f32, Vector<D>)> {
        let solids = &self.solids;
        if !solids.may_contain(index, x) {
            return None;
        }
        solids.list[index].depth_in(solids.pose(index), x)
    }

    /// Moves a particle inside a solid to its surface. Returns the work of moving obstacles for the change of its
    /// velocity [J/kg] and how far they moved it [m], and calls back with each solid, the place, and its change of the velocity.
    #[inline(never)]
    pub fn push_out(
        &self,
        x: &mut Vector<D>,
        v: &mut Vector<D>,
        material_friction: f32,
        mut pushed: impl FnMut(usize, &Vector<D>, &Vector<D>),
    ) -> (f64, f32) {
        let (mut work, mut moved) = (0.0, 0.0);
        let solids = &self.solids;
        let start = *x;
        for index in solids.near(&start) {
            let Some((distance, normal)) = self.depth(index, x) else {
                continue;
            };
            let correction = self.correction(index, distance, v);
            *x -= normal * correction;
            if solids.pose(index).is_some() {
                moved -= correction;
                // A particle between a solid and a wall stays in the box; the solid passes it.
                let (lower, upper) = (&solids.walls.lower, &solids.walls.upper);
                *x = Vector::from_fn(|axis, _| x[axis].clamp(lower[axis], upper[axis]));
            }
            let changed = solids.resolve(index, x, v, &normal, material_friction);
            let change = changed - *v;
            if !solids.is_body(index) {
                work += f64::from(change.dot(&solids.velocity(index, x)));
            }
            pushed(index, x, &change);
            *v = changed;
        }
        (work, moved)
    }

    /// Displacement of a particle at this negative distance.
    ///
    /// A particle enters an obstacle at rest by at most the distance of one substep. A moving one may have trapped it deep
    /// inside against a wall; moved out at once, it would leave the active nodes around it. On the way into a solid the two of
    /// them close by at most the sum of their speeds; the rest leads trapped particles out.
    fn correction(&self, index: usize, distance: f32, v: &Vector<D>) -> f32 {
        if self.solids.pose(index).is_none() {
            return distance;
        }
        let longest = (v.norm() + 2.0 * self.speed()) * self.solids.dt;
        distance.max(-longest)
    }

    /// The part of a node's spline [-] that lies in the nearest solid. The face of an obstacle at rest counts as plane. Of a
    /// rigid body, edges and curvature count too: the mean distance of points around is larger than that of the middle by the
    /// Laplacian of the distance, by which the fill of what is convex is less. So the sum over all nodes is the body's volume.
    pub fn fill(&self, node: [usize; D]) -> f32 {
        let (solids, dx) = (&self.solids, self.solids.layout.dx());
        let x = solids.layout.position(node);
        // The second moment of these points is that of the spline, 1/4 along each axis.
        let around = (0.25 * D as f32).sqrt() * dx;
        let mean = |index: usize| {
            let middle = solids.distance(index, &x).0;
            if !solids.is_body(index) || middle.abs() > SPLINE_CELLS * dx + around {
                return middle;
            }
            let beside = |axis: usize, side: f32| {
                let mut place = x;
                place[axis] += side * around;
                solids.distance(index, &place).0
            };
            let sums = (0..D).map(|axis| beside(axis, 1.0) + beside(axis, -1.0));
            sums.sum::<f32>() / (2 * D) as f32
        };
        let distance = solids.near(&x).map(mean).fold(f32::INFINITY, f32::min);
        cumulative(f64::from(-distance / dx)) as f32
    }
}
