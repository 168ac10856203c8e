//! A local force, as of a hand that moves through the material.

use crate::error::{GuidanceError, finite};

/// Frames in which material in the middle would reach the velocity of the hand.
const FRAMES: f64 = 4.0;
/// Acceleration of free fall [m/s^2], the unit of the largest acceleration.
const EARTH: f64 = 9.81;

/// A hand: w (velocity - u) / (4 frames) with w = (1 - r^2 / radius^2)^2, within its cap.
///
/// The library and the page call this one function, so that both compute the same bits: all operations are those of IEEE
/// in double precision, in one order.
#[derive(Clone, Debug, PartialEq)]
pub struct Push<const D: usize> {
    point: [f64; D],
    velocity: [f64; D],
    radius: f64,
    cap: f64,
}

impl<const D: usize> Push<D> {
    /// A hand at a point [m] with a velocity [m/s], a radius [m] and a largest acceleration [g].
    pub fn new(
        point: [f64; D],
        velocity: [f64; D],
        radius: f64,
        cap: f64,
    ) -> Result<Self, GuidanceError> {
        finite("point", &point)?;
        finite("velocity", &velocity)?;
        for (name, number) in [("radius", radius), ("cap", cap)] {
            if !(number.is_finite() && number > 0.0) {
                return Err(GuidanceError::new(name, "finite and above 0", &number));
            }
        }
        Ok(Self {
            point,
            velocity,
            radius,
            cap,
        })
    }

    /// Adds the accelerations [m/s^2] of particles with places `x` [m] and velocities `v` [m/s] in a frame of a length [s].
    pub fn add_to(&self, force: &mut [[f32; D]], x: &[[f32; D]], v: &[[f32; D]], frame_dt: f32) {
        let seconds = FRAMES * f64::from(frame_dt);
        let cap = self.cap * EARTH;
        for (force, (x, v)) in force.iter_mut().zip(x.iter().zip(v)) {
            let mut square = 0.0;
            for axis in 0..D {
                let away = f64::from(x[axis]) - self.point[axis];
                square += away * away;
            }
            let near = 1.0 - square / (self.radius * self.radius);
            if near <= 0.0 {
                continue;
            }
            let mut own = [0.0; D];
            let mut size = 0.0;
            for axis in 0..D {
                own[axis] = near * near * (self.velocity[axis] - f64::from(v[axis])) / seconds;
                size += own[axis] * own[axis];
            }
            let share = (cap / size.sqrt().max(1.0e-12)).min(1.0);
            for axis in 0..D {
                force[axis] += (share * own[axis]) as f32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn force(push: &Push<2>, x: [f32; 2], v: [f32; 2]) -> [f32; 2] {
        let mut force = [[0.0; 2]];
        push.add_to(&mut force, &[x], &[v], 0.0025);
        force[0]
    }

    #[test]
    fn material_in_the_middle_reaches_the_velocity_in_four_frames() {
        let push = Push::new([0.5, 0.5], [0.3, -0.1], 0.1, 15.0).unwrap();
        let found = force(&push, [0.5, 0.5], [0.1, -0.1]);
        assert!((found[0] - 0.2 / 0.01).abs() < 1.0e-4, "{found:?}");
        assert!(found[1].abs() < 1.0e-5, "{found:?}");
    }

    #[test]
    fn the_force_falls_to_zero_at_the_radius() {
        let push = Push::new([0.5, 0.5], [0.3, 0.0], 0.1, 15.0).unwrap();
        let [middle, half, edge, outside] =
            [0.5, 0.55, 0.600_001, 0.8].map(|x| force(&push, [x, 0.5], [0.0; 2])[0]);
        assert!((half / middle - 0.75 * 0.75).abs() < 1.0e-5);
        assert_eq!([edge, outside], [0.0; 2]);
    }

    #[test]
    fn no_acceleration_is_above_the_cap() {
        let push = Push::new([0.5, 0.5], [30.0, 40.0], 0.1, 2.0).unwrap();
        let [x, y] = force(&push, [0.5, 0.5], [0.0; 2]);
        assert!((x.hypot(y) - 2.0 * 9.81).abs() < 1.0e-4);
        assert!((y / x - 4.0 / 3.0).abs() < 1.0e-6);
    }

    #[test]
    fn numbers_out_of_range_are_refused() {
        for (point, radius, cap) in [(f64::NAN, 0.1, 1.0), (0.5, 0.0, 1.0), (0.5, 0.1, -1.0)] {
            assert!(Push::new([point, 0.5], [0.0; 2], radius, cap).is_err());
        }
    }
}
