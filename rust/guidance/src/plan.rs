//! Timed paths of groups of particles in double precision, as they are planned.

use crate::error::{GuidanceError, finite};
use crate::matching::Matching;
use crate::paths::check_knots;
use crate::spline::least_acceleration;

/// Paths of groups of particles with their times.
#[derive(Debug, Clone)]
pub struct Plan<const D: usize> {
    /// Path g has the corners `starts[g]..starts[g + 1]`, two or more.
    pub starts: Vec<u32>,
    /// When each corner is passed, from 0 on [s].
    pub times: Vec<f64>,
    /// Where the corners are [m].
    pub corners: Vec<[f64; D]>,
    /// Velocity in each corner [m/s].
    pub v: Vec<[f64; D]>,
    /// Path of each particle.
    pub group: Vec<u32>,
    /// Place of each particle at the end [m].
    pub places: Vec<[f64; D]>,
    /// Velocity of all at the end [m/s]; None for rest.
    pub end: Option<[f64; D]>,
}

impl<const D: usize> Plan<D> {
    /// Paths to matched places, each with the least acceleration in a time. With a velocity at the end they lead to
    /// where the places are then.
    ///
    /// `v` are velocities of the particles [m/s] and `weight` their masses over that of all.
    pub(crate) fn of(
        found: Matching<D>,
        v: &[[f64; D]],
        weight: &[f64],
        end: Option<[f64; D]>,
        seconds: f64,
    ) -> Result<Self, GuidanceError> {
        let count = found.ways.len();
        let (mut mass, mut momentum) = (vec![0.0; count], vec![[0.0; D]; count]);
        for ((&group, v), &weight) in found.group.iter().zip(v).zip(weight) {
            mass[group as usize] += weight;
            for axis in 0..D {
                momentum[group as usize][axis] += weight * v[axis];
            }
        }
        let last = end.unwrap_or([0.0; D]);
        let mut plan = Self {
            starts: vec![0],
            times: Vec::new(),
            corners: Vec::new(),
            v: Vec::new(),
            group: found.group,
            places: found.places,
            end,
        };
        for (group, mut way) in found.ways.into_iter().enumerate() {
            let first = momentum[group].map(|along| along / mass[group]);
            if end.is_some() {
                let tip = way.last_mut().expect("a way has two corners or more");
                *tip = std::array::from_fn(|axis| tip[axis] + seconds * last[axis]);
            }
            if way.len() == 2 {
                plan.times.extend([0.0, seconds]);
                plan.v.extend([first, last]);
            } else {
                let timing = least_acceleration(&way, first, last, seconds)?;
                plan.times.extend(timing.times);
                plan.v.extend(timing.velocities);
            }
            plan.corners.extend(way);
            plan.starts.push(plan.corners.len() as u32);
        }
        if end.is_some() {
            plan.shift(seconds);
        }
        Ok(plan)
    }

    /// Moves all places by the way of a time with the velocity at the end.
    fn shift(&mut self, seconds: f64) {
        let way = self.end.unwrap_or([0.0; D]).map(|along| seconds * along);
        for place in &mut self.places {
            *place = std::array::from_fn(|axis| place[axis] + way[axis]);
        }
    }

    /// The plan gone on for a time with the velocity at its end, where it has one.
    pub(crate) fn onward(mut self, seconds: f64) -> Self {
        let Some(end) = self.end else { return self };
        let mut longer = Self {
            starts: vec![0],
            times: Vec::new(),
            corners: Vec::new(),
            v: Vec::new(),
            group: std::mem::take(&mut self.group),
            places: std::mem::take(&mut self.places),
            end: self.end,
        };
        for range in self.starts.windows(2) {
            let (first, last) = (range[0] as usize, range[1] as usize);
            let tip = self.corners[last - 1];
            longer.times.extend(&self.times[first..last]);
            longer.times.push(self.times[last - 1] + seconds);
            longer.corners.extend(&self.corners[first..last]);
            longer
                .corners
                .push(std::array::from_fn(|axis| tip[axis] + seconds * end[axis]));
            longer.v.extend(&self.v[first..last]);
            longer.v.push(self.v[last - 1]);
            longer.starts.push(longer.corners.len() as u32);
        }
        longer.shift(seconds);
        longer
    }

    /// Distance of each particle's place from the end of its path [m].
    pub(crate) fn offsets(&self) -> Vec<[f64; D]> {
        let tip = |group: u32| self.corners[self.starts[group as usize + 1] as usize - 1];
        let places = self.places.iter().zip(&self.group);
        places
            .map(|(place, &group)| {
                let tip = tip(group);
                std::array::from_fn(|axis| place[axis] - tip[axis])
            })
            .collect()
    }

    /// Refuses arrays that do not fit together.
    pub(crate) fn check(&self) -> Result<(), GuidanceError> {
        let knots = [self.times.len(), self.corners.len(), self.v.len()];
        check_knots(&self.starts, knots)?;
        if self.places.len() != self.group.len() {
            return Err(GuidanceError::new(
                "places",
                format!("of {} particles", self.group.len()),
                &self.places.len(),
            ));
        }
        let count = self.starts.len() as u32 - 1;
        if let Some(&far) = self.group.iter().find(|&&group| group >= count) {
            return Err(GuidanceError::new("group", format!("below {count}"), &far));
        }
        finite("corners", self.corners.as_flattened())?;
        finite("places", self.places.as_flattened())
    }
}
