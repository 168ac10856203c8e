//! Prescribed rigid motion of obstacles.

use crate::error::MpmError;
use crate::linalg::{Matrix, Vector};
use serde::{Deserialize, Serialize};

/// Motion back and forth instead of on and on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Swing {
    /// Time of one swing there and back [s].
    pub period: f32,
    /// Where in the period the motion starts, in [0, 1): at 0 with full speed, at 0.75 at rest, going forth.
    pub phase: f32,
}

/// Translation and rotation at given rates, steady or swinging.
///
/// With the clock s(t) = t, or s(t) = T / (2 pi) (sin(2 pi (t / T + phase)) - sin(2 pi phase)) where it
/// swings with the period T, the centre has moved by `velocity` s and the solid has turned about it by
/// exp(W s), W being the matrix of the angular velocity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Motion<const D: usize> {
    /// Velocity of the centre [m/s]; the largest one where the motion swings.
    velocity: Vector<D>,
    /// W, skew: its product with an arm from the centre is the velocity at its end [1/s].
    spin: Matrix<D>,
    /// Centre of rotation at time 0 [m].
    center: Vector<D>,
    swing: Option<Swing>,
}

impl<const D: usize> Motion<D> {
    /// `angular_velocity` [rad/s] has one component in 2D, anticlockwise, and three in 3D; or none.
    pub fn new(
        velocity: Vector<D>,
        angular_velocity: &[f32],
        center: Vector<D>,
        swing: Option<Swing>,
    ) -> Result<Self, MpmError> {
        let spin = match (D, angular_velocity) {
            (_, []) => Matrix::zeros(),
            (2, &[w]) => skew(&[(1, 0, w)]),
            (3, &[x, y, z]) => skew(&[(2, 1, x), (0, 2, y), (1, 0, z)]),
            _ => {
                return Err(MpmError::parameter(
                    "angular_velocity",
                    "one number in 2D and three in 3D",
                    angular_velocity,
                ));
            }
        };
        if !velocity
            .iter()
            .chain(&spin)
            .chain(&center)
            .all(|s| s.is_finite())
        {
            return Err(MpmError::parameter(
                "motion",
                "of finite velocity, angular_velocity and center",
                (velocity.as_slice(), angular_velocity, center.as_slice()),
            ));
        }
        if let Some(Swing { period, phase }) = swing {
            if !(period > 0.0 && period.is_finite()) {
                return Err(MpmError::parameter("period", "finite and > 0 s", period));
            }
            if !(0.0..1.0).contains(&phase) {
                return Err(MpmError::parameter("phase", "in [0, 1)", phase));
            }
        }
        Ok(Self {
            velocity,
            spin,
            center,
            swing,
        })
    }

    /// Where the solid is at a time [s].
    pub fn pose(&self, time: f64) -> Pose<D> {
        let (clock, rate) = self.clock(time);
        // Rodrigues' formula; it is also valid in the plane, where W^2 is -w^2 I.
        let angular_speed = self.angular_speed();
        let (sine, cosine) = libm::sincos(angular_speed * clock);
        let (first, second) = if angular_speed > 0.0 {
            (sine / angular_speed, (1.0 - cosine) / angular_speed.powi(2))
        } else {
            (0.0, 0.0)
        };
        Pose {
            start: self.center,
            center: self.center + self.velocity.map(|v| (f64::from(v) * clock) as f32),
            rotation: Matrix::identity()
                + self.spin * first as f32
                + self.spin * self.spin * second as f32,
            velocity: self.velocity * rate as f32,
            spin: self.spin * rate as f32,
        }
    }

    /// Largest speed of a point at this distance from the centre [m/s], at any time.
    pub fn speed(&self, radius: f32) -> f32 {
        let turning = self.angular_speed() as f32;
        // A solid without rotation may reach to infinity.
        self.velocity.norm() + if turning > 0.0 { turning * radius } else { 0.0 }
    }

    /// Whether all points keep their coordinate along an axis.
    pub(super) fn keeps(&self, axis: usize) -> bool {
        self.velocity[axis] == 0.0 && self.spin.row(axis).iter().all(|w| *w == 0.0)
    }

