//! Grid momentum to velocity, with gravity, obstacles and walls (Hu et al. 2018, eq. 21).

use wide::f32x4;

use crate::boundary::{MaterialFriction, Obstacles, WallContact};
use crate::grid::{CHUNK, Grid, SMALLEST_MASS, Window};
use crate::linalg::{Kernel, Vector, lanes, run_wide};
use crate::particles::Slab;
use threads::Team;

/// Everything that acts on grid velocities.
pub struct GridForces<'a, const D: usize> {
    pub gravity: Vector<D>,
    pub walls: &'a WallContact,
    pub obstacles: &'a Obstacles<D>,
    pub material_friction: MaterialFriction,
}

/// Turns the grid's momentum into the velocity at the end of the substep.
///
/// Slabs are planes of the grid: what happens at their nodes depends on no other plane, but for the walls
/// across the first axis, which come last.
pub fn grid_update<const D: usize>(
    grid: &mut Grid<D>,
    slabs: &[Slab],
    forces: &GridForces<'_, D>,
    dt: f32,
    team: &Team,
) {
    let last = slabs.len().saturating_sub(1);
    // The slabs tile the planes where stencils begin; they end on later ones.
    let planes = slabs.iter().enumerate().map(|(index, slab)| {
        slab.lo..if index == last {
            grid.layout.extent
        } else {
            slab.hi
        }
    });
    let planes: Vec<_> = planes.collect();
    team.for_each(&mut grid.windows(planes.into_iter()), |window| {
        run_wide(Accelerate {
            window,
            gain: lanes(&(forces.gravity * dt), 0.0),
        });
        forces.obstacles.apply(window, &forces.material_friction);
        forces.walls.apply_within(window, &forces.material_friction);
    });
    forces.walls.apply_across(grid, &forces.material_friction);
}

/// Divides by the masses, and adds what gravity gains.
struct Accelerate<'w, 'g, const D: usize> {
    window: &'w mut Window<'g, D>,
    gain: f32x4,
}

impl<const D: usize> Kernel for Accelerate<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Window {
            layout,
            first,
            nodes,
            dirty,
            active,
            ..
        } = self.window;
        for span in *active {
            let start = span.row * layout.row_length - *first;
            let (lo, hi) = (start + span.lo, start + span.hi);
            let (chunks, _) = nodes[lo..hi].as_chunks_mut();
            for (chunk, dirty) in chunks.iter_mut().zip(&mut dirty[lo / CHUNK..hi / CHUNK]) {
                *dirty = accelerate(chunk, self.gain);
            }
        }
    }
}

/// False when all nodes are empty.
#[inline(always)]
fn accelerate(nodes: &mut [f32x4; CHUNK], gain: f32x4) -> bool {
    let masses: [f32; CHUNK] = std::array::from_fn(|i| nodes[i].to_array()[3]);
    // Spray leaves most nodes empty. They stay as they are; nobody reads their velocity.
    if masses.iter().sum::<f32>() == 0.0 {
        return false;
    }
    let inverses = masses.map(|mass| {
        1.0 / if mass > SMALLEST_MASS {
            mass
        } else {
            SMALLEST_MASS
        }
    });
    for i in 0..CHUNK {
        // The mass lane is multiplied by one and gains nothing.
        let inverse = f32x4::from([inverses[i], inverses[i], inverses[i], 1.0]);
        nodes[i] = nodes[i] * inverse + gain;
    }
    true
}
