//! Plans for what a visitor of a page draws: the shape that an outline encloses, or an arrow to a point.

use std::convert::Infallible;

use crate::error::GuidanceError;
use crate::matching::{in_cells, match_to_region};
use crate::outlines::Outlines;
use crate::plan::Plan;
use crate::silhouette::{Filling, Silhouette};
use crate::ways::{Present, Settings, Settling, Ways};

/// Largest number of frames at the end in which particles are given places of a shape anew.
const SETTLING: u64 = 90;
/// Of so many frames, so many are for that at most.
const SHARE: [u64; 2] = [5, 2];
/// Share of the particles that may lie in walls or obstacles on the way of an arrow.
const MISFIT: f64 = 0.02;
/// Places of a way that are held against obstacles.
const LOOKS: usize = 32;

/// A fluid between walls, and the frames in which it is to be there.
pub struct Fluid<'a, const D: usize> {
    pub present: Present<'a, D>,
    /// Masses [kg].
    pub mass: &'a [f32],
    /// Volume of all particles at rest [m^D].
    pub volume: f64,
    /// Corners of the walls [m].
    pub walls: [[f64; D]; 2],
    pub frames: u64,
}

impl<const D: usize> Fluid<'_, D> {
    fn x(&self) -> Vec<[f64; D]> {
        let rows = self.present.x.iter();
        rows.map(|row| row.map(f64::from)).collect()
    }

    fn v(&self) -> Vec<[f64; D]> {
        let rows = self.present.v.iter();
        rows.map(|row| row.map(f64::from)).collect()
    }

    /// Mass of each particle over that of all.
    fn weight(&self) -> Vec<f64> {
        let all: f64 = self.mass.iter().map(|&mass| f64::from(mass)).sum();
        self.mass
            .iter()
            .map(|&mass| f64::from(mass) / all)
            .collect()
    }

    /// Leads all particles as planned.
    fn led(
        &self,
        plan: Plan<D>,
        settings: Settings<D>,
        settling: Option<Settling<D>>,
    ) -> Result<Ways<D>, GuidanceError> {
        let weight = self.weight().iter().map(|&one| one as f32).collect();
        Ways::new(self.present.ids.to_vec(), weight, plan, settings, settling)
    }

    /// Leads the fluid into the shape of an outline in the plane. `free` says which points no obstacle takes.
    pub fn into_shape(
        &self,
        outline: Vec<[f64; 2]>,
        settings: Settings<D>,
        free: impl Fn(&[[f64; D]]) -> Vec<bool>,
    ) -> Result<Ways<D>, GuidanceError> {
        let refused = |allowed: &str, got: &str| GuidanceError::new("the outline", allowed, &got);
        let outlines = Outlines::new(&[outline]);
        if outlines.area <= 0.0 || outlines.area.is_nan() {
            return Err(refused(
                "a line around some area",
                "one that encloses nothing",
            ));
        }
        let silhouette = Silhouette {
            outlines: &outlines,
            depth: None,
        };
        let free = |x: &[[f64; D]]| Ok::<_, Infallible>(free(x));
        let filling = Filling {
            walls: self.walls,
            volume: self.volume,
            particles: self.present.ids.len(),
            shrinks: false,
        };
        let Ok(filled) = silhouette.filled(filling, free);
        let room = filled.cells.len() as f64 * filled.side.powi(D as i32);
        if room < 0.99 * self.volume {
            return Err(refused(
                "where the fluid has room",
                "one that walls and obstacles take a part of",
            ));
        }
        let side = (room / filled.cells.len() as f64).powf(1.0 / D as f64);
        let space = settings
            .room
            .as_ref()
            .map(|room| room.space(1.0))
            .transpose()?;
        let mut found = match_to_region(&self.x(), &filled.cells, space.as_ref())?;
        if found.cut_off.contains(&true) {
            return Err(refused(
                "where ways lead the fluid to",
                "one behind obstacles that leave no way",
            ));
        }
        in_cells(&mut found.places, &filled.cells, side);
        let start = self.frames - SETTLING.min(SHARE[1] * self.frames / SHARE[0]);
        let share = start as f64 / self.frames as f64;
        let seconds = share * self.frames as f64 * settings.frame_dt;
        let plan = Plan::of(found, &self.v(), &self.weight(), None, seconds)?;
        let Ok(pressed) = filling.pressed(&filled.cells, side, free);
        let settling = Settling::new(pressed, side, [start, self.frames], None)?;
        self.led(plan, settings, Some(settling))
    }

    /// Leads the fluid along an arrow, with the least acceleration and in the shape that it has.
    pub fn along_arrow(
        &self,
        arrow: [f64; D],
        settings: Settings<D>,
        free: impl Fn(&[[f64; D]]) -> Vec<bool>,
    ) -> Result<Ways<D>, GuidanceError> {
        let (x, v, weight) = (self.x(), self.v(), self.weight());
        let mean = |rows: &[[f64; D]]| -> [f64; D] {
            let sum = |axis: usize| rows.iter().zip(&weight).map(|(row, w)| w * row[axis]).sum();
            std::array::from_fn(sum)
        };
        let moved = |x: &[f64; D], share: f64| -> [f64; D] {
            std::array::from_fn(|axis| x[axis] + share * arrow[axis])
        };
        let [lower, upper] = self.walls;
        for look in 1..=LOOKS {
            let share = look as f64 / LOOKS as f64;
            let there: Vec<_> = x.iter().map(|x| moved(x, share)).collect();
            let within =
                |x: &[f64; D]| (0..D).all(|axis| lower[axis] <= x[axis] && x[axis] <= upper[axis]);
            let fits = free(&there).into_iter().zip(&there);
            let fits = fits.filter(|(free, x)| *free && (look < LOOKS || within(x)));
            if (fits.count() as f64) < (1.0 - MISFIT) * x.len() as f64 {
                return Err(GuidanceError::new(
                    "the arrow",
                    "one along which the fluid has room in its shape",
                    &"one that leads it into walls or obstacles",
                ));
            }
        }
        let tip = |x: &[f64; D]| -> [f64; D] {
            std::array::from_fn(|axis| (x[axis] + arrow[axis]).clamp(lower[axis], upper[axis]))
        };
        let center = mean(&x);
        let plan = Plan {
            starts: vec![0, 2],
            times: vec![0.0, self.frames as f64 * settings.frame_dt],
            corners: vec![center, moved(&center, 1.0)],
            v: vec![mean(&v), [0.0; D]],
            group: vec![0; x.len()],
            places: x.iter().map(tip).collect(),
            end: None,
        };
        self.led(plan, settings, None)
    }
}
