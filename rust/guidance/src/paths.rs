//! Ways in time: cubic pieces between knots.

use crate::error::GuidanceError;

/// Ways of groups of particles: cubic pieces between knots.
#[derive(Debug, Clone, Default)]
pub struct Paths<const D: usize> {
    /// Path p has the knots `starts[p]..starts[p + 1]`, two or more.
    pub starts: Vec<u32>,
    /// When a knot is passed, from 0 on [s].
    pub times: Vec<f32>,
    /// Where the knots are [m].
    pub x: Vec<[f32; D]>,
    /// Velocities in the knots [m/s].
    pub v: Vec<[f32; D]>,
}

/// Refuses ranges of knots, and numbers of their times, places and velocities, that do not fit together.
pub(crate) fn check_knots(
    starts: &[u32],
    [knots, places, velocities]: [usize; 3],
) -> Result<(), GuidanceError> {
    let starts_fit = starts.first() == Some(&0)
        && starts.last() == Some(&(knots as u32))
        && starts.windows(2).all(|pair| pair[0] + 2 <= pair[1]);
    if !starts_fit {
        return Err(GuidanceError::new(
            "starts",
            "0, ..., the number of knots, 2 or more apart",
            &format!("{starts:?}"),
        ));
    }
    if [places, velocities] != [knots; 2] {
        return Err(GuidanceError::new(
            "knots",
            format!("{knots} places and velocities"),
            &format!("{places} and {velocities}"),
        ));
    }
    Ok(())
}

impl<const D: usize> Paths<D> {
    /// Refuses paths that do not fit together.
    pub(crate) fn check(&self) -> Result<(), GuidanceError> {
        check_knots(&self.starts, [self.times.len(), self.x.len(), self.v.len()])?;
        let ordered = |range: &[u32]| {
            self.times[range[0] as usize..range[1] as usize]
                .windows(2)
                .all(|pair| pair[0] < pair[1])
        };
        if !self.starts.windows(2).all(ordered) {
            return Err(GuidanceError::new(
                "times",
                "increasing along each path",
                &"others",
            ));
        }
        Ok(())
    }

    /// Place and velocity at a time within the knots of a path.
    pub(crate) fn at(&self, knots: std::ops::Range<usize>, time: f32) -> ([f32; D], [f32; D]) {
        let after = self.times[knots.clone()].partition_point(|&knot| knot <= time);
        let right = (knots.start + after).clamp(knots.start + 1, knots.end - 1);
        let left = right - 1;
        let h = self.times[right] - self.times[left];
        let s = (time - self.times[left]) / h;
        let mut place = ([0.0; D], [0.0; D]);
        for axis in 0..D {
            let (x0, x1) = (self.x[left][axis], self.x[right][axis]);
            let (m0, m1) = (h * self.v[left][axis], h * self.v[right][axis]);
            let (square, cube) = (3.0 * (x1 - x0) - 2.0 * m0 - m1, 2.0 * (x0 - x1) + m0 + m1);
            place.0[axis] = x0 + s * (m0 + s * (square + s * cube));
            place.1[axis] = (m0 + s * (2.0 * square + s * 3.0 * cube)) / h;
        }
        place
    }
}
