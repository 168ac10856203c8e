//! What a visitor of a page draws: an outline that the fluid fills, or an arrow that it follows.

use guidance::{Fluid, Followed, Present, Room, Settings};

use crate::dimension::D;

/// Nodes along the longest side of the world of the grid for ways around obstacles.
const NODES: f64 = 64.0;
/// Cells along that side of the grid on which forces are smoothed.
const CELLS: u32 = 32;
/// How far ahead forces aim on ways around obstacles [frames].
const AHEAD: u32 = 24;

/// An outline or an arrow, with what the page knows of the scene, in metres and seconds.
pub struct Drawing {
    is_shape: bool,
    frames: u64,
    hold: u64,
    frame_dt: f64,
    unit: f64,
    spacing: f64,
    cap: f64,
    gravity: [f64; D],
    walls: [[f64; D]; 2],
    points: Vec<[f64; 2]>,
}

/// The state that was drawn on.
#[derive(Clone, Copy)]
pub struct State<'a> {
    pub frame: u64,
    pub present: Present<'a, D>,
    pub mass: &'a [f32],
}

impl Drawing {
    /// Reads 1 for an outline or 0 for an arrow, frames until the goal and for which it is kept, length of a frame,
    /// longest side of the world, spacing of the particles, largest acceleration, gravity, both corners of the walls,
    /// and the points in the plane.
    pub fn read(numbers: &[f64]) -> Option<Self> {
        let (head, rest) = numbers.split_first_chunk::<7>()?;
        let (vectors, points) = rest.split_at_checked(3 * D)?;
        let vector = |first: usize| std::array::from_fn(|axis| vectors[first * D + axis]);
        let &[kind, frames, hold, frame_dt, unit, spacing, cap] = head;
        Some(Self {
            is_shape: kind > 0.0,
            frames: frames as u64,
            hold: hold as u64,
            frame_dt,
            unit,
            spacing,
            cap,
            gravity: vector(0),
            walls: [vector(1), vector(2)],
            points: points.as_chunks().0.to_vec(),
        })
    }

    /// The law that leads the fluid there. `distances` are those of the nearest obstacle from points [m].
    pub fn followed(
        self,
        state: State<'_>,
        distances: impl Fn(&[[f64; D]]) -> Vec<f64>,
    ) -> Result<Followed<D>, String> {
        let count = state.present.ids.len();
        let fluid = Fluid {
            present: state.present,
            mass: state.mass,
            volume: count as f64 * self.spacing.powi(D as i32),
            walls: self.walls,
            frames: self.frames,
        };
        let settings = Settings {
            gravity: self.gravity.map(|along| along as f32),
            frame_dt: self.frame_dt,
            cells: CELLS,
            cap: self.cap,
            ahead: AHEAD,
            unit: self.unit,
            room: self.room(&distances),
        };
        let free = |x: &[[f64; D]]| distances(x).into_iter().map(|away| away >= 0.0).collect();
        let ways = match (self.is_shape, &self.points[..]) {
            (true, _) => fluid.into_shape(self.points, settings, free),
            (false, [tail, .., tip]) => {
                let along = |axis| {
                    if axis < 2 {
                        tip[axis] - tail[axis]
                    } else {
                        0.0
                    }
                };
                fluid.along_arrow(std::array::from_fn(along), settings, free)
            }
            _ => return Err("an arrow has two points".into()),
        };
        let ways = ways.map_err(|error| error.to_string())?;
        Ok(Followed::one(state.frame, self.frames + self.hold, ways))
    }

    /// Distances of obstacles on a grid between the walls, whose outermost nodes lie on or within them; None without.
    fn room(&self, distances: impl Fn(&[[f64; D]]) -> Vec<f64>) -> Option<Room<D>> {
        let [lower, upper] = self.walls;
        let cells = NODES / self.unit;
        let along = |axis: usize| ((upper[axis] - lower[axis]) * cells + 1e-9) as usize;
        let counts: [usize; D] = std::array::from_fn(|axis| along(axis).max(1) + 1);
        let node = |flat: usize| -> [f64; D] {
            let mut index = flat;
            let mut x = lower;
            for axis in (0..D).rev() {
                x[axis] += (index % counts[axis]) as f64 / cells;
                index /= counts[axis];
            }
            x
        };
        let nodes: Vec<_> = (0..counts.iter().product()).map(node).collect();
        let distance = distances(&nodes);
        distance.iter().any(|away| away.is_finite()).then(|| Room {
            lower,
            spacing: 1.0 / cells,
            counts,
            distance,
        })
    }
}
