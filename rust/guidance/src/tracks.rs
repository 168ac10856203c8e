//! The force of a frame: how particles get from where they are to where their ways lead.

use crate::detour::{Detour, WayOn};
use crate::error::GuidanceError;
use crate::filter::{Filter, Place, cells_along};
use crate::free_space::FreeSpace;
use crate::paths::Paths;

/// Shortest time in which a way around obstacles is gone, over `Law::shortest`.
const UNHURRIED: f32 = 1.0;
/// Most cells of the grid on which the force is smoothed.
const MOST_CELLS: usize = 1 << 24;

/// Settings of the force.
#[derive(Debug, Clone, Copy)]
pub struct Law<const D: usize> {
    /// Gravity, which the force compensates [m/s^2].
    pub gravity: [f32; D],
    /// Shortest remaining time [s]; a shorter one would need forces that change within a frame.
    pub shortest: f32,
    /// How far ahead of the present the force aims on a way of several pieces [s].
    pub ahead: f32,
    /// Cells per metre of the grid on which the force is smoothed; 0 leaves it as it is.
    pub cells: u32,
    /// Size of the world [m].
    pub size: [f32; D],
    /// Largest acceleration of a particle [m/s^2].
    pub cap: f32,
}

/// Particles on their ways.
#[derive(Debug)]
pub struct Tracks<const D: usize> {
    paths: Paths<D>,
    path: Vec<u32>,
    offset: Vec<[f32; D]>,
    law: Law<D>,
    detour: Option<Detour<D>>,
}

/// Target of a path: position and velocity after `tau` seconds.
struct Aim<const D: usize> {
    x: [f32; D],
    v: [f32; D],
    tau: f32,
}

/// The law of a path, written as a = constant + stiffness (offset - x) - damping u.
struct Pull<const D: usize> {
    constant: [f32; D],
    stiffness: f32,
    damping: f32,
    /// End of the path, without the offsets of its particles [m].
    aim: [f32; D],
    /// Time until the end [s].
    left: f32,
}

impl<const D: usize> Tracks<D> {
    /// Particle i belongs to `path[i]`, at a distance of `offset[i]` [m]. With `space`, particles that something
    /// solid keeps from what they aim at go around it, to the ends of the paths.
    pub fn new(
        paths: Paths<D>,
        path: Vec<u32>,
        offset: Vec<[f32; D]>,
        law: Law<D>,
        space: Option<&FreeSpace<D>>,
    ) -> Result<Self, GuidanceError> {
        paths.check()?;
        if path.len() != offset.len() {
            return Err(GuidanceError::new(
                "offset",
                format!("of {} particles", path.len()),
                &offset.len(),
            ));
        }
        let count = paths.starts.len() - 1;
        if let Some(&far) = path.iter().find(|&&path| path as usize >= count) {
            return Err(GuidanceError::new("path", format!("below {count}"), &far));
        }
        if !(law.shortest > 0.0
            && law.ahead > 0.0
            && law.cap > 0.0
            && cells_along(law.cells, &law.size).iter().product::<usize>() <= MOST_CELLS)
        {
            return Err(GuidanceError::new(
                "law",
                "of times and a cap above 0 and at most 2^24 cells",
                &format!("{law:?}"),
            ));
        }
        let detour = space.map(|space| {
            let ends: Vec<[f64; D]> = paths.starts[1..]
                .iter()
                .map(|&start| paths.x[start as usize - 1].map(f64::from))
                .collect();
            Detour::new(space, &ends)
        });
        Ok(Self {
            paths,
            path,
            offset,
            law,
            detour,
        })
    }

