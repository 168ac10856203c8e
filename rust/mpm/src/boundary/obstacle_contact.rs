//! Contact with solids at their true surface: velocities of nodes change on the lines across it, and deep inside.
//!
//! Lines along the first axis cross planes, which threads share out, so they have a stage of their own (`apply_across`) after that of
//! the others (`apply`). Lines across moving solids are found in each substep, once: the first stage that needs them keeps them in
//! `Found`. Rigid bodies need them before, to learn what they are about to meet (`probe`).

use super::contact_nodes::ContactNodes;
use super::crossings::{Batch, MANY};
use super::lines::{LINE_CELLS, Line, lowest_start};
use super::node::{MaterialFriction, acts_at, change_velocity};
use super::obstacles::Obstacles;
use super::reactions::{Found, Reactions};
use crate::grid::{CHUNK, SMALLEST_MASS, Span};
use crate::linalg::Vector;
use std::mem::take;
use std::ops::Range;
use wide::f32x4;

impl<const D: usize> Obstacles<D> {
    /// Whether there may be lines across surfaces that lie along the first axis.
    pub fn act_across(&self) -> bool {
        self.any_moves() || !self.lines[0].is_empty()
    }

    /// Acts on the velocities of a window of planes, but for lines along the first axis, and returns the work that moving
    /// obstacles do [J].
    pub fn apply(&self, nodes: &mut ContactNodes<'_, D>) -> f64 {
        if !self.any() {
            return 0.0;
        }
        let mut work = self.act_deep_inside(nodes);
        let planes = nodes.window.planes.clone();
        let mut found = take(&mut nodes.reactions.found);
        if !self.solids.has_bodies() {
            found.clear();
            self.find_lines(nodes, planes.clone(), |_| 0..D, &mut found);
        }
        for axis in (1..D).rev() {
            work += self.act_on_lines(nodes, self.lines_of(axis, planes.clone()));
            work += self.act_on_lines(nodes, &found.lines[axis]);
        }
        nodes.reactions.found = found;
        work
    }

    /// The same for lines along the first axis that begin in the planes `across`, after `apply` for the planes `within`, or after
    /// `probe`. What these found is not looked for again, for masses and places stay.
    pub fn apply_across(
        &self,
        nodes: &mut ContactNodes<'_, D>,
        [across, within]: [Range<usize>; 2],
    ) -> f64 {
        let mut found = take(&mut nodes.reactions.found);
        if !self.solids.has_bodies() {
            let beyond = within.end..across.end.max(within.end);
            self.find_lines(nodes, beyond, |_| 0..1, &mut found);
        }
        let first = across.start * self.solids.layout.nodes_per_plane();
        let first = found.lines[0].partition_point(|line| line.node < first);
        let work = self.act_on_lines(nodes, self.lines_of(0, across))
            + self.act_on_lines(nodes, &found.lines[0][first..]);
        for edge in &found.edges {
            nodes.act(&edge.line, edge.nodes(), &self.solids);
        }
        nodes.reactions.found = found;
        work
    }

    /// Finds what rigid bodies are about to meet, on lines along the first axis that begin in the planes `across`, and on others that
    /// begin in the planes `within`. The lines are kept, for masses and places stay until these act.
    pub fn probe(&self, nodes: &mut ContactNodes<'_, D>, [across, within]: [Range<usize>; 2]) {
        let mut found = take(&mut nodes.reactions.found);
        found.clear();
        let planes = across.start.min(within.start)..across.end.max(within.end);
        self.find_lines(nodes, planes, |_| 0..D, &mut found);
        self.part_edges(&mut found, &[across, within]);
        let lines = found.lines.iter().flatten();
        for line in lines.filter(|line| self.solids.is_body(line.obstacle as usize)) {
            nodes.probe(line, line.nodes(), &self.solids);
        }
        for edge in &found.edges {
            nodes.probe(&edge.line, edge.nodes(), &self.solids);
        }
        nodes.reactions.found = found;
    }

