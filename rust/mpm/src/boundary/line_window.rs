//! The nodes on which lines act.

use super::edge::{EDGE_NODES, EdgeLine};
use super::lines::{Line, Solids};
use super::node::MaterialFriction;
use super::reactions::Reactions;
use crate::grid::{CHUNK, FieldMap, FieldWindow, NodePlace, SMALLEST_MASS, Window};

/// Nodes on which lines act: those of the grid, and of bodies that meet.
pub struct LineWindow<'a, 'w, 'f, const D: usize> {
    pub window: &'a mut Window<'w, D>,
    pub fields: &'a mut Option<FieldWindow<'f, D>>,
    pub kinds: FieldMap<'a>,
    pub friction: &'a MaterialFriction,
    pub reactions: &'a mut Reactions<D>,
}

impl<const D: usize> LineWindow<'_, '_, '_, D> {
    /// Lets an obstacle act on a line, on each body that it crosses, or looks for what it is about to meet. Returns the work
    /// that it does [J].
    pub fn act(&mut self, line: &Line<D>, solids: &Solids<'_, D>, probes: bool) -> f64 {
        self.act_on_nodes(line, line.nodes(), solids, probes)
    }

    /// The same at an edge.
    pub fn act_at_edge(&mut self, edge: &EdgeLine<D>, solids: &Solids<'_, D>, probes: bool) -> f64 {
        if D == 2 {
            let nodes = edge.nodes::<{ EDGE_NODES / 2 }>();
            self.act_on_nodes(&edge.line, nodes, solids, probes)
        } else {
            let nodes = edge.nodes::<EDGE_NODES>();
            self.act_on_nodes(&edge.line, nodes, solids, probes)
        }
    }

    /// The first three nodes, given with their weights, are those of the line.
    #[inline(always)]
    fn act_on_nodes<const N: usize>(
        &mut self,
        line: &Line<D>,
        nodes: ([usize; N], [f32; N]),
        solids: &Solids<'_, D>,
        probes: bool,
    ) -> f64 {
        let chunks = nodes.0.map(|node| node / CHUNK);
        let one = self.fields.as_ref().map(FieldWindow::map);
        let Some(map) = one.filter(|map| !map.is_one(chunks)) else {
            return self.act_on_grid(line, nodes, solids, probes);
        };
        let mut work = 0.0;
        for (k, chunk) in chunks.into_iter().enumerate() {
            for field in map.fields_of(chunk) {
                let met = |chunk: &usize| map.fields_of(*chunk).any(|other| other == field);
                if !chunks[..k].iter().any(met) {
                    let places = nodes.0.map(|node| map.place(node, field));
                    let elastic = map.is_elastic(field);
                    work += self.act_on(line, nodes, solids, (places, elastic), probes);
                }
            }
        }
        work
    }

    #[inline(always)]
    fn act_on_grid<const N: usize>(
        &mut self,
        line: &Line<D>,
        nodes: ([usize; N], [f32; N]),
        solids: &Solids<'_, D>,
        probes: bool,
    ) -> f64 {
        if self.window.nodes[line.middle - self.window.first].as_array()[3] <= SMALLEST_MASS {
            return 0.0;
        }
        let elastic = self.kinds.only_elastic(line.middle / CHUNK);
        let places = ([NodePlace::Grid; N], elastic);
        self.act_on(line, nodes, solids, places, probes)
    }

    #[inline(always)]
    fn act_on<const N: usize>(
        &mut self,
        line: &Line<D>,
        (numbers, weights): ([usize; N], [f32; N]),
        solids: &Solids<'_, D>,
        (mut places, elastic): ([NodePlace; N], bool),
        probes: bool,
    ) -> f64 {
        let Self {
            window,
            fields,
            friction,
            reactions,
            ..
        } = self;
        for k in 3..N {
            if weights[k] == 0.0 {
                places[k] = NodePlace::Nowhere;
            }
        }
        let numbers = numbers.map(|node| node.wrapping_sub(window.first));
        let mut nodes: [[f32; 4]; N] = std::array::from_fn(|k| match (places[k], &*fields) {
            (NodePlace::Grid, _) => window.nodes[numbers[k]].to_array(),
            (NodePlace::Slot(node), Some(fields)) => fields.nodes[node - fields.first].to_array(),
            _ => [0.0; 4],
        });
        let friction = |mass: f32| match (places[1], &*fields) {
            (NodePlace::Slot(node), Some(fields)) => {
                friction.at(fields.friction_mass, node - fields.first, mass)
            }
            _ => friction.at(window.friction_mass, numbers[1], mass),
        };
        if probes {
            let probe = line.probe((&nodes, &weights), elastic, solids, friction);
            reactions.probes.extend(probe);
            return 0.0;
        }
        let Some((impulse, work)) = line.act((&mut nodes, &weights), elastic, solids, friction)
        else {
            return 0.0;
        };
        reactions.push(line.obstacle as usize, &line.x, &impulse);
        for k in 0..N {
            match (places[k], &mut *fields) {
                (NodePlace::Grid, _) => window.nodes[numbers[k]] = nodes[k].into(),
                (NodePlace::Slot(node), Some(fields)) => {
                    fields.nodes[node - fields.first] = nodes[k].into();
                }
                _ => {}
            }
        }
        work
    }
}
