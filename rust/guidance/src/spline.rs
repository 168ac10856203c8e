//! Cubic splines through given points, timed so that they need the least acceleration.

use crate::error::{GuidanceError, finite};

/// Times and velocities of the points of a spline.
#[derive(Debug, Clone, PartialEq)]
pub struct Timing<const D: usize> {
    /// When each point is passed, from 0 on [s].
    pub times: Vec<f64>,
    /// Velocity in each point [m/s].
    pub velocities: Vec<[f64; D]>,
}

/// Rounds of the search for the durations; more lower the integral by less than 1 %.
const ROUNDS: usize = 40;
/// The search ends where durations would change by less than this fraction.
const FINEST: f64 = 5e-3;

/// Times a way through `points` so that the integral of |acceleration|^2 over `seconds` is least.
///
/// For given times that is the clamped cubic spline. The durations between the points are searched: each in turn
/// is made longer and shorter as long as that helps. The velocities at both ends are given [m/s].
pub fn least_acceleration<const D: usize>(
    points: &[[f64; D]],
    start_velocity: [f64; D],
    end_velocity: [f64; D],
    seconds: f64,
) -> Result<Timing<D>, GuidanceError> {
    if points.len() < 2 {
        return Err(GuidanceError::new(
            "points",
            "at least 2 points",
            &points.len(),
        ));
    }
    if !(seconds > 0.0 && seconds.is_finite()) {
        return Err(GuidanceError::new(
            "seconds",
            "above 0 and finite",
            &seconds,
        ));
    }
    finite("points", points.as_flattened())?;
    finite("velocities", &[start_velocity, end_velocity].concat())?;
    let lengths = points
        .windows(2)
        .map(|pair| crate::partition::square_distance(&pair[0], &pair[1]).sqrt());
    // Points in one place get some time too, for no duration may be zero.
    let mean = lengths.clone().sum::<f64>() / (points.len() - 1) as f64;
    let mut durations: Vec<f64> = lengths
        .map(|length| length.max(1e-3 * mean).max(1e-9))
        .collect();
    normalise(&mut durations, seconds);
    let ends = [start_velocity, end_velocity];
    let (mut velocities, mut least) = clamped(points, &durations, ends);
    let mut step = 0.5;
    for _ in 0..ROUNDS {
        let mut better = false;
        for index in 0..durations.len() {
            for factor in [1.0 + step, 1.0 / (1.0 + step)] {
                let mut tried = durations.clone();
                tried[index] *= factor;
                normalise(&mut tried, seconds);
                let (found, effort) = clamped(points, &tried, ends);
                if effort < least {
                    (durations, velocities, least, better) = (tried, found, effort, true);
                }
            }
        }
        if !better {
            step *= 0.5;
        }
        if step < FINEST {
            break;
        }
    }
    let mut times = vec![0.0];
    times.extend(durations.iter().scan(0.0, |time, duration| {
        *time += duration;
        Some(*time)
    }));
    // Not the rounded sum of the durations.
    times[durations.len()] = seconds;
    Ok(Timing { times, velocities })
}

fn normalise(durations: &mut [f64], seconds: f64) {
    let scale = seconds / durations.iter().sum::<f64>();
    for duration in durations {
        *duration *= scale;
    }
}

/// Velocities of the cubic spline with continuous acceleration, and the integral of |acceleration|^2.
fn clamped<const D: usize>(
    points: &[[f64; D]],
    durations: &[f64],
    ends: [[f64; D]; 2],
) -> (Vec<[f64; D]>, f64) {
    let last = points.len() - 1;
    let slope = |index: usize, axis: usize| {
        (points[index + 1][axis] - points[index][axis]) / durations[index]
    };
    let mut velocities = vec![ends[0]; last + 1];
    velocities[last] = ends[1];
    // Gauss' elimination of the tridiagonal system for the inner velocities.
    let mut upper = vec![0.0; last];
    for index in 1..last {
        let (before, after) = (1.0 / durations[index - 1], 1.0 / durations[index]);
        let diagonal = 2.0 * (before + after) - before * upper[index - 1];
        upper[index] = after / diagonal;
        for axis in 0..D {
            let right = 3.0 * (before * slope(index - 1, axis) + after * slope(index, axis));
            velocities[index][axis] = (right - before * velocities[index - 1][axis]) / diagonal;
        }
    }
    for index in (1..last).rev() {
        for axis in 0..D {
            velocities[index][axis] -= upper[index] * velocities[index + 1][axis];
        }
    }
    let mut effort = 0.0;
    for index in 0..last {
        let h = durations[index];
        for axis in 0..D {
            let (v, w, s) = (
                velocities[index][axis],
                velocities[index + 1][axis],
                slope(index, axis),
            );
            let (first, second) = (
                (6.0 * s - 4.0 * v - 2.0 * w) / h,
                (2.0 * v + 4.0 * w - 6.0 * s) / h,
            );
            effort += h / 3.0 * (first * first + first * second + second * second);
        }
    }
    (velocities, effort)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_cubic_are_timed_as_the_cubic_is() {
        let place = |t: f64| [t * t * (3.0 - 2.0 * t), 0.0];
        let points: Vec<_> = [0.0, 0.3, 0.5, 0.8, 1.0].map(place).to_vec();
        let timing = least_acceleration(&points, [0.0; 2], [0.0; 2], 1.0).unwrap();
        for (found, known) in timing.times.iter().zip([0.0, 0.3, 0.5, 0.8, 1.0]) {
            assert!((found - known).abs() < 5e-3, "{timing:?}");
        }
        assert!((timing.velocities[2][0] - 1.5).abs() < 0.02, "{timing:?}");
    }

    #[test]
    fn the_ends_have_the_velocities_asked_for() {
        let timing = least_acceleration(
            &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]],
            [1.0, 2.0],
            [0.5, 0.0],
            2.0,
        )
        .unwrap();
        assert_eq!(timing.velocities[0], [1.0, 2.0]);
        assert_eq!(timing.velocities[2], [0.5, 0.0]);
        assert_eq!((timing.times[0], timing.times[2]), (0.0, 2.0));
    }

    #[test]
    fn points_in_one_place_are_timed_too() {
        let timing = least_acceleration(&[[0.4, 0.4]; 3], [0.0; 2], [0.0; 2], 0.5).unwrap();
        assert!(timing.times.windows(2).all(|pair| pair[0] < pair[1]));
        assert!(
            timing
                .velocities
                .as_flattened()
                .iter()
                .all(|v| v.is_finite())
        );
    }
}
