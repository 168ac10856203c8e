//! Mass on the nodes of a plain grid, for the error measures.

use crate::error::MpmError;
use crate::grid::Stencil;
use crate::linalg::Vector;

/// Quadratic B-spline P2G of mass on the nodes of a world of `cells` along each axis, first axis slowest.
///
/// Nodes that a stencil has outside of the world hand their share to the nearest node inside, so the sum is
/// that of `mass`. Sums in double precision.
pub fn grid_mass<const D: usize>(
    x: &[f32],
    mass: &[f32],
    resolution: usize,
    cells: [usize; D],
) -> Result<Vec<f32>, MpmError> {
    if x.len() != mass.len() * D {
        return Err(MpmError::Length {
            name: "x",
            expected: mass.len() * D,
            got: x.len(),
        });
    }
    if resolution == 0 || cells.iter().any(|count| !(2..=4096).contains(count)) {
        let allowed = "in [2, 4096] along each axis";
        return Err(MpmError::parameter("cells", allowed, cells));
    }
    let upper = cells.map(|count| count as f32 / resolution as f32);
    let mut nodes = vec![0.0f64; cells.iter().map(|count| count + 1).product()];
    for (i, (x, &mass)) in x.chunks_exact(D).zip(mass).enumerate() {
        if !x.iter().zip(upper).all(|(s, end)| (0.0..=end).contains(s)) {
            return Err(MpmError::parameter(
                format!("x[{i}]"),
                "inside the world",
                x,
            ));
        }
        // One cell of offset keeps the stencil's coordinates positive.
        let xi = Vector::<D>::from_fn(|axis, _| x[axis] * resolution as f32 + 1.0);
        let stencil = Stencil::at(&xi);
        for flat in 0..3usize.pow(D as u32) {
            let (mut index, mut weight, mut rest) = (0, f64::from(mass), flat);
            for axis in 0..D {
                let step = rest % 3;
                rest /= 3;
                let node = (stencil.base[axis] + step).clamp(1, cells[axis] + 1) - 1;
                index = index * (cells[axis] + 1) + node;
                weight *= f64::from(stencil.weights[axis][step]);
            }
            nodes[index] += weight;
        }
    }
    Ok(nodes.into_iter().map(|mass| mass as f32).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mass_is_kept_also_at_the_edge() {
        let x = [0.0, 0.0, 1.0, 1.0, 0.5, 0.51, 0.999, 0.3];
        let nodes = grid_mass::<2>(&x, &[1.0, 2.0, 3.0, 4.0], 16, [16, 16]).unwrap();
        assert!((nodes.iter().sum::<f32>() - 10.0).abs() < 1e-5);
        assert!(nodes[0] > 0.7 && nodes[17 * 17 - 1] > 1.4);
    }
}
