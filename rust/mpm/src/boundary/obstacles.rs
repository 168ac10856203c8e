//! All solids of a scene: contact on grid nodes, and particles kept outside.

use super::contact::Walls;
use super::crossings::Batch;
use super::edge::EdgeLine;
use super::line_window::LineWindow;
use super::lines::{LINE_CELLS, Line, Solids, lowest_start};
use super::motion::Pose;
use super::moving::{MovingObstacles, search_row};
use super::node::{
    ByRow, MaterialFriction, Nearness, acts_at, change_velocity, may_act_at, reach_until_sort,
};
use super::obstacle::Obstacle;
use super::reactions::Reactions;
use super::shape::Shape;
use super::wall_fill::cumulative;
use crate::grid::{CHUNK, FieldMap, FieldWindow, Layout, PADDING, SMALLEST_MASS, Span, Window};
use crate::linalg::{LANES, Lanes, Vector};
use std::ops::Range;
use threads::interrupted;
use wide::f32x4;

/// More than rounding changes a place [lengths of the world].
const SLACK: f32 = 1.0e-5;

/// Distance from a node at which its spline ends [cells].
const SPLINE_CELLS: f32 = 1.5;

/// A grid node deep inside an obstacle at rest.
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
    /// Those of the scene, then its rigid bodies.
    list: Vec<Obstacle<D>>,
    /// Number of the first rigid body.
    first_body: usize,
    walls: Walls<D>,
    layout: Layout<D>,
    /// Nodes deep inside obstacles at rest.
    solid: ByRow<SolidNode<D>>,
    /// Lines of nodes across the surfaces of obstacles at rest, by the axis along which they lie.
    lines: [Vec<Line<D>>; D],
    /// Duration of the substep [s].
    dt: f32,
    /// None where all obstacles are at rest.
    moving: Option<MovingObstacles<D>>,
    /// Whether what is at a node may touch an obstacle; empty without obstacles.
    near: Vec<Nearness>,
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
        let first_body = list.len();
        let list = list.into_iter();
        let mut prepared = Self {
            list: list
                .map(|obstacle| obstacle.prepared(walls, layout.upper().max(), layout.dx()))
                .collect(),
            first_body,
            walls: *walls,
            layout: *layout,
            solid: ByRow::EMPTY,
            lines: std::array::from_fn(|_| Vec::new()),
            dt: f32::INFINITY,
            moving: None,
            near: Vec::new(),
        };
        prepared.list.extend(
            bodies
                .iter()
                .map(|(shape, _)| Obstacle::of_body(shape, layout.dx())),
        );
        if prepared.list.is_empty() {
            return prepared;
        }
        prepared.find_solid_nodes();
        if (0..prepared.list.len()).any(|index| prepared.moves(index)) {
            let reaches = bodies
                .iter()
                .map(|(shape, _)| shape.reach(&Vector::zeros()));
            prepared.moving = Some(MovingObstacles::new(
                prepared.list.len(),
                reaches.collect(),
                prepared.near.clone(),
                layout,
            ));
            prepared.place_bodies(bodies.iter().map(|(_, pose)| *pose));
            prepared.move_to(0.0, 0.0);
        }
        prepared
    }

    /// Whether an obstacle is not at rest.
    fn moves(&self, index: usize) -> bool {
        self.list[index].motion.is_some() || index >= self.first_body
    }

    /// Puts the rigid bodies where they are; `move_to` follows.
    pub fn place_bodies(&mut self, poses: impl Iterator<Item = Pose<D>>) {
        if let Some(moving) = &mut self.moving {
            for (place, pose) in moving.poses[self.first_body..].iter_mut().zip(poses) {
                *place = Some(pose);
            }
        }
    }

    /// Where the rigid bodies are.
    pub fn body_poses(&self) -> impl Iterator<Item = &Pose<D>> {
        self.moving.iter().flat_map(MovingObstacles::body_poses)
    }

    /// Finds the nodes and lines on which obstacles at rest act.
    fn find_solid_nodes(&mut self) {
        let layout = self.layout;
        let solids = Solids {
            list: &self.list[..self.first_body],
            reaches: &[],
            poses: &[],
            buckets: None,
            layout: &layout,
            dt: self.dt,
            elastic: true,
        };
        let rows_per_plane = layout.rows_per_plane();
        self.near = vec![Nearness::Never; layout.row_count() * layout.row_length];
        let mut solid = Vec::new();
        'all: for (index, obstacle) in self.list.iter().enumerate() {
            if self.moves(index) {
                continue;
            }
            let [lower, upper] = obstacle.shape.bounds();
            let reach = reach_until_sort(&layout);
            let nodes = |axis: usize| {
                // Solids may reach to infinity.
                let farthest = layout.upper()[axis] + 1.0;
                let resolution = layout.resolution as f32;
                let cells = |x: f32| x.clamp(-1.0, farthest) * resolution + PADDING as f32;
                let (lo, hi) = (cells(lower[axis] - reach), cells(upper[axis] + reach));
                // Conversion saturates at zero.
                let node = |cell: f32| (cell as usize).min(layout.extents[axis]);
                node(lo.floor())..node(hi.ceil() + 1.0)
            };
            let rows = if D == 3 { nodes(1) } else { 0..1 };
            for row in nodes(0).flat_map(|plane| rows.clone().map(move |row| (plane, row))) {
                if interrupted() {
                    break 'all;
                }
                let row = row.0 * rows_per_plane + row.1;
                let near = &mut self.near[row * layout.row_length..][..layout.columns()];
                let mut node = layout.row_coordinates(row);
                let found = |column: usize, distance: f32, normal: Vector<D>| {
                    node[D - 1] = column;
                    if acts_at(distance, &layout) {
                        let (column, obstacle) = (column as u32, index as u32);
                        solid.push((
                            row,
                            SolidNode {
                                column,
                                obstacle,
                                normal,
                            },
                        ));
                    } else if distance > lowest_start(obstacle, layout.dx()) {
                        let memory = row * layout.row_length + column;
                        for axis in 0..D {
                            let outside = (node, memory);
                            let at = (distance, normal);
                            let line = |up: f32| solids.line(index, outside, at, axis, up);
                            self.lines[axis].extend([1.0, -1.0].into_iter().filter_map(line));
                        }
                    }
                };
                search_row((obstacle, None), &layout, row, 0.0, near, found);
            }
        }
        solid.sort_by_key(|(row, node)| (*row, node.column, node.obstacle));
        self.solid.clear();
        let mut solid = solid.into_iter().peekable();
        for row in 0..layout.row_count() {
            while let Some((_, node)) = solid.next_if(|(of, _)| *of == row) {
                self.solid.nodes.push(node);
            }
            self.solid.end_row();
        }
        for lines in &mut self.lines {
            lines.sort_by_key(|line| (line.node, line.obstacle));
        }
    }

    /// Takes the end of a substep of length `dt` [s], and puts the moving obstacles where they are then [s]. Returns whether
    /// `near_until_sort` may have changed.
    pub fn move_to(&mut self, time: f64, dt: f32) -> bool {
        self.dt = dt;
        let moving = self.moving.as_mut();
        moving.is_some_and(|moving| {
            moving.move_to(&self.list, &self.layout, time, dt, &mut self.near)
        })
    }

    /// Bound on the speed of the moving solids [m/s]; 0 where all are at rest.
    pub fn speed(&self) -> f32 {
        self.moving.as_ref().map_or(0.0, |moving| moving.speed)
    }

    /// Whether there may be lines across surfaces that lie along the first axis.
    pub fn act_across(&self) -> bool {
        self.moving.is_some() || !self.lines[0].is_empty()
    }

    /// Lets obstacles act on the velocities of a window of planes, but for lines along the first axis, and returns the work
    /// that moving ones do [J].
    pub fn apply(
        &self,
        window: &mut Window<'_, D>,
        fields: &mut Option<FieldWindow<'_, D>>,
        kinds: FieldMap<'_>,
        friction: &MaterialFriction,
        reactions: &mut Reactions<D>,
    ) -> f64 {
        if self.list.is_empty() {
            return 0.0;
        }
        let mut work = 0.0;
        let first = window.first as isize;
        let row_length = self.layout.row_length;
        for &span in window.active() {
            let start = (span.row * row_length) as isize - first;
            let target = (&mut *window.nodes, &*window.friction_mass);
            work += self.apply_to_deep(target, start, span, friction, reactions);
        }
        if let Some(fields) = fields {
            for (number, slot) in fields.slots.iter().enumerate() {
                let node = slot.chunk as usize * CHUNK;
                let (row, lo) = (node / row_length, node % row_length);
                let hi = lo + CHUNK;
                let start = (number * CHUNK) as isize - lo as isize;
                let target = (&mut *fields.nodes, &*fields.friction_mass);
                let span = Span { row, lo, hi };
                work += self.apply_to_deep(target, start, span, friction, reactions);
            }
        }
        let mut moving = reactions.lines.each_mut().map(std::mem::take);
        if !self.has_bodies() {
            moving.iter_mut().for_each(Vec::clear);
            let planes = window.planes.clone();
            let all = |_| 0..D;
            self.find_lines(window, fields.as_ref(), kinds, planes, all, &mut moving);
        }
        let mut lines = LineWindow {
            window,
            fields,
            kinds,
            friction,
            reactions,
        };
        for axis in (1..D).rev() {
            let planes = lines.window.planes.clone();
            work += self.act_on_lines(&mut lines, self.lines_of(axis, planes));
            work += self.act_on_lines(&mut lines, moving[axis].iter());
        }
        reactions.lines = moving;
        work
    }

    /// The same for lines along the first axis that begin in the planes `across`, after `apply` for the planes `within`, or after
    /// `probe`. What these found is not looked for again, for masses and places stay.
    pub fn apply_across(
        &self,
        window: &mut Window<'_, D>,
        fields: &mut Option<FieldWindow<'_, D>>,
        kinds: FieldMap<'_>,
        friction: &MaterialFriction,
        [across, within]: [Range<usize>; 2],
        reactions: &mut Reactions<D>,
    ) -> f64 {
        let mut moving = reactions.lines.each_mut().map(std::mem::take);
        if !self.has_bodies() {
            let (beyond, first) = (within.end..across.end.max(within.end), |_| 0..1);
            self.find_lines(window, fields.as_ref(), kinds, beyond, first, &mut moving);
        }
        let first = across.start * self.layout.nodes_per_plane();
        let first = moving[0].partition_point(|line| line.node < first);
        let mut lines = LineWindow {
            window,
            fields,
            kinds,
            friction,
            reactions,
        };
        let work = self.act_on_lines(&mut lines, self.lines_of(0, across))
            + self.act_on_lines(&mut lines, moving[0][first..].iter());
        let edges = std::mem::take(&mut lines.reactions.edges);
        let solids = self.solids(true);
        for edge in &edges {
            lines.act_at_edge(edge, &solids, false);
        }
        (reactions.lines, reactions.edges) = (moving, edges);
        work
    }

    /// The lines across obstacles at rest that lie along an axis and begin in some planes.
    fn lines_of(&self, axis: usize, planes: Range<usize>) -> impl Iterator<Item = &Line<D>> {
        let place = |plane: usize| {
            let first = plane * self.layout.nodes_per_plane();
            self.lines[axis].partition_point(|line| line.node < first)
        };
        self.lines[axis][place(planes.start)..place(planes.end)].iter()
    }

    /// Adds the lines across moving obstacles that begin in some planes at a node with mass: those along the axes that are asked for
    /// in a plane.
    fn find_lines(
        &self,
        window: &Window<'_, D>,
        fields: Option<&FieldWindow<'_, D>>,
        kinds: FieldMap<'_>,
        planes: Range<usize>,
        axes: impl Fn(usize) -> Range<usize>,
        found: &mut [Vec<Line<D>>; D],
    ) {
        let Some(moving) = &self.moving else {
            return;
        };
        let solids = self.solids(kinds.any_elastic());
        let shared = |chunk: usize| fields.is_some_and(|fields| fields.map().is_shared(chunk));
        let mut batch = Batch::new();
        for span in window.active_in(planes) {
            let mut place = self.layout.row_coordinates(span.row);
            for reachable in moving.nodes.row(span.row) {
                let column = reachable.column as usize;
                let (distance, moved) = (reachable.distance, moving.moved);
                let (dx, index) = (self.layout.dx(), reachable.obstacle as usize);
                let lowest = lowest_start(&self.list[index], dx);
                if distance + moved <= lowest || distance - moved > LINE_CELLS * dx {
                    continue;
                }
                if !(span.lo..span.hi).contains(&column) {
                    continue;
                }
                let memory = span.row * self.layout.row_length + column;
                let mass = window.nodes[memory - window.first].as_array()[3];
                if mass <= SMALLEST_MASS && !shared(memory / CHUNK) {
                    continue;
                }
                place[D - 1] = column;
                if batch.ends_before(index) {
                    batch.find(&solids, &axes, found);
                }
                batch.add(index, (place, memory), &self.layout);
            }
        }
        batch.find(&solids, &axes, found);
    }

    fn act_on_lines<'l>(
        &self,
        target: &mut LineWindow<'_, '_, '_, D>,
        lines: impl Iterator<Item = &'l Line<D>>,
    ) -> f64 {
        let solids = self.solids(true);
        lines
            .map(|line| {
                let work = target.act(line, &solids, false);
                if self.is_body(line.obstacle) {
                    0.0
                } else {
                    work
                }
            })
            .sum()
    }

    /// Finds what rigid bodies are about to meet, on lines along the first axis that begin in the planes `across`, and on others that
    /// begin in the planes `within`. The lines are kept, for masses and places stay until these act.
    pub fn probe(
        &self,
        window: &mut Window<'_, D>,
        fields: &mut Option<FieldWindow<'_, D>>,
        kinds: FieldMap<'_>,
        friction: &MaterialFriction,
        [across, within]: [Range<usize>; 2],
        reactions: &mut Reactions<D>,
    ) {
        let mut moving = reactions.lines.each_mut().map(std::mem::take);
        moving.iter_mut().for_each(Vec::clear);
        let planes = across.start.min(within.start)..across.end.max(within.end);
        let all = |_| 0..D;
        self.find_lines(window, fields.as_ref(), kinds, planes, all, &mut moving);
        let mut edges = std::mem::take(&mut reactions.edges);
        self.part_edges(&mut moving, &mut edges, kinds, &[across, within]);
        let solids = self.solids(true);
        let mut lines = LineWindow {
            window,
            fields,
            kinds,
            friction,
            reactions,
        };
        let bodies = moving
            .iter()
            .flatten()
            .filter(|line| self.is_body(line.obstacle));
        for line in bodies {
            lines.act(line, &solids, true);
        }
        for edge in &edges {
            lines.act_at_edge(edge, &solids, true);
        }
        (reactions.lines, reactions.edges) = (moving, edges);
    }

    /// Keeps the lines along the first axis that begin in the planes `across`, and others that begin in the planes `within`, but for
    /// those at edges of rigid bodies, which may reach into other planes: it moves them to `edges`, where they begin `across`.
    fn part_edges(
        &self,
        lines: &mut [Vec<Line<D>>; D],
        edges: &mut Vec<EdgeLine<D>>,
        kinds: FieldMap<'_>,
        [across, within]: &[Range<usize>; 2],
    ) {
        let (layout, solids) = (self.layout, self.solids(kinds.any_elastic()));
        edges.clear();
        for (axis, lines) in lines.iter_mut().enumerate() {
            lines.retain(|line| {
                let mut node = layout.row_coordinates(line.node / layout.row_length);
                node[D - 1] = line.node % layout.row_length;
                let is_across = across.contains(&node[0]);
                // Nothing has room to flow from beside a face that all but lies on a wall.
                let may_be = self.is_body(line.obstacle) && !self.is_at_wall(line, axis);
                if let Some(edge) = may_be.then(|| solids.at_edge(line, node, axis)).flatten() {
                    edges.extend(is_across.then_some(edge));
                    return false;
                }
                if axis == 0 {
                    is_across
                } else {
                    within.contains(&node[0])
                }
            });
        }
    }

    /// Whether a line's face is nearer than a cell to the wall that it faces.
    fn is_at_wall(&self, line: &Line<D>, axis: usize) -> bool {
        let room = if line.normal[axis] < 0.0 {
            line.x[axis] - self.walls.lower[axis]
        } else {
            self.walls.upper[axis] - line.x[axis]
        };
        room < self.layout.dx()
    }

    fn has_bodies(&self) -> bool {
        self.first_body < self.list.len()
    }

    /// Whether this is a rigid body, whose work is no gain of the scene.
    fn is_body(&self, obstacle: u32) -> bool {
        obstacle as usize >= self.first_body
    }

    /// `elastic` where elastic bodies may touch them.
    fn solids(&self, elastic: bool) -> Solids<'_, D> {
        Solids {
            list: &self.list,
            reaches: (self.moving.as_ref()).map_or(&[], |moving| &moving.reaches),
            poses: (self.moving.as_ref()).map_or(&[], |moving| &moving.poses),
            buckets: (self.moving.as_ref())
                .filter(|_| self.has_bodies())
                .map(|moving| &moving.buckets),
            layout: &self.layout,
            dt: self.dt,
            elastic,
        }
    }

    /// Acts on the nodes deep inside in a span, the first of whose row has the number `start` among those given.
    fn apply_to_deep(
        &self,
        (nodes, friction_mass): (&mut [f32x4], &[f32]),
        start: isize,
        span: Span,
        material_friction: &MaterialFriction,
        reactions: &mut Reactions<D>,
    ) -> f64 {
        let within = |column: u32| (span.lo..span.hi).contains(&(column as usize));
        let number = |column: u32| start.wrapping_add_unsigned(column as usize) as usize;
        for node in self.solid.row(span.row) {
            if within(node.column) {
                let contact = self.list[node.obstacle as usize].contact;
                let index = number(node.column);
                let impulse = change_velocity(&mut nodes[index], |v, mass| {
                    let friction = material_friction.at(friction_mass, index, mass);
                    contact.resolve(v, &node.normal, friction)
                });
                if impulse != Vector::<D>::zeros() {
                    let mut place = self.layout.row_coordinates(span.row);
                    place[D - 1] = node.column as usize;
                    let x = self.layout.position(place);
                    reactions.push(node.obstacle as usize, &x, &impulse);
                }
            }
        }
        let mut work = 0.0;
        let Some(moving) = &self.moving else {
            return work;
        };
        let mut place = self.layout.row_coordinates(span.row);
        for node in moving.nodes.row(span.row) {
            if !may_act_at(node.distance, moving.moved, &self.layout) {
                continue;
            }
            let index = number(node.column);
            if within(node.column) && nodes[index].as_array()[3] > SMALLEST_MASS {
                place[D - 1] = node.column as usize;
                let x = self.layout.position(place);
                let obstacle = &self.list[node.obstacle as usize];
                let pose = moving.poses[node.obstacle as usize].as_ref();
                let (distance, normal) = obstacle.distance_in(pose, &x);
                if acts_at(distance, &self.layout) {
                    let impulse = change_velocity(&mut nodes[index], |v, mass| {
                        let friction = material_friction.at(friction_mass, index, mass);
                        obstacle.resolve(pose, &x, v, &normal, friction)
                    });
                    reactions.push(node.obstacle as usize, &x, &impulse);
                    if !self.is_body(node.obstacle) {
                        work += f64::from(impulse.dot(&velocity_of(pose, &x)));
                    }
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

    /// Whether a particle with this lowest node of its stencil has to be tested in this substep.
    #[inline(always)]
    pub fn near_stencil(&self, start: usize) -> bool {
        self.near[start + self.layout.stencil_middle()] == Nearness::Now
    }

    /// Whether it may have to be before the next sort.
    #[inline(always)]
    pub fn near_until_sort(&self, start: usize) -> bool {
        self.near[start + self.layout.stencil_middle()] != Nearness::Never
    }

    /// Whether an obstacle reaches the spline of a node.
    #[inline(always)]
    pub fn near_node(&self, node: usize) -> bool {
        self.near[node] == Nearness::Now
    }

    /// The part of a node's spline [-] that lies in the nearest obstacle. The face of an obstacle at rest counts as plane. Of a
    /// rigid body, edges and curvature count too: the mean distance of points around is larger than that of the middle by the
    /// Laplacian of the distance, by which the fill of what is convex is less. So the sum over all nodes is the body's volume.
    pub fn fill(&self, node: [usize; D]) -> f32 {
        let x = self.layout.position(node);
        let dx = self.layout.dx();
        let solids = self.solids(true);
        let distance = |index: usize, x: &Vector<D>| {
            let pose = solids.pose(index);
            self.list[index].distance_in(pose, x).0
        };
        // The second moment of these points is that of the spline, 1/4 along each axis.
        let around = (0.25 * D as f32).sqrt() * dx;
        let mean = |index: usize| {
            let middle = distance(index, &x);
            if index < self.first_body || middle.abs() > SPLINE_CELLS * dx + around {
                return middle;
            }
            let beside = |axis: usize, side: f32| {
                let mut place = x;
                place[axis] += side * around;
                distance(index, &place)
            };
            let sums = (0..D).map(|axis| beside(axis, 1.0) + beside(axis, -1.0));
            sums.sum::<f32>() / (2 * D) as f32
        };
        let distance = solids.near(&x).map(mean).fold(f32::INFINITY, f32::min);
        cumulative(f64::from(-distance / dx)) as f32
    }

    /// Whether a point lies inside of one, as they are now.
    pub fn contains(&self, x: &Vector<D>) -> bool {
        let solids = self.solids(true);
        solids.near(x).any(|index| {
            let pose = solids.pose(index);
            solids.may_contain(index, x) && self.list[index].depth_in(pose, x).is_some()
        })
    }

    /// Those of some points that may lie inside of one, among which are all that do.
    #[inline(always)]
    pub fn may_contain(&self, x: &[Lanes; D]) -> [bool; LANES] {
        if self.has_bodies() {
            return [true; LANES];
        }
        let slack = SLACK * self.layout.upper().max();
        let mut least = [f32::INFINITY; LANES];
        for (index, obstacle) in self.list.iter().enumerate() {
            let pose = self.moving.as_ref();
            let pose = pose.and_then(|moving| moving.poses[index].as_ref());
            let excess = obstacle.excess(pose, x, slack);
            for i in 0..LANES {
                least[i] = least[i].min(excess[i]);
            }
        }
        least.map(|excess| excess <= 0.0)
    }

    /// Moves a particle inside an obstacle to its surface. Returns the work of moving obstacles for the change of its
    /// velocity [J/kg] and how far they moved it [m], and calls back with each obstacle, the place, and its change of the velocity.
    #[inline(never)]
    pub fn push_out(
        &self,
        x: &mut Vector<D>,
        v: &mut Vector<D>,
        material_friction: f32,
        mut pushed: impl FnMut(usize, &Vector<D>, &Vector<D>),
    ) -> (f64, f32) {
        let (mut work, mut moved) = (0.0, 0.0);
        let solids = self.solids(true);
        let start = *x;
        for index in solids.near(&start) {
            let obstacle = &self.list[index];
            if !solids.may_contain(index, x) {
                continue;
            }
            let pose = solids.pose(index);
            if let Some((distance, normal)) = obstacle.depth_in(pose, x) {
                let correction = self.correction(distance, pose, v);
                *x -= normal * correction;
                if pose.is_some() {
                    moved -= correction;
                    // A particle between an obstacle and a wall stays in the box; the obstacle passes it.
                    *x = Vector::from_fn(|axis, _| {
                        x[axis].clamp(self.walls.lower[axis], self.walls.upper[axis])
                    });
                }
                let changed = obstacle.resolve(pose, x, v, &normal, material_friction);
                let change = changed - *v;
                if index < self.first_body {
                    work += f64::from(change.dot(&velocity_of(pose, x)));
                }
                pushed(index, x, &change);
                *v = changed;
            }
        }
        (work, moved)
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
