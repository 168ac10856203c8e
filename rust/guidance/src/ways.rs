//! Particles on their ways to a goal: the law of a motion, with places that are matched anew at its end.

use threads::interrupted;

use crate::error::GuidanceError;
use crate::free_space::FreeSpace;
use crate::matching::{in_cells, match_to_region};
use crate::paths::Paths;
use crate::plan::Plan;
use crate::tracks::{Law, Tracks};

/// Shortest remaining time of a plan [frames]. With 8 the peaks of the force reach the cap, with 14 to 16 they do not.
pub const SHORTEST_FRAMES: u32 = 15;
/// Frames after which particles are given places in a shape anew.
pub const ANEW: u64 = 20;

/// What holds for a motion as a whole.
#[derive(Debug, Clone)]
pub struct Settings<const D: usize> {
    /// Gravity, which the force compensates [m/s^2].
    pub gravity: [f32; D],
    /// Length of a frame [s].
    pub frame_dt: f64,
    /// Cells along the longest side of the world of the grid on which the force is smoothed; 0 leaves it as it is.
    pub cells: u32,
    /// Largest acceleration of a particle [m/s^2].
    pub cap: f64,
    /// How far ahead of the present the force aims on a way of several pieces [frames].
    pub ahead: u32,
    /// Longest side of the world [m]; the force is computed in such lengths.
    pub unit: f64,
    /// Where obstacles are; None without.
    pub room: Option<Room<D>>,
}

impl<const D: usize> Settings<D> {
    /// The same for places that are matched anew: the force is not smoothed, and aims as near ahead as it can.
    pub(crate) fn anew(&self) -> Self {
        Self {
            cells: 0,
            ahead: SHORTEST_FRAMES,
            ..self.clone()
        }
    }
}

/// Signed distances of the nearest obstacle in the nodes of a grid, as `FreeSpace` takes them.
#[derive(Debug, Clone)]
pub struct Room<const D: usize> {
    pub lower: [f64; D],
    pub spacing: f64,
    pub counts: [usize; D],
    pub distance: Vec<f64>,
}

impl<const D: usize> Room<D> {
    pub(crate) fn space(&self, unit: f64) -> Result<FreeSpace<D>, GuidanceError> {
        let distance = self.distance.iter().map(|distance| distance / unit);
        FreeSpace::new(
            self.lower.map(|along| along / unit),
            self.spacing / unit,
            self.counts,
            distance.collect(),
        )
    }
}

/// Paths in single precision with their particles, in metres, and the force along them.
#[derive(Debug)]
pub(crate) struct Motion<const D: usize> {
    pub paths: Paths<D>,
    pub path: Vec<u32>,
    pub offset: Vec<[f32; D]>,
    tracks: Tracks<D>,
}

impl<const D: usize> Motion<D> {
    /// The motion of a plan; where it ends with a velocity it goes on, so that the force can aim ahead until then.
    fn of(plan: Plan<D>, settings: &Settings<D>) -> Result<Self, GuidanceError> {
        let plan = plan.onward(f64::from(settings.ahead) * settings.frame_dt);
        let single = |rows: &[[f64; D]]| rows.iter().map(|row| row.map(|one| one as f32)).collect();
        let offset = plan.offsets();
        let mut times: Vec<f32> = plan.times.iter().map(|&time| time as f32).collect();
        for range in plan.starts.windows(2) {
            for knot in range[0] as usize + 1..range[1] as usize {
                // Corners in one place have times that are equal in single precision.
                if times[knot] <= times[knot - 1] {
                    times[knot] = times[knot - 1].next_up();
                }
            }
        }
        let paths = Paths {
            starts: plan.starts,
            times,
            x: single(&plan.corners),
            v: single(&plan.v),
        };
        Self::new(paths, plan.group, single(&offset), settings)
    }

