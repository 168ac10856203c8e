//! Weights of a network's answer: undisturbed points fall freely, whatever the network predicts.

/// Weights of a network's answer, from the latest states of points and the edges between them.
#[derive(Debug, Clone, Copy)]
pub struct AnswerGate<const D: usize> {
    /// Radius of the graph, R [m].
    pub radius: f32,
    /// Unit of accelerations and of relative velocities [m per step^2 and m per step]; above 0.
    pub scale: [f32; D],
    /// Number of consecutive edges over which a disturbance spreads.
    pub hops: usize,
    /// Disturbance at which the weight is 63 %; above 0.
    pub quiet: f32,
    /// Disturbance of a point that counts as none, so that rounding does not pile up over hops.
    pub unnoticed: f32,
    /// Largest disturbance of a point, which keeps sums of sums finite.
    pub most: f32,
    /// Corners of the box [m].
    pub lower: [f32; D],
    pub upper: [f32; D],
}

impl<const D: usize> AnswerGate<D> {
    /// Returns the weight of the answer at each point, in [0, 1].
    ///
    /// `states` are two or more, one step apart, oldest first; `known_acceleration` is the acceleration [m per step^2] that
    /// disturbs nothing. Edges are ordered by receiver: those into point i come from
    /// `senders[starts[i]..starts[i + 1]]`.
    pub fn weights(
        &self,
        states: &[&[[f32; D]]],
        known_acceleration: &[[f32; D]],
        starts: &[u32],
        senders: &[u32],
    ) -> Vec<f32> {
        let (now, before) = (states[states.len() - 1], states[states.len() - 2]);
        let velocity: Vec<[f32; D]> = (0..now.len())
            .map(|point| difference(&now[point], &before[point]))
            .collect();
        let into = |point: usize| {
            let edges = starts[point] as usize..starts[point + 1] as usize;
            senders[edges].iter().map(|&sender| sender as usize)
        };
        let mut signal: Vec<f32> = (0..now.len())
            .map(|point| {
                let mut own = 0.0;
                for three in states.windows(3) {
                    let [a, b, c] = [three[0], three[1], three[2]].map(|state| &state[point]);
                    let change = difference(&difference(c, b), &difference(b, a));
                    own += self.square(&difference(&change, &known_acceleration[point]));
                }
                let ahead = std::array::from_fn(|axis| {
                    now[point][axis] + velocity[point][axis] + known_acceleration[point][axis]
                });
                own += self.near_walls(&now[point]) + self.near_walls(&ahead);
                for sender in into(point) {
                    own += self.square(&difference(&velocity[sender], &velocity[point]));
                }
                (own - self.unnoticed).max(0.0)
            })
            .collect();
        for _ in 0..self.hops {
            signal = (0..now.len())
                .map(|point| {
                    let felt: f32 = into(point).map(|sender| signal[sender]).sum();
                    (signal[point] + felt).min(self.most)
                })
                .collect();
        }
        for value in &mut signal {
            *value = -(-*value / self.quiet).exp_m1();
        }
        signal
    }

    fn square(&self, vector: &[f32; D]) -> f32 {
        (0..D)
            .map(|axis| (vector[axis] / self.scale[axis]).powi(2))
            .sum()
    }

    /// Sum over the walls of how far within the radius they are, in radii.
    fn near_walls(&self, x: &[f32; D]) -> f32 {
        (0..D)
            .flat_map(|axis| [x[axis] - self.lower[axis], self.upper[axis] - x[axis]])
            .map(|distance| (1.0 - distance / self.radius).max(0.0))
            .sum()
    }
}

fn difference<const D: usize>(a: &[f32; D], b: &[f32; D]) -> [f32; D] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: AnswerGate<2> = AnswerGate {
        radius: 0.1,
        scale: [1e-3; 2],
        hops: 1,
        quiet: 0.01,
        unnoticed: 1e-4,
        most: 100.0,
        lower: [0.0; 2],
        upper: [1.0; 2],
    };
    const FALL: [f32; 2] = [0.0, -1e-3];
    /// Points in a row, each joined to the next.
    const STARTS: [u32; 4] = [0, 1, 3, 4];
    const SENDERS: [u32; 4] = [1, 0, 2, 1];

    /// Three states of three points in free fall.
    fn fall() -> [[[f32; 2]; 3]; 3] {
        let drop = [0.0, 1e-3, 3e-3];
        drop.map(|drop| [0.45, 0.5, 0.55].map(|x| [x, 0.5 - drop]))
    }

    fn weights(states: &[[[f32; 2]; 3]; 3]) -> Vec<f32> {
        let states: Vec<&[[f32; 2]]> = states.iter().map(<[_; 3]>::as_slice).collect();
        SETTINGS.weights(&states, &[FALL; 3], &STARTS, &SENDERS)
    }

    #[test]
    fn nothing_happens_in_free_fall() {
        assert_eq!(weights(&fall()), [0.0; 3]);
    }

    #[test]
    fn a_push_is_felt_as_far_as_the_hops_reach() {
        let mut states = fall();
        states[2][0][0] -= 1e-3;
        // The first point departs and moves against the second; the third is joined to that alone.
        let found = weights(&states);
        assert!(
            found[0] > 0.99 && found[1] > 0.99 && found[2] > 0.99,
            "{found:?}"
        );
        let none = AnswerGate {
            hops: 0,
            ..SETTINGS
        };
        let states: Vec<&[[f32; 2]]> = states.iter().map(<[_; 3]>::as_slice).collect();
        let found = none.weights(&states, &[FALL; 3], &STARTS, &SENDERS);
        assert!(found[1] > 0.99 && found[2] == 0.0, "{found:?}");
    }

    #[test]
    fn walls_are_seen_ahead() {
        let mut states = fall();
        for state in &mut states {
            state[2][0] += 0.351;
        }
        // 0.099 from the wall: 0.01 radii within, now and ahead.
        let alone = SETTINGS.weights(
            &states.iter().map(<[_; 3]>::as_slice).collect::<Vec<_>>(),
            &[FALL; 3],
            &[0, 0, 0, 0],
            &[],
        );
        let expected = 1.0 - (-(0.02_f32 - 1e-4) / 0.01).exp();
        assert!((alone[2] - expected).abs() < 1e-3, "{alone:?}");
        assert_eq!(alone[..2], [0.0; 2]);
    }
}
