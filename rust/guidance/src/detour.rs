//! Direction of particles whose straight way is blocked: down a field of distances to the goal.

use crate::free_space::FreeSpace;
use crate::sight::Sight;

/// Steps of the grid over which a direction is taken, so that ways round corners are smooth.
const STEPS: usize = 4;

/// The shortest ways to a goal from everywhere, on the grid of a free space.
#[derive(Debug, Clone)]
pub struct Detour<const D: usize> {
    sight: Sight<D>,
    /// The way on from each node, also from those in obstacles.
    ways: Vec<WayOn<D>>,
}

/// The way on from a point.
#[derive(Debug, Clone, Copy)]
pub struct WayOn<const D: usize> {
    /// Unit vector.
    pub direction: [f32; D],
    /// Remaining length of the way [m]; infinite where there is none.
    pub length: f32,
}

impl<const D: usize> Detour<D> {
    /// Ways to the nearest of `goals`.
    pub fn new(space: &FreeSpace<D>, goals: &[[f64; D]]) -> Self {
        let lengths = space.lengths_to(goals);
        let ways = (0..lengths.len())
            .map(|node| {
                let start = space.point(node);
                let free = space.free_node(&start).unwrap_or(node);
                let mut here = free;
                for _ in 0..STEPS {
                    here = space.downhill(here, &lengths).unwrap_or(here);
                }
                let end = space.point(here);
                let way: [f32; D] = std::array::from_fn(|axis| (end[axis] - start[axis]) as f32);
                let size = way.iter().map(|along| along * along).sum::<f32>().sqrt();
                WayOn {
                    direction: way.map(|along| along / size.max(1e-9)),
                    length: lengths[free] as f32,
                }
            })
            .collect();
        Self {
            sight: Sight::new(space),
            ways,
        }
    }

    /// The way on from `x`, if something is between it and `aim` and a way is known.
    #[inline]
    pub fn around(&self, x: &[f32; D], aim: &[f32; D]) -> Option<WayOn<D>> {
        if self.sight.reaches(x, aim) {
            return None;
        }
        let way = self.ways[self.sight.nearest(x)];
        (way.length.is_finite() && way.length > 0.0).then_some(way)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::free_space::tests::walled_room;

    #[test]
    fn what_is_seen_needs_no_detour() {
        let detour = Detour::new(&walled_room(), &[[0.8, 0.2]]);
        assert!(detour.around(&[0.6, 0.2], &[0.8, 0.2]).is_none());
        assert!(detour.around(&[0.2, 0.8], &[0.8, 0.8]).is_none());
    }

    #[test]
    fn the_way_on_leads_up_the_wall_and_down_behind_it() {
        let detour = Detour::new(&walled_room(), &[[0.8, 0.2]]);
        let before = detour.around(&[0.44, 0.2], &[0.8, 0.2]).unwrap();
        assert!(before.direction[1] > 0.8, "{:?}", before.direction);
        assert!((before.length - 0.95).abs() < 0.15, "{}", before.length);
        // A point that touches the wall is led on, too.
        assert!(detour.around(&[0.488, 0.3], &[0.8, 0.2]).unwrap().direction[1] > 0.5);
    }
}
