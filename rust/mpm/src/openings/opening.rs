//! Times at which an emitter adds layers of particles.

use super::emitter::{Emitter, EmitterStatus};
use super::population::Flow;
use crate::linalg::Vector;

/// Part of other material in an opening [-] above which no layer is added.
const CROWDED: f32 = 0.25;

/// An emitter at the end of a frame.
pub(crate) struct Opening<'a, const D: usize> {
    pub emitter: &'a Emitter<D>,
    /// Frames done, this one among them.
    pub frame: u64,
    /// Length of a frame [s].
    pub frame_dt: f32,
    /// Number of particles that may be added.
    pub room: usize,
}

impl<const D: usize> Opening<'_, D> {
    /// Returns the particles of the layers that are due. `is_blocked` takes the distance that a layer has moved [m] and its
    /// sites, and returns whether they are occupied.
    pub fn let_out(
        &self,
        flow: &mut Flow,
        mut is_blocked: impl FnMut(f64, &[Vector<D>]) -> bool,
    ) -> Vec<Vector<D>> {
        let emitter = self.emitter;
        let frame_dt = f64::from(self.frame_dt);
        let (begin, end) = (
            (self.frame - 1) as f64 * frame_dt,
            self.frame as f64 * frame_dt,
        );
        let last = end.min(emitter.stop);
        let speed = f64::from(emitter.velocity.norm());
        flow.travelled += speed * (last - begin.max(emitter.start)).max(0.0);
        flow.status = if end <= emitter.start {
            EmitterStatus::Waiting
        } else if begin >= emitter.stop {
            EmitterStatus::Ended
        } else {
            EmitterStatus::Running
        };
        let (spacing, mut added) = (f64::from(emitter.spacing), Vec::new());
        while flow.status == EmitterStatus::Running && flow.travelled >= spacing {
            let offset = flow.travelled - spacing + speed * (end - last);
            let layer = emitter.layer(offset, emitter.jitter_of(flow.layers));
            let full = added.len() + layer.len() > self.room;
            if full || is_blocked(offset, &layer) {
                flow.status = if full {
                    EmitterStatus::Full
                } else {
                    EmitterStatus::Blocked
                };
                // A blocked layer is not made up for; the next one may be added at once.
                flow.travelled = spacing;
                break;
            }
            added.extend(layer);
            flow.layers += 1;
            flow.travelled -= spacing;
        }
        added
    }
}

/// Counts the material that is in the way of a layer.
pub(crate) struct Crowd<const D: usize> {
    /// Where the particles of the even layer would be: with jitter the layer before may come as near as half a spacing.
    even: Vec<Vector<D>>,
    lower: Vector<D>,
    upper: Vector<D>,
    /// Half a spacing [m].
    reach: f32,
    most: f32,
    found: f32,
}

impl<const D: usize> Crowd<D> {
    /// Of a layer of `count` particles that has moved on by `offset` [m].
    pub fn around(emitter: &Emitter<D>, offset: f64, count: usize) -> Self {
        let even = emitter.layer(offset, &vec![Vector::zeros(); count]);
        let reach = 0.5 * emitter.spacing;
        let lower = even.iter().fold(even[0], |low, x| low.inf(x));
        let upper = even.iter().fold(even[0], |high, x| high.sup(x));
        Self {
            lower: lower.add_scalar(-reach),
            upper: upper.add_scalar(reach),
            even,
            reach,
            most: CROWDED * count as f32,
            found: 0.0,
        }
    }

    /// Counts a particle; true once the place is too full.
    pub fn is_full_with(&mut self, x: &Vector<D>) -> bool {
        let boxed = (0..D).all(|axis| x[axis] > self.lower[axis] && x[axis] < self.upper[axis]);
        let close = |site: &Vector<D>| (x - site).norm_squared() < self.reach * self.reach;
        if boxed && self.even.iter().any(close) {
            self.found += 1.0;
        }
        self.found > self.most
    }
}