    /// Centre of rotation at time 0 [m].
    pub fn center(&self) -> Vector<D> {
        self.center
    }

    /// Angular speed [rad/s]; each of its components occurs twice in W.
    fn angular_speed(&self) -> f64 {
        let twice: f64 = self.spin.iter().map(|w| f64::from(*w).powi(2)).sum();
        (0.5 * twice).sqrt()
    }

    /// The clock s and its rate ds/dt.
    fn clock(&self, time: f64) -> (f64, f64) {
        let Some(Swing { period, phase }) = self.swing else {
            return (time, 1.0);
        };
        let turns = |t: f64| std::f64::consts::TAU * (t / f64::from(period) + f64::from(phase));
        let reach = f64::from(period) / std::f64::consts::TAU;
        let (now, start) = (turns(time), turns(0.0));
        (reach * (libm::sin(now) - libm::sin(start)), libm::cos(now))
    }
}

/// Skew matrix with these entries (row, column, value) and their opposites.
fn skew<const D: usize>(entries: &[(usize, usize, f32)]) -> Matrix<D> {
    let mut matrix = Matrix::zeros();
    for &(row, column, value) in entries {
        matrix[(row, column)] = value;
        matrix[(column, row)] = -value;
    }
    matrix
}

/// A rigid placement and its rate of change at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Pose<const D: usize> {
    /// Centre of rotation at time 0 and now [m].
    start: Vector<D>,
    center: Vector<D>,
    rotation: Matrix<D>,
    /// Velocity of the centre [m/s].
    velocity: Vector<D>,
    /// W now [1/s].
    spin: Matrix<D>,
}

impl<const D: usize> Pose<D> {
    /// Of a solid whose own frame is about its centre, with the matrix of its angular velocity.
    pub fn of_body(
        center: Vector<D>,
        rotation: Matrix<D>,
        velocity: Vector<D>,
        spin: Matrix<D>,
    ) -> Self {
        Self {
            start: Vector::zeros(),
            center,
            rotation,
            velocity,
            spin,
        }
    }

    /// The same place with another velocity of the centre and matrix of the angular velocity.
    #[must_use]
    pub fn moving(self, velocity: Vector<D>, spin: Matrix<D>) -> Self {
        Self {
            velocity,
            spin,
            ..self
        }
    }

    /// Bound on how far any point within a distance from the centre lies from where it is in another pose [m].
    pub fn apart(&self, other: &Self, reach: f32) -> f32 {
        (self.center - other.center).norm() + reach * (self.rotation - other.rotation).norm()
    }

    /// Largest speed of a point at this distance from the centre [m/s].
    pub fn speed(&self, reach: f32) -> f32 {
        let twice = self.spin.norm_squared();
        self.velocity.norm() + (0.5 * twice).sqrt() * reach
    }

    /// Rotation since time 0.
    pub fn rotation(&self) -> &Matrix<D> {
        &self.rotation
    }

    /// Velocity of the centre [m/s], and the matrix of the angular velocity.
    pub fn rates(&self) -> (&Vector<D>, &Matrix<D>) {
        (&self.velocity, &self.spin)
    }

    /// Position at time 0 of the point of the solid that is at `x` now.
    pub fn at_start(&self, x: &Vector<D>) -> Vector<D> {
        self.rotation.tr_mul(&(x - self.center)) + self.start
    }

    /// The same of several points, with the same operations.
    #[inline(always)]
    pub fn all_at_start<const N: usize>(&self, x: &[[f32; N]; D]) -> [[f32; N]; D] {
        let mut at_start = [[0.0; N]; D];
        for row in 0..D {
            for i in 0..N {
                let part =
                    |axis: usize| self.rotation[(axis, row)] * (x[axis][i] - self.center[axis]);
                let turned = (1..D).fold(part(0), |sum, axis| sum + part(axis));
                at_start[row][i] = turned + self.start[row];
            }
        }
        at_start
    }

    /// Position now of the point of the solid that is at `x` at time 0.
    pub fn apply(&self, x: &Vector<D>) -> Vector<D> {
        self.turn(&(x - self.start)) + self.center
    }

