//! Errors, with the values needed to correct the arguments.

use thiserror::Error;

/// Why a graph could not be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GraphError {
    /// A length that is not finite and positive.
    #[error("{name} must be finite and > 0 m, got {value}")]
    Length { name: &'static str, value: f32 },
    /// A position that is not finite.
    #[error("x[{index}] must be finite, got {position:?}")]
    Position { index: usize, position: Vec<f32> },
    /// Arrays of different lengths.
    #[error("types must have {points} entries, one a point of x, got {flags}")]
    Flags { points: usize, flags: usize },
    /// Indices of points are 31 bits wide.
    #[error("x must have at most {limit} points, got {points}")]
    Points { points: usize, limit: usize },
    /// The caller's watch ended the search.
    #[error("the search for neighbours was ended before it was done")]
    Interrupted,
    /// More edges than allowed.
    #[error(
        "the graph of {points} points has more than max_edges = {limit} edges: points have clumped, or the \
         radius of {radius} m is too large; shorten it or raise max_edges"
    )]
    Edges {
        points: usize,
        radius: f32,
        limit: usize,
    },
}
