//! Which distances make an edge.

/// The squared radius, and the bounds between which single precision does not decide whether a pair is within it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reach {
    squared: f64,
    inclusive: bool,
    /// A squared distance computed in single precision that is at most this is within the radius for sure.
    pub sure: f32,
    /// One above this is beyond for sure.
    pub most: f32,
}

/// Relative error of a squared distance in single precision, with room to spare: each of the at most six roundings
/// on its way adds 6e-8.
const DOUBT: f64 = 1.0e-6;
/// Squares in this range neither overflow nor lose digits in single precision.
const SAFE: std::ops::Range<f64> = 1.0e-25..1.0e37;

impl Reach {
    pub fn new(radius: f32, inclusive: bool) -> Self {
        let squared = f64::from(radius).powi(2);
        let (sure, most) = if SAFE.contains(&squared) {
            (squared * (1.0 - DOUBT), squared * (1.0 + DOUBT))
        } else {
            (-1.0, f64::INFINITY)
        };
        Self {
            squared,
            inclusive,
            sure: sure as f32,
            most: most as f32,
        }
    }

    /// Whether a pair is an edge. Computed in double precision, so that the answer is the same from both ends and at
    /// the radius itself.
    pub fn joins(&self, a: &[f32], b: &[f32]) -> bool {
        let pairs = a.iter().zip(b);
        let squared = pairs
            .map(|(&s, &t)| (f64::from(s) - f64::from(t)).powi(2))
            .sum::<f64>();
        squared < self.squared || (self.inclusive && squared == self.squared)
    }
}