    /// A direction of time 0 as it points now.
    pub fn turn(&self, direction: &Vector<D>) -> Vector<D> {
        self.rotation * direction
    }

    /// The same of several directions, with the same operations.
    #[inline(always)]
    pub fn turn_all<const N: usize>(&self, directions: &[[f32; N]; D]) -> [[f32; N]; D] {
        let mut turned = [[0.0; N]; D];
        for row in 0..D {
            for i in 0..N {
                let part = |axis: usize| self.rotation[(row, axis)] * directions[axis][i];
                turned[row][i] = (1..D).fold(part(0), |sum, axis| sum + part(axis));
            }
        }
        turned
    }

    /// Velocity of the solid at a point [m/s].
    pub fn velocity_at(&self, x: &Vector<D>) -> Vector<D> {
        self.velocity + self.spin * (x - self.center)
    }

    /// Centre of rotation now [m].
    pub fn center(&self) -> Vector<D> {
        self.center
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_goes_anticlockwise_about_the_moving_centre() {
        let quarter = std::f32::consts::FRAC_PI_2;
        let center = Vector::<2>::new(0.5, 0.5);
        let velocity = Vector::<2>::new(0.1, 0.0);
        let pose = Motion::new(velocity, &[quarter], center, None)
            .unwrap()
            .pose(1.0);
        let moved = pose.apply(&Vector::<2>::new(0.7, 0.5));
        assert!(
            (moved - Vector::<2>::new(0.6, 0.7)).norm() < 1e-6,
            "{moved}"
        );
        assert!((pose.at_start(&moved) - Vector::<2>::new(0.7, 0.5)).norm() < 1e-6);
        let speed = pose.velocity_at(&moved);
        assert!(
            (speed - Vector::<2>::new(0.1 - 0.2 * quarter, 0.0)).norm() < 1e-6,
            "{speed}"
        );
    }

    #[test]
    fn in_3d_the_rotation_is_that_about_the_axis() {
        let turn = [0.0, std::f32::consts::FRAC_PI_2, 0.0];
        let pose = Motion::<3>::new(Vector::zeros(), &turn, Vector::zeros(), None)
            .unwrap()
            .pose(1.0);
        let moved = pose.apply(&Vector::<3>::new(1.0, 2.0, 0.0));
        assert!(
            (moved - Vector::<3>::new(0.0, 2.0, -1.0)).norm() < 1e-6,
            "{moved}"
        );
    }

    #[test]
    fn velocities_are_the_rates_of_the_positions() {
        for swing in [
            None,
            Some(Swing {
                period: 0.7,
                phase: 0.3,
            }),
        ] {
            let (velocity, center) = (
                Vector::<3>::new(0.3, -0.2, 0.5),
                Vector::<3>::new(0.4, 0.5, 0.6),
            );
            let motion = Motion::new(velocity, &[1.0, -2.0, 3.0], center, swing).unwrap();
            let point = Vector::<3>::new(0.1, 0.9, 0.3);
            let (time, step) = (0.45, 1e-3);
            let now = motion.pose(time);
            let difference = (motion.pose(time + step).apply(&point)
                - motion.pose(time - step).apply(&point))
                / 2e-3;
            let exact = now.velocity_at(&now.apply(&point));
            assert!((difference - exact).norm() < 1e-3, "{difference} {exact}");
            assert!(exact.norm() <= motion.speed((point - center).norm()) + 1e-6);
        }
    }

    #[test]
    fn a_swing_comes_back_and_starts_at_rest_from_its_end() {
        let swing = Some(Swing {
            period: 0.5,
            phase: 0.25,
        });
        let motion =
            Motion::<2>::new(Vector::<2>::new(1.0, 0.0), &[], Vector::zeros(), swing).unwrap();
        let at = |time| motion.pose(time).apply(&Vector::zeros()).x;
        assert!(at(0.0).abs() < 1e-7 && at(0.5).abs() < 1e-6);
        // From one end to the other: twice the amplitude, T / (2 pi) times the largest speed.
        assert!((at(0.25) + 2.0 * 0.5 / std::f32::consts::TAU).abs() < 1e-6);
        assert!(motion.pose(0.0).velocity_at(&Vector::zeros()).norm() < 1e-6);
    }
}
