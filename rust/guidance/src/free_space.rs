//! The room between walls and obstacles, on a coarse grid: shortest ways and lines of sight.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use threads::interrupted;

use crate::error::GuidanceError;

/// Where obstacles are, by their signed distance in the nodes of a grid.
#[derive(Debug, Clone)]
pub struct FreeSpace<const D: usize> {
    lower: [f64; D],
    spacing: f64,
    counts: [usize; D],
    distance: Vec<f64>,
    /// Steps to the neighbours of a node, on each axis -1, 0 or 1, with their lengths [m].
    steps: Vec<([isize; D], f64)>,
}

/// Lines closer to an obstacle than this many spacings are blocked.
const CLEARANCE: f64 = 0.5;
/// Ways closer to an obstacle than this many spacings are counted longer, so that others go first.
const COMFORT: f64 = 2.0;
/// Nodes that are visited between two looks at whether the work is interrupted.
const LOOK_EVERY: usize = 1024;
/// How far a point in an obstacle, or close to one, may be from the free node that stands for it [spacings].
const REACH: isize = 4;

impl<const D: usize> FreeSpace<D> {
    /// Nodes from `lower` on, `counts[axis]` along each axis and `spacing` apart [m]; `distance` to the nearest
    /// obstacle in each [m], the last axis changing fastest.
    pub fn new(
        lower: [f64; D],
        spacing: f64,
        counts: [usize; D],
        distance: Vec<f64>,
    ) -> Result<Self, GuidanceError> {
        if distance.len() != counts.iter().product::<usize>() || counts.contains(&0) {
            return Err(GuidanceError::new(
                "distance",
                format!("of shape {counts:?}"),
                &distance.len(),
            ));
        }
        let steps = (0..3_usize.pow(D as u32))
            .map(|flat| {
                std::array::from_fn(|axis| (flat / 3_usize.pow(axis as u32) % 3) as isize - 1)
            })
            .filter(|step: &[isize; D]| step.iter().any(|&along| along != 0))
            .map(|step| {
                (
                    step,
                    spacing
                        * step
                            .iter()
                            .map(|&along| (along * along) as f64)
                            .sum::<f64>()
                            .sqrt(),
                )
            })
            .collect();
        Ok(Self {
            lower,
            spacing,
            counts,
            distance,
            steps,
        })
    }

    /// Length of the shortest way from each node to the nearest of `goals` [m]; infinite where there is none, or where
    /// the work was `interrupted` first.
    pub fn lengths_to(&self, goals: &[[f64; D]]) -> Vec<f64> {
        let mut lengths = vec![f64::INFINITY; self.distance.len()];
        let mut queue = BinaryHeap::new();
        for goal in goals {
            if let Some(node) = self.free_node(goal) {
                lengths[node] = 0.0;
                queue.push(Reverse((0, node)));
            }
        }
        let mut visited = 0_usize;
        while let Some(Reverse((key, node))) = queue.pop() {
            visited += 1;
            if visited.is_multiple_of(LOOK_EVERY) && interrupted() {
                break;
            }
            // Positive floats are ordered as their bits are.
            if f64::from_bits(key) > lengths[node] {
                continue;
            }
            self.for_each_neighbour(node, |next, step| {
                let length = lengths[node] + step * self.burden(next);
                if length < lengths[next] {
                    lengths[next] = length;
                    queue.push(Reverse((length.to_bits(), next)));
                }
            });
        }
        lengths
    }

    /// Value of a field of `lengths_to` at a point.
    pub fn length_at(&self, lengths: &[f64], x: &[f64; D]) -> f64 {
        self.free_node(x)
            .map_or(f64::INFINITY, |node| lengths[node])
    }

    /// Corners of a short way from one point to another, both among them; None where there is none.
    ///
    /// `lengths` is the field of goals near to the end.
    pub fn way(&self, from: &[f64; D], to: &[f64; D], lengths: &[f64]) -> Option<Vec<[f64; D]>> {
        let mut node = self
            .free_node(from)
            .filter(|&node| lengths[node].is_finite())?;
        let mut chain = vec![*from, self.point(node)];
        while lengths[node] > 0.0 {
            let Some(next) = self.downhill(node, lengths) else {
                break;
            };
            node = next;
            chain.push(self.point(node));
        }
        chain.push(*to);
        Some(self.pulled_taut(&chain))
    }

    /// The neighbour of a free node through which the shortest way leads; None at its end.
    pub(crate) fn downhill(&self, node: usize, lengths: &[f64]) -> Option<usize> {
        let mut best = (f64::INFINITY, None);
        self.for_each_neighbour(node, |next, step| {
            let length = lengths[next] + step * self.burden(node);
            if lengths[next] < lengths[node] && length < best.0 {
                best = (length, Some(next));
            }
        });
        best.1
    }

    /// Whether the straight line between two points keeps clear of obstacles, but for its ends.
    pub fn sees(&self, from: &[f64; D], to: &[f64; D]) -> bool {
        let length = crate::partition::square_distance(from, to).sqrt();
        let count = (length / (0.5 * self.spacing)).ceil() as usize;
        (0..=count).all(|index| {
            let s = index as f64 / count.max(1) as f64;
            let x = std::array::from_fn(|axis| from[axis] + s * (to[axis] - from[axis]));
            // Matter may touch an obstacle where it starts and where it ends.
            let end = length * s.min(1.0 - s) / self.spacing;
            self.distance_at(&x) > self.spacing * CLEARANCE.min(0.25 * end)
        })
    }