    /// Keeps the lines along the first axis that begin in the planes `across`, and others that begin in the planes `within`, but for
    /// those at edges of rigid bodies, which may reach into other planes: it moves them to the edges, where they begin `across`.
    fn part_edges(&self, found: &mut Found<D>, [across, within]: &[Range<usize>; 2]) {
        let (solids, layout) = (&self.solids, &self.solids.layout);
        for (axis, lines) in found.lines.iter_mut().enumerate() {
            lines.retain(|line| {
                let mut node = layout.row_coordinates(line.node / layout.row_length);
                node[D - 1] = line.node % layout.row_length;
                let is_across = across.contains(&node[0]);
                let is_body = solids.is_body(line.obstacle as usize);
                let edge = is_body.then(|| solids.at_edge(line, node, axis)).flatten();
                if let Some(edge) = edge {
                    found.edges.extend(is_across.then_some(edge));
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

    /// The lines across obstacles at rest that lie along an axis and begin in some planes.
    fn lines_of(&self, axis: usize, planes: Range<usize>) -> &[Line<D>] {
        let place = |plane: usize| {
            let first = plane * self.solids.layout.nodes_per_plane();
            self.lines[axis].partition_point(|line| line.node < first)
        };
        &self.lines[axis][place(planes.start)..place(planes.end)]
    }

    /// Adds the lines across moving solids that begin in some planes at a node with mass: those along the axes that are asked for in
    /// a plane.
    fn find_lines(
        &self,
        nodes: &ContactNodes<'_, D>,
        planes: Range<usize>,
        axes: impl Fn(usize) -> Range<usize>,
        found: &mut Found<D>,
    ) {
        let Some(movement) = &self.movement else {
            return;
        };
        let (solids, layout) = (&self.solids, &self.solids.layout);
        let (dx, moved) = (layout.dx(), movement.moved);
        let (window, elastic) = (&nodes.window, nodes.kinds.any_elastic());
        let shared = |chunk: usize| nodes.fields.is_some() && nodes.kinds.is_shared(chunk);
        let (mut candidates, mut near) = (Batch::<D, MANY>::new(), Batch::<D, MANY>::new());
        let find = |near: &mut Batch<D, MANY>, found: &mut Found<D>| {
            near.find(solids, elastic, &axes, &mut found.lines);
        };
        for span in window.active_in(planes) {
            let reachable = movement.nodes.row(span.row);
            if reachable.is_empty() {
                continue;
            }
            let mut place = layout.row_coordinates(span.row);
            for reachable in reachable {
                let (column, index) = (reachable.column as usize, reachable.obstacle as usize);
                let distance = reachable.distance;
                let lowest = lowest_start(&solids.list[index], dx);
                if distance + moved <= lowest
                    || distance - moved > LINE_CELLS * dx
                    || !(span.lo..span.hi).contains(&column)
                {
                    continue;
                }
                let memory = span.row * layout.row_length + column;
                let mass = window.nodes[memory - window.first].as_array()[3];
                if mass <= SMALLEST_MASS && !shared(memory / CHUNK) {
                    continue;
                }
                place[D - 1] = column;
                if candidates.ends_before(index) {
                    candidates.pass_on(solids, &mut near, |near| find(near, found));
                }
                candidates.add(index, (place, memory), layout);
            }
        }
        candidates.pass_on(solids, &mut near, |near| find(near, found));
        find(&mut near, found);
    }

    fn act_on_lines(&self, nodes: &mut ContactNodes<'_, D>, lines: &[Line<D>]) -> f64 {
        let act = |line: &Line<D>| {
            let work = nodes.act(line, line.nodes(), &self.solids);
            if self.solids.is_body(line.obstacle as usize) {
                0.0
            } else {
                work
            }
        };
        lines.iter().map(act).sum()
    }

    /// Acts on the nodes of a window that belong to no line across a surface: those deep inside.
    fn act_deep_inside(&self, nodes: &mut ContactNodes<'_, D>) -> f64 {
        let row_length = self.solids.layout.row_length;
        let (friction, reactions) = (nodes.friction, &mut *nodes.reactions);
        let mut work = 0.0;
        let window = &mut nodes.window;
        for &span in window.active() {
            let start = (span.row * row_length) as isize - window.first as isize;
            let target = (&mut *window.nodes, &*window.friction_mass);
            work += self.act_deep_in_span(target, start, span, friction, reactions);
        }
        if let Some(fields) = &mut nodes.fields {
            for (number, slot) in fields.slots.iter().enumerate() {
                let node = slot.chunk as usize * CHUNK;
                let (row, lo) = (node / row_length, node % row_length);
                let hi = lo + CHUNK;
                let start = (number * CHUNK) as isize - lo as isize;
                let target = (&mut *fields.nodes, &*fields.friction_mass);
                let span = Span { row, lo, hi };
                work += self.act_deep_in_span(target, start, span, friction, reactions);
            }
        }
        work
    }

    /// The same in a span, the first of whose row has the number `start` among those given.
    fn act_deep_in_span(
        &self,
        (nodes, friction_mass): (&mut [f32x4], &[f32]),
        start: isize,
        span: Span,
        friction: &MaterialFriction,
        reactions: &mut Reactions<D>,
    ) -> f64 {
        let (solids, layout) = (&self.solids, &self.solids.layout);
        let (resting, movement) = (self.deep.row(span.row), self.movement.as_ref());
        let moving = movement.map_or(&[][..], |movement| movement.deep.row(span.row));
        if resting.is_empty() && moving.is_empty() {
            return 0.0;
        }
        let mut place = layout.row_coordinates(span.row);
        let mut work = 0.0;
        // A normal that is not known yet is that of where a moving solid is now.
        let mut act = |column: u32, index: u32, known: Option<Vector<D>>| {
            let (column, index) = (column as usize, index as usize);
            if !(span.lo..span.hi).contains(&column) {
                return;
            }
            let number = start.wrapping_add_unsigned(column) as usize;
            if nodes[number].as_array()[3] <= SMALLEST_MASS {
                return;
            }
            place[D - 1] = column;
            let x = layout.position(place);
            let normal = known.or_else(|| {
                let (distance, normal) = solids.distance(index, &x);
                acts_at(distance, 0.0, layout).then_some(normal)
            });
            let Some(normal) = normal else {
                return;
            };
            let impulse = change_velocity(&mut nodes[number], |v, mass| {
                let friction = friction.at(friction_mass, number, mass);
                solids.resolve(index, &x, v, &normal, friction)
            });
            reactions.push(index, &x, &impulse);
            if !solids.is_body(index) {
                work += f64::from(impulse.dot(&solids.velocity(index, &x)));
            }
        };
        for node in resting {
            act(node.column, node.obstacle, Some(node.normal));
        }
        let moved = movement.map_or(0.0, |movement| movement.moved);
        for node in moving {
            if acts_at(node.distance, moved, layout) {
                act(node.column, node.obstacle, None);
            }
        }
        work
    }
}
