//! A solver, and the memory for what a page reads.

use mpm::{Force, MpmError, Solver, Vector};
use sha2::{Digest, Sha256};

/// Dimension of the simulations of this module.
pub const D: usize = if cfg!(feature = "space") { 3 } else { 2 };

/// What a page reads of all particles.
#[derive(Clone, Copy)]
pub enum Quantity {
    Positions,
    Velocities,
    Pressures,
    VolumeRatios,
}

/// One simulation.
pub struct Player {
    solver: Solver<D>,
    numbers: Vec<f32>,
    bytes: Vec<u8>,
}

impl Player {
    pub fn open(data: &[u8]) -> Result<Self, MpmError> {
        Ok(Self {
            solver: Solver::from_start(data)?,
            numbers: Vec::new(),
            bytes: Vec::new(),
        })
    }

    pub fn count(&self) -> usize {
        self.solver.count()
    }

    pub fn frame(&self) -> u64 {
        self.solver.frame()
    }

    pub fn frame_dt(&self) -> f32 {
        self.solver.settings().frame_dt
    }

    pub fn length(&self) -> usize {
        self.bytes.len()
    }

    pub fn advance(&mut self, frames: usize, force: &[f32]) -> Result<(), MpmError> {
        let force = match force.len() {
            0 => Force::None,
            D => Force::Uniform(force),
            _ => Force::Held(force),
        };
        self.solver.advance(frames, force, |_, _| ())
    }

    /// Advances by a frame with the force of `control.push`: w (velocity - u) / (4 frames), w = (1 - r^2 / R^2)^2,
    /// within its cap.
    pub fn advance_pushed(&mut self, hand: &[f32]) -> Result<(), MpmError> {
        let Some(hand) = hand.first_chunk::<{ 2 * D + 2 }>() else {
            let allowed = "a point, a velocity, a radius and a largest acceleration";
            return Err(MpmError::parameter("hand", allowed, hand));
        };
        let (point, velocity) = (&hand[..D], &hand[D..2 * D]);
        let (radius, cap) = (hand[2 * D], hand[2 * D + 1]);
        let per_speed = 0.25 / self.frame_dt();
        let x = self.read(Quantity::Positions).to_vec();
        let v = self.read(Quantity::Velocities);
        let mut force = vec![0.0; v.len()];
        let particles = x.chunks_exact(D).zip(v.chunks_exact(D));
        for (force, (x, v)) in force.chunks_exact_mut(D).zip(particles) {
            let square: f32 = x.iter().zip(point).map(|(x, p)| (x - p) * (x - p)).sum();
            let weight = (1.0 - square / (radius * radius)).max(0.0);
            if weight == 0.0 {
                continue;
            }
            for (axis, component) in force.iter_mut().enumerate() {
                *component = weight * weight * (velocity[axis] - v[axis]) * per_speed;
            }
            let size = force.iter().map(|a| a * a).sum::<f32>().sqrt();
            let share = (cap / size.max(1.0e-12)).min(1.0);
            for component in force {
                *component *= share;
            }
        }
        self.advance(1, &force)
    }

    pub fn read(&mut self, quantity: Quantity) -> &[f32] {
        let of_each = match quantity {
            Quantity::Positions | Quantity::Velocities => D,
            Quantity::Pressures | Quantity::VolumeRatios => 1,
        };
        self.numbers.resize(self.count() * of_each, 0.0);
        let solver = &self.solver;
        match quantity {
            Quantity::Positions => solver.write_positions(&mut self.numbers),
            Quantity::Velocities => solver.write_velocities(&mut self.numbers),
            Quantity::Pressures => solver.write_pressures(&mut self.numbers),
            Quantity::VolumeRatios => solver.write_volume_ratios(&mut self.numbers),
        }
        &self.numbers
    }

    /// Where points of an obstacle at time 0 are now; those of an obstacle that does not exist stay.
    pub fn moved(&mut self, obstacle: usize, points: &[f32]) -> &[f32] {
        let time = self.frame() as f64 * f64::from(self.frame_dt());
        let placed = self.solver.settings().obstacles.get(obstacle);
        let placed = placed.map(|obstacle| obstacle.at(time));
        self.numbers.clear();
        for point in points.chunks_exact(D) {
            let point = Vector::from_column_slice(point);
            let now = placed.map_or(point, |placed| placed.moved(&point));
            self.numbers.extend_from_slice(now.as_slice());
        }
        &self.numbers
    }

    pub fn materials(&mut self) -> &[u8] {
        self.bytes.resize(self.count(), 0);
        self.solver.write_materials(&mut self.bytes);
        &self.bytes
    }

    pub fn digest(&mut self) -> &[u8] {
        let mut hash = Sha256::new();
        let ids = self.solver.ids();
        for id in ids {
            hash.update(id.to_le_bytes());
        }
        for quantity in [Quantity::Positions, Quantity::Velocities] {
            for number in self.read(quantity) {
                hash.update(number.to_le_bytes());
            }
        }
        self.bytes = hash.finalize().to_vec();
        &self.bytes
    }

    pub fn snapshot(&mut self) -> &[u8] {
        self.bytes = self.solver.snapshot();
        &self.bytes
    }

    pub fn restore(&mut self, data: &[u8]) -> Result<(), MpmError> {
        self.solver.restore(data)
    }
}
