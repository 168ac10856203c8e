//! The nodes on which solids act.

use super::lines::{Line, LineNodes};
use super::node::MaterialFriction;
use super::reactions::Reactions;
use super::solids::Solids;
use crate::grid::{CHUNK, FieldMap, FieldWindow, NodePlace, SMALLEST_MASS, Window};

/// Nodes of the grid, and of bodies that meet, with what they need for contact.
pub struct ContactNodes<'a, const D: usize> {
    pub window: Window<'a, D>,
    pub fields: Option<FieldWindow<'a, D>>,
    pub kinds: FieldMap<'a>,
    pub friction: &'a MaterialFriction,
    pub reactions: &'a mut Reactions<D>,
}

impl<const D: usize> ContactNodes<'_, D> {
    /// Lets a solid act on the nodes of a line, of each body that it crosses. Returns the work that it does [J]. The nodes are given
    /// by their memory indices and weights.
    pub fn act<const N: usize>(
        &mut self,
        line: &Line<D>,
        nodes: ([usize; N], [f32; N]),
        solids: &Solids<D>,
    ) -> f64 {
        let mut sum = 0.0;
        self.each_body(nodes, |nodes, reactions| {
            let Some((impulse, work)) = line.act(nodes, solids) else {
                return false;
            };
            reactions.push(line.obstacle as usize, &line.x, &impulse);
            sum += work;
            true
        });
        sum
    }

    /// Keeps what a rigid body is about to meet on a line.
    pub fn probe<const N: usize>(
        &mut self,
        line: &Line<D>,
        nodes: ([usize; N], [f32; N]),
        solids: &Solids<D>,
    ) {
        self.each_body(nodes, |nodes, reactions| {
            reactions.probes.extend(line.probe(nodes, solids));
            false
        });
    }

    /// Calls back with the nodes of a line, the second of which is its middle, of each body that has some of them. It is asked
    /// whether they have changed.
    #[inline(always)]
    fn each_body<const N: usize>(
        &mut self,
        (numbers, weights): ([usize; N], [f32; N]),
        mut change: impl FnMut(&mut LineNodes<N>, &mut Reactions<D>) -> bool,
    ) {
        let chunks = numbers.map(|node| node / CHUNK);
        let map = self.kinds;
        if self.fields.is_none() || map.is_one(chunks) {
            let body = ([NodePlace::Grid; N], map.only_elastic(chunks[1]));
            return self.of_body((numbers, weights), body, change);
        }
        for (k, chunk) in chunks.into_iter().enumerate() {
            for field in map.fields_of(chunk) {
                let met = |chunk: &usize| map.fields_of(*chunk).any(|other| other == field);
                if !chunks[..k].iter().any(met) {
                    let places = numbers.map(|node| map.place(node, field));
                    let body = (places, map.is_elastic(field));
                    self.of_body((numbers, weights), body, &mut change);
                }
            }
        }
    }

    /// The same of one body, with its places of the nodes.
    #[inline(always)]
    fn of_body<const N: usize>(
        &mut self,
        (numbers, weights): ([usize; N], [f32; N]),
        (places, is_elastic): ([NodePlace; N], bool),
        mut change: impl FnMut(&mut LineNodes<N>, &mut Reactions<D>) -> bool,
    ) {
        let (window, fields) = (&mut self.window, &mut self.fields);
        let place = |k: usize| numbers[k].wrapping_sub(window.first);
        let value = |k: usize| match (places[k], &*fields) {
            (NodePlace::Grid, _) => window.nodes[place(k)].to_array(),
            (NodePlace::Slot(node), Some(fields)) => fields.nodes[node - fields.first].to_array(),
            _ => [0.0; 4],
        };
        let mass = value(1)[3];
        // Most lines of a splash end here.
        if mass <= SMALLEST_MASS {
            return;
        }
        let friction = match (places[1], &*fields) {
            (NodePlace::Slot(node), Some(fields)) => {
                (self.friction).at(fields.friction_mass, node - fields.first, mass)
            }
            _ => (self.friction).at(window.friction_mass, place(1), mass),
        };
        let mut nodes = LineNodes {
            values: std::array::from_fn(value),
            weights,
            is_elastic,
            friction,
        };
        if !change(&mut nodes, self.reactions) {
            return;
        }
        for k in (0..N).filter(|k| weights[*k] != 0.0) {
            match (places[k], &mut *fields) {
                (NodePlace::Grid, _) => window.nodes[place(k)] = nodes.values[k].into(),
                (NodePlace::Slot(node), Some(fields)) => {
                    fields.nodes[node - fields.first] = nodes.values[k].into();
                }
                _ => {}
            }
        }
    }
}