    pub fn new(
        paths: Paths<D>,
        path: Vec<u32>,
        offset: Vec<[f32; D]>,
        settings: &Settings<D>,
    ) -> Result<Self, GuidanceError> {
        let unit = settings.unit as f32;
        let in_units =
            |rows: &[[f32; D]]| rows.iter().map(|row| row.map(|one| one / unit)).collect();
        let scaled = Paths {
            starts: paths.starts.clone(),
            times: paths.times.clone(),
            x: in_units(&paths.x),
            v: in_units(&paths.v),
        };
        let law = Law {
            gravity: settings.gravity.map(|along| along / unit),
            shortest: (f64::from(SHORTEST_FRAMES) * settings.frame_dt) as f32,
            ahead: (f64::from(settings.ahead) * settings.frame_dt) as f32,
            cells: settings.cells,
            size: [1.0; D],
            cap: (settings.cap / settings.unit) as f32,
        };
        let room = settings.room.as_ref();
        let space = room.map(|room| room.space(settings.unit)).transpose()?;
        let tracks = Tracks::new(scaled, path.clone(), in_units(&offset), law, space.as_ref())?;
        Ok(Self {
            paths,
            path,
            offset,
            tracks,
        })
    }

    /// Ends of the particles' paths [m].
    fn places(&self) -> Vec<[f64; D]> {
        let end = |path: u32| self.paths.x[self.paths.starts[path as usize + 1] as usize - 1];
        let ends = self.path.iter().map(|&path| end(path)).zip(&self.offset);
        ends.map(|(end, offset)| std::array::from_fn(|axis| f64::from(end[axis] + offset[axis])))
            .collect()
    }
}

/// The end of a motion, in which particles are given places of a shape anew.
///
/// A fluid that is torn in order to fill a shape does not get everywhere as planned: parts that meet stay about a cell
/// apart, and between two arms some of it is left. So optimal transport from the present state gives each particle a
/// place of the same region anew, every `ANEW` frames from `start` on. To it the force leads in the shortest time of a
/// plan, not smoothed: that would lead what is left between two arms like the arms.
#[derive(Debug)]
pub struct Settling<const D: usize> {
    /// Centres of the cells of the region [m].
    pub cells: Vec<[f64; D]>,
    /// Side of a cell [m].
    pub side: f64,
    /// Frames after which places are matched anew for the first time.
    pub start: u64,
    /// Frames in which the region is to be reached.
    pub frames: u64,
    /// Velocity with which the filled region moves then, and from `start` on [m/s]; None for rest.
    pub velocity: Option<[f64; D]>,
    /// The last two times. They are kept so that a law that was read goes on to the same bits.
    pub(crate) found: Vec<Found<D>>,
}

/// Places that were matched anew, and the force to them.
#[derive(Debug)]
pub(crate) struct Found<const D: usize> {
    /// Which time this is, from 0 on.
    pub time: u64,
    /// Frames since the start at which places were matched.
    pub first: u64,
    pub motion: Motion<D>,
}

impl<const D: usize> Settling<D> {
    /// `cells` make up the region; none of the places is found yet.
    pub fn new(
        cells: Vec<[f64; D]>,
        side: f64,
        [start, frames]: [u64; 2],
        velocity: Option<[f64; D]>,
    ) -> Result<Self, GuidanceError> {
        if !(side > 0.0 && side.is_finite()) {
            return Err(GuidanceError::new("side", "above 0 and finite", &side));
        }
        Ok(Self {
            cells,
            side,
            start,
            frames,
            velocity,
            found: Vec::new(),
        })
    }
}

/// The force that keeps particles on timed ways, from their actual states.
#[derive(Debug)]
pub struct Ways<const D: usize> {
    pub(crate) ids: Vec<u64>,
    pub(crate) weight: Vec<f32>,
    pub(crate) settings: Settings<D>,
    pub(crate) moving: Motion<D>,
    pub(crate) settling: Option<Settling<D>>,
}

