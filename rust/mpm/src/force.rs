//! External accelerations besides gravity.

use crate::error::MpmError;
use crate::linalg::{Vector, norm};

/// External acceleration in all frames of a call [m/s^2].
#[derive(Debug, Clone, Copy)]
pub enum Force<'a> {
    None,
    /// D numbers, the same for all particles and frames.
    Uniform(&'a [f32]),
    /// N x D numbers in the caller's order, the same for all frames.
    Held(&'a [f32]),
    /// frames x N x D numbers.
    PerFrame(&'a [f32]),
}

impl<'a> Force<'a> {
    /// Refuses a force of another size than `frames` frames of `count` particles need, and one that is not finite.
    ///
    /// Where the number of particles may change, one number for each of them serves a single frame.
    pub(crate) fn check<const D: usize>(
        &self,
        frames: usize,
        count: usize,
        may_change: bool,
    ) -> Result<(), MpmError> {
        let (numbers, expected) = match *self {
            Self::None => (&[][..], 0),
            Self::Uniform(numbers) if numbers.len() == D => (numbers, D),
            Self::Uniform(numbers) => {
                let allowed = "one number for each axis where it is uniform";
                return Err(MpmError::parameter("force", allowed, numbers));
            }
            Self::Held(numbers) => (numbers, count * D),
            Self::PerFrame(numbers) => (numbers, count * D * frames),
        };
        if numbers.len() != expected {
            return Err(MpmError::Length {
                name: "force",
                expected,
                got: numbers.len(),
            });
        }
        let for_each = matches!(self, Self::Held(_) | Self::PerFrame(_));
        if may_change && for_each && frames > 1 {
            let allowed = "1 with a force where emitters or sinks change the number of particles, unless it is one \
                           uniform force of D numbers";
            return Err(MpmError::parameter("frames", allowed, frames));
        }
        // Without a stop at the first that is not, so that vectors of them are looked at.
        if numbers.iter().fold(true, |all, a| all & a.is_finite()) {
            return Ok(());
        }
        match numbers.iter().find(|a| !a.is_finite()) {
            Some(bad) => Err(MpmError::parameter("force", "finite", bad)),
            None => Ok(()),
        }
    }

    /// The force in the frame with this index in the call; it has been checked.
    pub(crate) fn in_frame<const D: usize>(&self, index: usize, count: usize) -> FrameForce<'a, D> {
        match *self {
            Self::None => FrameForce::None,
            Self::Uniform(a) => FrameForce::Uniform(Vector::from_column_slice(a)),
            Self::Held(all) => FrameForce::PerParticle(all),
            Self::PerFrame(all) => {
                let size = count * D;
                FrameForce::PerParticle(&all[index * size..][..size])
            }
        }
    }
}

/// External acceleration in one frame [m/s^2].
#[derive(Debug, Clone, Copy)]
pub(crate) enum FrameForce<'a, const D: usize> {
    None,
    Uniform(Vector<D>),
    /// N x D numbers in the caller's order.
    PerParticle(&'a [f32]),
}

impl<const D: usize> FrameForce<'_, D> {
    pub fn is_some(&self) -> bool {
        !matches!(self, Self::None)
    }

    /// Its largest magnitude [m/s^2].
    pub fn largest(&self) -> f32 {
        match self {
            Self::None => 0.0,
            Self::Uniform(a) => norm(a.as_slice()),
            Self::PerParticle(all) => {
                let (rows, _) = all.as_chunks::<D>();
                // Squares in as many lanes as a vector has: this is done in every frame.
                let mut squares = [0.0_f32; 8];
                for rows in rows.chunks(squares.len()) {
                    for (largest, row) in squares.iter_mut().zip(rows) {
                        let square = row.iter().map(|a| a * a).sum::<f32>();
                        *largest = if square > *largest { square } else { *largest };
                    }
                }
                squares.into_iter().fold(0.0, f32::max).sqrt()
            }
        }
    }

    /// Whether it pushes the particle with this index in the caller's order.
    #[inline(always)]
    pub fn pushes(&self, particle: u32) -> bool {
        match self {
            Self::None => false,
            Self::Uniform(a) => a.iter().any(|&a| a != 0.0),
            Self::PerParticle(all) => {
                let a = &all[particle as usize * D..][..D];
                a.iter().any(|&a| a != 0.0)
            }
        }
    }
}