    /// Signed distance of the obstacles at a point, linear between nodes.
    pub(crate) fn distance_at(&self, x: &[f64; D]) -> f64 {
        let mut base = [0; D];
        let mut place = [0.0; D];
        for axis in 0..D {
            let last = self.counts[axis].saturating_sub(2);
            let at = ((x[axis] - self.lower[axis]) / self.spacing).max(0.0);
            base[axis] = (at as usize).min(last);
            place[axis] = (at - base[axis] as f64).min(1.0);
        }
        (0..1_usize << D)
            .map(|corner| {
                let mut weight = 1.0;
                let mut node = base;
                for axis in 0..D {
                    let high = corner >> axis & 1 == 1 && self.counts[axis] > 1;
                    weight *= if corner >> axis & 1 == 1 {
                        place[axis]
                    } else {
                        1.0 - place[axis]
                    };
                    node[axis] += usize::from(high);
                }
                weight * self.distance[self.flat(&node)]
            })
            .sum()
    }

    /// Leaves out the corners that the line between others passes by.
    fn pulled_taut(&self, chain: &[[f64; D]]) -> Vec<[f64; D]> {
        let mut taut = vec![chain[0]];
        let mut here = 0;
        while here + 1 < chain.len() {
            let next = (here + 2..chain.len())
                .rev()
                .find(|&next| self.sees(&chain[here], &chain[next]))
                .unwrap_or(here + 1);
            taut.push(chain[next]);
            here = next;
        }
        taut
    }

    /// The free node nearest to a point.
    pub(crate) fn free_node(&self, x: &[f64; D]) -> Option<usize> {
        let center = self.center(x);
        let mut best = (f64::INFINITY, None);
        for reach in [0, 1, REACH] {
            let side = (2 * reach + 1) as usize;
            for flat in 0..side.pow(D as u32) {
                let node: [isize; D] = std::array::from_fn(|axis| {
                    center[axis] + (flat / side.pow(axis as u32) % side) as isize - reach
                });
                let Some(node) = self.inside(&node).filter(|&node| self.is_free(node)) else {
                    continue;
                };
                let distance = crate::partition::square_distance(&self.point(node), x);
                if distance < best.0 {
                    best = (distance, Some(node));
                }
            }
            if best.1.is_some() {
                break;
            }
        }
        best.1
    }

    /// Place of the node nearest to a point.
    fn center(&self, x: &[f64; D]) -> [isize; D] {
        std::array::from_fn(|axis| {
            let at = ((x[axis] - self.lower[axis]) / self.spacing).round() as isize;
            at.clamp(0, self.counts[axis] as isize - 1)
        })
    }

    fn is_free(&self, node: usize) -> bool {
        self.distance[node] > CLEARANCE * self.spacing
    }

    /// Factor by which a way through a node counts longer.
    fn burden(&self, node: usize) -> f64 {
        let room = self.distance[node] / (COMFORT * self.spacing);
        if room < 1.0 { 2.0 - room.max(0.0) } else { 1.0 }
    }

    fn for_each_neighbour(&self, node: usize, mut visit: impl FnMut(usize, f64)) {
        let place = self.place(node);
        for (step, length) in &self.steps {
            let next = std::array::from_fn(|axis| place[axis] as isize + step[axis]);
            if let Some(next) = self.inside(&next).filter(|&next| self.is_free(next)) {
                visit(next, *length);
            }
        }
    }

    fn inside(&self, place: &[isize; D]) -> Option<usize> {
        let fits = (0..D).all(|axis| (0..self.counts[axis] as isize).contains(&place[axis]));
        fits.then(|| self.flat(&place.map(|along| along as usize)))
    }

    fn flat(&self, place: &[usize; D]) -> usize {
        place
            .iter()
            .zip(&self.counts)
            .fold(0, |flat, (along, count)| flat * count + along)
    }

    fn place(&self, mut node: usize) -> [usize; D] {
        let mut place = [0; D];
        for axis in (0..D).rev() {
            place[axis] = node % self.counts[axis];
            node /= self.counts[axis];
        }
        place
    }

    /// How far neighbours along each axis are apart among the nodes.
    pub(crate) fn strides(&self) -> [usize; D] {
        std::array::from_fn(|axis| self.counts[axis + 1..].iter().product())
    }

    pub(crate) fn counts(&self) -> [usize; D] {
        self.counts
    }

    pub(crate) fn lower(&self) -> [f64; D] {
        self.lower
    }

    pub(crate) fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Signed distance of the obstacles in each node [m].
    pub(crate) fn distances(&self) -> impl Iterator<Item = f64> + '_ {
        self.distance.iter().copied()
    }

    pub(crate) fn point(&self, node: usize) -> [f64; D] {
        let place = self.place(node);
        std::array::from_fn(|axis| self.lower[axis] + self.spacing * place[axis] as f64)
    }
}

#[cfg(test)]
pub(crate) mod tests;
