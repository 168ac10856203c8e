//! What closed lines in the plane enclose, by the even-odd rule.

/// Lines across an outline along which its area is summed.
const LINES: usize = 2048;

/// Closed lines; what they enclose an odd number of times is inside.
#[derive(Debug, Clone)]
pub struct Outlines {
    /// Edges: the lower end, then the upper end. Those along x cross nothing and are left out.
    edges: Vec<[f64; 4]>,
    /// Corners of the box around the lines [m].
    pub bounds: [[f64; 2]; 2],
    /// Area [m^2]; 0 where they enclose nothing.
    pub area: f64,
    /// Centre of the area [m].
    pub center: [f64; 2],
}

impl Outlines {
    /// The last point of each line joins its first.
    pub fn new(lines: &[Vec<[f64; 2]>]) -> Self {
        let mut bounds = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        let mut edges = Vec::new();
        for line in lines {
            for (index, &[x, y]) in line.iter().enumerate() {
                for (axis, along) in [x, y].into_iter().enumerate() {
                    bounds[0][axis] = bounds[0][axis].min(along);
                    bounds[1][axis] = bounds[1][axis].max(along);
                }
                let [u, v] = line[(index + 1) % line.len()];
                if y < v {
                    edges.push([x, y, u, v]);
                } else if v < y {
                    edges.push([u, v, x, y]);
                }
            }
        }
        let mut made = Self {
            edges,
            bounds,
            area: 0.0,
            center: bounds[0],
        };
        made.sum();
        made
    }

    /// Sums area and centre along lines across.
    fn sum(&mut self) {
        let [low, high] = self.bounds;
        let step = (high[1] - low[1]) / LINES as f64;
        if step.is_nan() || step <= 0.0 {
            return;
        }
        let heights: Vec<f64> = (0..LINES)
            .map(|line| low[1] + step * (line as f64 + 0.5))
            .collect();
        let (mut length, mut moment) = (0.0, [0.0; 2]);
        for (x, y) in self.crossings(&heights).into_iter().zip(heights) {
            // Crossings of a line come in pairs, between which the shape is.
            for pair in x.as_chunks::<2>().0 {
                let along = pair[1] - pair[0];
                length += along;
                moment[0] += along * (pair[0] + pair[1]) / 2.0;
                moment[1] += along * y;
            }
        }
        if length > 0.0 {
            self.area = step * length;
            self.center = moment.map(|moment| moment / length);
        }
    }

    /// Where horizontal lines at ascending heights cross the outlines, from left to right.
    fn crossings(&self, heights: &[f64]) -> Vec<Vec<f64>> {
        let mut found = vec![Vec::new(); heights.len()];
        for &[x0, y0, x1, y1] in &self.edges {
            let first = heights.partition_point(|&height| height < y0);
            for (height, found) in heights[first..].iter().zip(&mut found[first..]) {
                if *height >= y1 {
                    break;
                }
                found.push(x0 + (height - y0) / (y1 - y0) * (x1 - x0));
            }
        }
        for row in &mut found {
            row.sort_unstable_by(f64::total_cmp);
        }
        found
    }

    /// Which points lie inside.
    pub fn covers(&self, points: &[[f64; 2]]) -> Vec<bool> {
        let mut heights: Vec<f64> = points.iter().map(|point| point[1]).collect();
        heights.sort_unstable_by(f64::total_cmp);
        heights.dedup();
        let rows = self.crossings(&heights);
        let inside = |point: &[f64; 2]| {
            let row = &rows[heights.partition_point(|&height| height < point[1])];
            row.partition_point(|&x| x < point[0]) % 2 == 1
        };
        points.iter().map(inside).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(low: f64, high: f64) -> Vec<[f64; 2]> {
        vec![[low, low], [high, low], [high, high], [low, high]]
    }

    #[test]
    fn a_line_within_another_makes_a_hole() {
        let frame = Outlines::new(&[square(0.0, 4.0), square(1.0, 2.0)]);
        assert!((frame.area - 15.0).abs() < 1e-2, "{frame:?}");
        assert!((frame.center[0] - 30.5 / 15.0).abs() < 1e-3, "{frame:?}");
        let points = [[0.5, 0.5], [1.5, 1.5], [2.5, 1.5], [4.5, 1.5], [-0.5, 3.0]];
        assert_eq!(frame.covers(&points), [true, false, true, false, false]);
    }

    #[test]
    fn what_is_enclosed_twice_is_outside() {
        let crossed = Outlines::new(&[square(0.0, 2.0), square(1.0, 3.0)]);
        assert!((crossed.area - 6.0).abs() < 1e-2, "{crossed:?}");
        assert_eq!(crossed.covers(&[[0.5, 0.5], [1.5, 1.5]]), [true, false]);
    }

    #[test]
    fn lines_without_an_area_enclose_nothing() {
        for line in [vec![[0.0, 1.0], [1.0, 1.0], [2.0, 1.0]], square(1.0, 1.0)] {
            let empty = Outlines::new(&[line]);
            assert_eq!(empty.area, 0.0);
            assert_eq!(empty.covers(&[[1.0, 1.0]]), [false]);
        }
    }
}
