//! Grid momentum to velocity, with gravity, obstacles and walls (Hu et al. 2018, eq. 21).

use wide::f32x4;

use crate::boundary::{MaterialFriction, Obstacles, WallContact};
use crate::grid::{CHUNK, SMALLEST_MASS, Window};
use crate::linalg::{Kernel, Quad, Vector, lanes, run_wide};

/// Everything that acts on grid velocities.
pub struct GridForces<'a, const D: usize> {
    pub gravity: Vector<D>,
    pub walls: &'a WallContact,
    pub obstacles: &'a Obstacles<D>,
    pub material_friction: MaterialFriction,
}

/// Turns the momentum of a window of planes into the velocity at the end of a substep of `dt` [s], independently of other
/// planes. Returns the work of moving obstacles there [J].
pub fn grid_update<const D: usize>(
    window: &mut Window<'_, D>,
    forces: &GridForces<'_, D>,
    dt: f32,
) -> f64 {
    run_wide(Accelerate {
        window,
        gain: lanes(&(forces.gravity * dt), 0.0),
    });
    let work = forces.obstacles.apply(window, &forces.material_friction);
    forces.walls.apply(window, &forces.material_friction);
    work
}

/// Divides by the masses, and adds the change by gravity.
struct Accelerate<'w, 'g, const D: usize> {
    window: &'w mut Window<'g, D>,
    gain: f32x4,
}

impl<const D: usize> Kernel for Accelerate<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        let active = self.window.active();
        let Window {
            layout,
            first,
            nodes,
            dirty,
            ..
        } = self.window;
        let gain = Q::repeat(self.gain);
        let (kept, momentum) = ([0.0, 0.0, 0.0, 1.0].into(), [1.0, 1.0, 1.0, 0.0].into());
        let (kept, momentum) = (Q::repeat(kept), Q::repeat(momentum));
        for span in active {
            let start = span.row * layout.row_length - *first;
            for chunk in (start + span.lo) / CHUNK..(start + span.hi) / CHUNK {
                // Most nodes around spray are empty; their velocity is not read.
                if dirty[chunk] {
                    let (fours, _) = nodes[chunk * CHUNK..(chunk + 1) * CHUNK].as_chunks_mut();
                    for four in fours {
                        let node = Q::load(four);
                        let mass = node.last_numbers().max(Q::splat(SMALLEST_MASS));
                        // The mass itself is multiplied by one and gains nothing.
                        let factor = Q::splat(1.0).div(mass).mul_add(momentum, kept);
                        *four = node.mul_add(factor, gain).store();
                    }
                }
            }
        }
    }
}