/// Particles that are there: their permanent numbers, ascending, positions [m] and velocities [m/s].
#[derive(Clone, Copy)]
pub struct Present<'a, const D: usize> {
    pub ids: &'a [u64],
    pub x: &'a [[f32; D]],
    pub v: &'a [[f32; D]],
}

/// Accelerations of those who are led [m/s^2], and their rows among the present; None where these are all in order.
pub type Forces<const D: usize> = (Option<Vec<usize>>, Vec<[f32; D]>);

impl<const D: usize> Ways<D> {
    /// Leads the particles `ids`, ascending, each with its mass over that of all, as planned.
    pub fn new(
        ids: Vec<u64>,
        weight: Vec<f32>,
        plan: Plan<D>,
        settings: Settings<D>,
        settling: Option<Settling<D>>,
    ) -> Result<Self, GuidanceError> {
        plan.check()?;
        let moving = Motion::of(plan, &settings)?;
        Self::checked(ids, weight, settings, moving, settling)
    }

    pub(crate) fn checked(
        ids: Vec<u64>,
        weight: Vec<f32>,
        settings: Settings<D>,
        moving: Motion<D>,
        settling: Option<Settling<D>>,
    ) -> Result<Self, GuidanceError> {
        let count = ids.len();
        let found = settling.iter().flat_map(|settling| &settling.found);
        let counts: Vec<usize> = [weight.len(), moving.path.len()]
            .into_iter()
            .chain(found.map(|one| one.motion.path.len()))
            .collect();
        if !ids.is_sorted() || counts.iter().any(|&other| other != count) {
            let got = format!("{counts:?}");
            return Err(GuidanceError::new(
                "particles",
                format!("{count} of ascending numbers"),
                &got,
            ));
        }
        Ok(Self {
            ids,
            weight,
            settings,
            moving,
            settling,
        })
    }

    /// Permanent numbers of the particles that are led, ascending.
    pub fn ids(&self) -> &[u64] {
        &self.ids
    }

    /// Whether they are given places of a shape anew at the end.
    pub fn settles(&self) -> bool {
        self.settling.is_some()
    }

    /// Ends of their paths [m].
    pub fn places(&self) -> Vec<[f64; D]> {
        self.moving.places()
    }

    /// Accelerations in the frame after `index` frames since the start.
    ///
    /// Places that are found anew are kept; those of the last two times are. Where they are not there, as after a
    /// jump in time, they are found from the present state.
    pub fn force(
        &mut self,
        index: u64,
        present: Present<'_, D>,
    ) -> Result<Forces<D>, GuidanceError> {
        let rows = self.rows(present.ids);
        let Some(mut settling) = self.settling.take() else {
            return Ok(self.along(&self.moving, index, present, rows));
        };
        let force = self.settled(&mut settling, index, present, rows);
        self.settling = Some(settling);
        force
    }

    fn settled(
        &self,
        settling: &mut Settling<D>,
        index: u64,
        present: Present<'_, D>,
        rows: Option<Vec<(usize, u32)>>,
    ) -> Result<Forces<D>, GuidanceError> {
        let Some(after) = index.checked_sub(settling.start) else {
            return Ok(self.along(&self.moving, index, present, rows));
        };
        let time = after / ANEW;
        let fits = |one: &Found<D>| one.time == time && one.first <= index;
        // In its first frame nothing known counts: the simulation may have returned to it on another way.
        let is_first = after.is_multiple_of(ANEW);
        let known = settling.found.iter().position(fits);
        let known = if let Some(known) = known.filter(|_| !is_first) {
            known
        } else {
            let motion = self.matched(settling, index, present, rows.as_deref())?;
            settling.found.retain(|one| one.time + 1 == time);
            settling.found.push(Found {
                time,
                first: index,
                motion,
            });
            settling.found.len() - 1
        };
        let Found { first, motion, .. } = &settling.found[known];
        Ok(self.along(motion, index - first, present, rows))
    }

