//! The force of a frame: how particles get from where they are to where their ways lead.

use crate::detour::{Detour, WayOn};
use crate::error::GuidanceError;
use crate::filter::{Filter, Place};
use crate::free_space::FreeSpace;
use crate::paths::Paths;

/// Shortest time in which a way around obstacles is gone, over `Law::shortest`.
const UNHURRIED: f32 = 1.0;

/// Settings of the force.
#[derive(Debug, Clone, Copy)]
pub struct Law<const D: usize> {
    /// What the force makes up for [m/s^2].
    pub gravity: [f32; D],
    /// Shortest time to go [s]; less asks for forces that a frame cannot follow.
    pub shortest: f32,
    /// How far ahead of the present the force aims on a way of several pieces [s].
    pub ahead: f32,
    /// Cells per metre of the grid on which the force is smoothed; 0 leaves it as it is.
    pub cells: u32,
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

/// Where a path wants its particles: place and velocity after `tau` seconds.
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
    /// What the path aims at, without the offsets of its particles [m].
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
        if !(law.shortest > 0.0 && law.ahead > 0.0 && law.cap > 0.0 && law.cells <= 256) {
            return Err(GuidanceError::new(
                "law",
                "of times and a cap above 0 and at most 256 cells",
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

    /// Number of particles that have a way.
    pub fn count(&self) -> usize {
        self.path.len()
    }

    /// Accelerations besides gravity [m/s^2] of particles at `x` [m] with velocities `v` [m/s].
    ///
    /// `time` has passed since the start [s]. `rows` names the particle of each row, which is below `count`; None
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
        let mut filter = Filter::new(self.law.cells);
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
mod tests {
    use super::*;

    const LAW: Law<2> = Law {
        gravity: [0.0, -9.81],
        shortest: 0.04,
        ahead: 0.06,
        cells: 0,
        cap: 1e6,
    };

    fn paths(times: &[f32], x: &[[f32; 2]], v: &[[f32; 2]]) -> Paths<2> {
        Paths {
            starts: vec![0, times.len() as u32],
            times: times.to_vec(),
            x: x.to_vec(),
            v: v.to_vec(),
        }
    }

    /// Moves a point by the force, which frames of 2.5 ms hold, and returns where it ends.
    fn run(
        tracks: &Tracks<2>,
        mut x: [f32; 2],
        mut v: [f32; 2],
        frames: usize,
    ) -> ([f32; 2], [f32; 2]) {
        for frame in 0..frames {
            let a = tracks.force(&[x], &[v], &[1.0], frame as f32 * 0.0025, None)[0];
            for axis in 0..2 {
                let a = a[axis] + LAW.gravity[axis];
                x[axis] += 0.0025 * v[axis] + 0.5 * 0.0025_f32.powi(2) * a;
                v[axis] += 0.0025 * a;
            }
        }
        (x, v)
    }

    #[test]
    fn a_free_point_arrives_in_time_and_rests() {
        let paths = paths(&[0.0, 0.25], &[[0.3, 0.3], [0.6, 0.5]], &[[0.0; 2]; 2]);
        let tracks = Tracks::new(paths, vec![0], vec![[0.01, 0.0]], LAW, None).unwrap();
        let (x, v) = run(&tracks, [0.31, 0.3], [1.0, -2.0], 100);
        assert!(
            (x[0] - 0.61).abs() < 0.01 && (x[1] - 0.5).abs() < 0.01,
            "{x:?}"
        );
        let (x, v2) = run(&tracks, [0.31, 0.3], [1.0, -2.0], 150);
        assert!(
            (x[0] - 0.61).abs() < 1e-3 && (x[1] - 0.5).abs() < 1e-3,
            "{x:?}"
        );
        assert!(v2[0].abs() + v2[1].abs() < v[0].abs() + v[1].abs() + 1e-6);
    }

    #[test]
    fn the_first_force_is_the_formula() {
        let paths = paths(&[0.0, 0.2], &[[0.3, 0.3], [0.6, 0.5]], &[[0.0; 2]; 2]);
        let tracks = Tracks::new(paths, vec![0], vec![[0.0; 2]], LAW, None).unwrap();
        let a = tracks.force(&[[0.3, 0.3]], &[[0.5, 1.0]], &[1.0], 0.0, None)[0];
        assert!(
            (a[0] - (6.0 * 0.3 / 0.04 - 4.0 * 0.5 / 0.2)).abs() < 1e-3,
            "{a:?}"
        );
        assert!(
            (a[1] - (6.0 * 0.2 / 0.04 - 4.0 / 0.2 + 9.81)).abs() < 1e-3,
            "{a:?}"
        );
    }

    #[test]
    fn a_way_of_two_pieces_is_followed() {
        let timing = crate::least_acceleration(
            &[[0.2, 0.2], [0.6, 0.2], [0.6, 0.6]],
            [0.0; 2],
            [0.0; 2],
            0.5,
        )
        .unwrap();
        let times: Vec<f32> = timing.times.iter().map(|&t| t as f32).collect();
        let v: Vec<[f32; 2]> = timing
            .velocities
            .iter()
            .map(|v| v.map(|v| v as f32))
            .collect();
        let paths = paths(&times, &[[0.2, 0.2], [0.6, 0.2], [0.6, 0.6]], &v);
        let tracks = Tracks::new(paths, vec![0], vec![[0.0; 2]], LAW, None).unwrap();
        let corner = (times[1] / 0.0025).round() as usize;
        let (x, _) = run(&tracks, [0.2, 0.2], [0.0; 2], corner);
        assert!(
            (x[0] - 0.6).abs() < 0.01 && (x[1] - 0.2).abs() < 0.01,
            "{x:?}"
        );
        let (x, _) = run(&tracks, [0.2, 0.2], [0.0; 2], 240);
        assert!(
            (x[0] - 0.6).abs() < 2e-3 && (x[1] - 0.6).abs() < 2e-3,
            "{x:?}"
        );
    }

    #[test]
    fn no_force_is_above_the_cap() {
        let paths = paths(&[0.0, 0.05], &[[0.1, 0.1], [0.9, 0.9]], &[[0.0; 2]; 2]);
        let tracks = Tracks::new(
            paths,
            vec![0],
            vec![[0.0; 2]],
            Law { cap: 50.0, ..LAW },
            None,
        )
        .unwrap();
        let a = tracks.force(&[[0.1, 0.1]], &[[0.0; 2]], &[1.0], 0.0, None)[0];
        assert!((a[0].hypot(a[1]) - 50.0).abs() < 1e-3);
    }

    #[test]
    fn paths_that_fit_nothing_are_refused() {
        let good = || paths(&[0.0, 0.1], &[[0.0; 2]; 2], &[[0.0; 2]; 2]);
        let named = |tracks: Result<Tracks<2>, GuidanceError>| tracks.unwrap_err().name;
        assert_eq!(
            named(Tracks::new(Paths::default(), vec![], vec![], LAW, None)),
            "starts"
        );
        assert_eq!(
            named(Tracks::new(good(), vec![1], vec![[0.0; 2]], LAW, None)),
            "path"
        );
        assert_eq!(
            named(Tracks::new(good(), vec![0], vec![], LAW, None)),
            "offset"
        );
        let backwards = paths(&[0.1, 0.0], &[[0.0; 2]; 2], &[[0.0; 2]; 2]);
        assert_eq!(
            named(Tracks::new(backwards, vec![0], vec![[0.0; 2]], LAW, None)),
            "times"
        );
        assert_eq!(
            named(Tracks::new(
                good(),
                vec![0],
                vec![[0.0; 2]],
                Law {
                    cap: f32::NAN,
                    ..LAW
                },
                None
            )),
            "law"
        );
    }
}