    /// Accelerations besides gravity [m/s^2] of particles at `x` [m] with velocities `v` [m/s].
    ///
    /// `time` has passed since the start [s]. `rows` names the particle of each row, which is one of those that have a way; None
    /// stands for all of them in order.
    ///
    /// A particle at x with velocity u that is to be at y with velocity w after tau seconds gets, with the least
    /// integral of |a|^2, a = 6 (y - x) / tau^2 - (4 u + 2 w) / tau at present.
    pub fn force(
        &self,
        x: &[[f32; D]],
        v: &[[f32; D]],
        mass: &[f32],
        time: f32,
        rows: Option<&[u32]>,
    ) -> Vec<[f32; D]> {
        let pulls: Vec<Pull<D>> = (0..self.paths.starts.len() - 1)
            .map(|path| self.pull(path, time))
            .collect();
        let one = |row: usize, x: &[f32; D], v: &[f32; D]| self.wanted(&pulls, row, x, v);
        let states = x.iter().zip(v);
        let mut force: Vec<[f32; D]> = match rows {
            None => states
                .enumerate()
                .map(|(row, (x, v))| one(row, x, v))
                .collect(),
            Some(rows) => states
                .zip(rows)
                .map(|((x, v), &row)| one(row as usize, x, v))
                .collect(),
        };
        if self.law.cells > 0 {
            self.smooth(x, mass, &mut force);
        }
        let largest = self.law.cap * self.law.cap;
        for force in &mut force {
            let square: f32 = force.iter().map(|number| number * number).sum();
            if square > largest {
                let scale = self.law.cap / square.sqrt();
                for number in force {
                    *number *= scale;
                }
            }
        }
        force
    }

    /// The acceleration of one particle before smoothing and cap.
    #[inline]
    fn wanted(&self, pulls: &[Pull<D>], row: usize, x: &[f32; D], v: &[f32; D]) -> [f32; D] {
        let (pull, offset) = (&pulls[self.path[row] as usize], &self.offset[row]);
        if let Some(detour) = &self.detour {
            let aim = std::array::from_fn(|axis| pull.aim[axis] + offset[axis]);
            if let Some(way) = detour.around(x, &aim) {
                return self.led_on(&way, v, pull.left);
            }
        }
        std::array::from_fn(|axis| {
            pull.constant[axis] + pull.stiffness * (offset[axis] - x[axis]) - pull.damping * v[axis]
        })
    }

    fn smooth(&self, x: &[[f32; D]], mass: &[f32], force: &mut [[f32; D]]) {
        let mut filter = Filter::new(self.law.cells, &self.law.size);
        let places: Vec<Place<D>> = x.iter().map(|x| filter.place(x)).collect();
        for ((place, &mass), force) in places.iter().zip(mass).zip(&*force) {
            filter.add(place, mass, force);
        }
        filter.finish();
        for (place, force) in places.iter().zip(force) {
            *force = filter.at(place);
        }
    }

    fn pull(&self, path: usize, time: f32) -> Pull<D> {
        let aim = self.aim(path, time);
        let (stiffness, damping) = (6.0 / (aim.tau * aim.tau), 4.0 / aim.tau);
        Pull {
            constant: std::array::from_fn(|axis| {
                stiffness * aim.x[axis] - 2.0 / aim.tau * aim.v[axis] - self.law.gravity[axis]
            }),
            stiffness,
            damping,
            aim: aim.x,
            left: self.paths.times[self.paths.starts[path + 1] as usize - 1] - time,
        }
    }

    /// The force on a particle that something solid keeps from its aim: to the velocity of a way around it that
    /// is done in the time that is left, but not hastily.
    fn led_on(&self, way: &WayOn<D>, v: &[f32; D], left: f32) -> [f32; D] {
        let speed = way.length / left.max(UNHURRIED * self.law.shortest);
        std::array::from_fn(|axis| {
            (speed * way.direction[axis] - v[axis]) / self.law.shortest - self.law.gravity[axis]
        })
    }

    /// A straight way is aimed at its end, a way of several pieces at a point ahead of the present.
    fn aim(&self, path: usize, time: f32) -> Aim<D> {
        let knots = self.paths.starts[path] as usize..self.paths.starts[path + 1] as usize;
        let last = knots.end - 1;
        let left = self.paths.times[last] - time;
        let tau = if knots.len() == 2 {
            left
        } else {
            left.min(self.law.ahead.max(self.law.shortest))
        };
        if tau >= left || left <= self.law.shortest {
            return Aim {
                x: self.paths.x[last],
                v: self.paths.v[last],
                tau: left.max(self.law.shortest),
            };
        }
        let (x, v) = self.paths.at(knots, time + tau);
        Aim { x, v, tau }
    }
}

#[cfg(test)]
mod tests;