    /// Rows of those who are led, first among the present, then among all that are led; None where both are equal.
    fn rows(&self, ids: &[u64]) -> Option<Vec<(usize, u32)>> {
        if ids == self.ids {
            return None;
        }
        let row = |id: &u64| Some(self.ids.binary_search(id).ok()? as u32);
        let rows = ids.iter().enumerate();
        Some(
            rows.filter_map(|(place, id)| Some((place, row(id)?)))
                .collect(),
        )
    }

    fn along(
        &self,
        motion: &Motion<D>,
        index: u64,
        present: Present<'_, D>,
        rows: Option<Vec<(usize, u32)>>,
    ) -> Forces<D> {
        let unit = self.settings.unit as f32;
        let time = (index as f64 * self.settings.frame_dt) as f32;
        let in_units = |row: &[f32; D]| row.map(|one| one / unit);
        let (known, force) = match rows {
            None => {
                let x: Vec<_> = present.x.iter().map(in_units).collect();
                let v: Vec<_> = present.v.iter().map(in_units).collect();
                (None, motion.tracks.force(&x, &v, &self.weight, time, None))
            }
            Some(rows) => {
                let (known, led): (Vec<usize>, Vec<u32>) = rows.into_iter().unzip();
                let x: Vec<_> = known.iter().map(|&row| in_units(&present.x[row])).collect();
                let v: Vec<_> = known.iter().map(|&row| in_units(&present.v[row])).collect();
                let weight: Vec<_> = led.iter().map(|&row| self.weight[row as usize]).collect();
                let force = motion.tracks.force(&x, &v, &weight, time, Some(&led));
                (Some(known), force)
            }
        };
        let force = force.into_iter().map(|row| row.map(|one| unit * one));
        (known, force.collect())
    }

    /// The motion to places of the region that are matched from the present state.
    fn matched(
        &self,
        settling: &Settling<D>,
        index: u64,
        present: Present<'_, D>,
        rows: Option<&[(usize, u32)]>,
    ) -> Result<Motion<D>, GuidanceError> {
        let double = |row: &[f32; D]| row.map(f64::from);
        // Those who are gone are taken to be at their places.
        let mut x = self.moving.places();
        let mut v = vec![[0.0; D]; x.len()];
        match rows {
            None => {
                x = present.x.iter().map(double).collect();
                v = present.v.iter().map(double).collect();
            }
            Some(rows) => {
                for &(place, row) in rows {
                    x[row as usize] = double(&present.x[place]);
                    v[row as usize] = double(&present.v[place]);
                }
            }
        }
        let settings = self.settings.anew();
        let soon = f64::from(SHORTEST_FRAMES + 1) * settings.frame_dt;
        let seconds = (settling.frames as f64 - index as f64) * settings.frame_dt;
        let back = |cell: &[f64; D], v: &[f64; D]| -> [f64; D] {
            std::array::from_fn(|axis| cell[axis] - seconds * v[axis])
        };
        let cells: Vec<[f64; D]> = match &settling.velocity {
            None => settling.cells.clone(),
            Some(v) => settling.cells.iter().map(|cell| back(cell, v)).collect(),
        };
        let room = settings.room.as_ref();
        let space = room.map(|room| room.space(1.0)).transpose()?;
        let mut found = match_to_region(&x, &cells, space.as_ref())?;
        if interrupted() {
            return Err(GuidanceError::new(
                "matching",
                "left to its end",
                &"an interruption",
            ));
        }
        in_cells(&mut found.places, &cells, settling.side);
        let weight: Vec<f64> = self.weight.iter().map(|&one| f64::from(one)).collect();
        let plan = Plan::of(found, &v, &weight, settling.velocity, soon)?;
        let plan = match settling.velocity {
            None => plan,
            Some(_) => plan.onward(seconds),
        };
        Motion::of(plan, &settings)
    }
}

#[cfg(test)]
mod tests;
