//! Definition of edges, and checks of the arguments of a search.

use crate::error::GraphError;

/// Pairs of points that become edges.
#[derive(Debug, Clone, Copy)]
pub struct GraphSettings {
    /// Largest distance of a pair [m].
    pub radius: f32,
    /// Pairs at exactly the radius are joined too.
    pub inclusive: bool,
    /// Each point is a neighbour of itself.
    pub self_edges: bool,
    /// A graph with more edges is an error.
    pub max_edges: u32,
}

impl GraphSettings {
    /// All pairs of different points at most `radius` apart.
    pub fn new(radius: f32) -> Self {
        Self {
            radius,
            inclusive: true,
            self_edges: false,
            max_edges: u32::MAX,
        }
    }
}

pub(crate) fn check_length(name: &'static str, value: f32) -> Result<(), GraphError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(GraphError::Length { name, value })
    }
}

pub(crate) fn check_fixed(fixed: Option<&[bool]>, points: usize) -> Result<(), GraphError> {
    match fixed {
        Some(fixed) if fixed.len() != points => Err(GraphError::Flags {
            points,
            flags: fixed.len(),
        }),
        _ => Ok(()),
    }
}

pub(crate) fn check_points(points: usize) -> Result<(), GraphError> {
    let limit = i32::MAX as usize;
    if points > limit {
        return Err(GraphError::Points { points, limit });
    }
    Ok(())
}
