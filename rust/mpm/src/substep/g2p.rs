//! Grid to particles: velocity, affine matrix, deformation and position.
//!
//! v = sum_i w_ip v_i and C = (4 / dx^2) sum_i w_ip v_i (x_i - x_p)^T.

use wide::f32x4;

use crate::boundary::{Bounds, Obstacles, Reactions};
use crate::grid::{FieldView, Layout, Stencils, View};
use crate::linalg::{Kernel, LANES, Lanes, Quad, Vector, run_wide};
use crate::material::{Constitutive, State};
use crate::particles::{Activity, Block};
use crate::substep::p2g::for_each_row;

/// Result of a substep for some particles and nodes.
#[derive(Debug, Clone, Copy)]
pub struct Outcome {
    pub max_speed_squared: f32,
    /// All particles are finite, inside and of positive volume.
    pub sound: bool,
    /// Work of moving obstacles on them [J].
    pub obstacle_work: f64,
}

impl Outcome {
    pub const NOTHING: Self = Self {
        max_speed_squared: 0.0,
        sound: true,
        obstacle_work: 0.0,
    };

    pub fn and(self, other: Self) -> Self {
        Self {
            max_speed_squared: self.max_speed_squared.max(other.max_speed_squared),
            sound: self.sound && other.sound,
            obstacle_work: self.obstacle_work + other.obstacle_work,
        }
    }
}

/// The nodes that a group reads: those of the grid, and its own slots.
#[derive(Clone, Copy)]
pub struct Nodes<'a, const D: usize> {
    pub grid: View<'a, D>,
    pub own: Option<OwnView<'a>>,
}

/// Slots that a group reads, and its field.
#[derive(Clone, Copy)]
pub struct OwnView<'a> {
    pub fields: FieldView<'a>,
    pub field: u16,
}

/// Solids that particles are kept out of.
#[derive(Clone, Copy)]
pub struct Solids<'a, const D: usize> {
    pub bounds: &'a Bounds<D>,
    pub obstacles: &'a Obstacles<D>,
}

/// Updates blocks of one group from the nodes' velocities, over a substep of `dt` [s].
pub fn g2p<const D: usize, M: Constitutive<D>>(
    blocks: &mut [Block<D, M::State>],
    material: &M,
    friction: f32,
    nodes: Nodes<'_, D>,
    solids: Solids<'_, D>,
    reactions: &mut Reactions<D>,
    dt: f32,
) -> Outcome {
    let Nodes { grid, own } = nodes;
    let Solids { bounds, obstacles } = solids;
    run_wide(GatherBlocks {
        blocks,
        material,
        friction,
        grid,
        own,
        bounds,
        obstacles,
        reactions,
        dt,
    })
}

/// Some blocks of one group.
struct GatherBlocks<'a, const D: usize, M: Constitutive<D>> {
    blocks: &'a mut [Block<D, M::State>],
    material: &'a M,
    friction: f32,
    grid: View<'a, D>,
    own: Option<OwnView<'a>>,
    bounds: &'a Bounds<D>,
    obstacles: &'a Obstacles<D>,
    reactions: &'a mut Reactions<D>,
    dt: f32,
}

/// Weighted sums over the nodes of each particle, each as velocity and mass.
pub struct Sums([[f32x4; 4]; LANES]);

impl Sums {
    #[inline(always)]
    pub fn value(&self, lane: usize) -> f32x4 {
        self.0[lane][0]
    }

    /// The same, each node times its steps from the lowest along an axis.
    #[inline(always)]
    pub fn moment(&self, axis: usize, lane: usize) -> f32x4 {
        self.0[lane][1 + axis]
    }
}

impl<const D: usize, M: Constitutive<D>> Kernel for GatherBlocks<'_, D, M> {
    type Output = Outcome;

    #[inline(always)]
    fn run<Q: Quad>(self) -> Outcome {
        let Self {
            material,
            grid,
            own,
            bounds,
            obstacles,
            reactions,
            dt,
            friction,
            ..
        } = self;
        let mut max_speed_squared = f32x4::ZERO;
        let mut sound = true;
        let mut obstacle_work = 0.0;
        // Lane by lane: a sum across lanes for each block takes longer than all that it sums up.
        let mut broken = [0u32; LANES];
        for block in self.blocks {
            let stencils = Stencils::at(&block.x, &grid.layout);
            let mut sums = gather::<Q, D>(grid, &stencils, block.count.min(LANES));
            if let Some(own) = own {
                let (count, stencils, sums) = (block.count.min(LANES), &stencils, &mut sums);
                if stencils.start[..count]
                    .iter()
                    .any(|&start| own.fields.near(start as usize))
                {
                    run_wide(GatherOwn {
                        own,
                        grid,
                        stencils,
                        count,
                        sums,
                    });
                }
            }
            let moved = move_block(block, &stencils, &sums, grid.layout, bounds, dt);
            max_speed_squared = moved.max_speed_squared.fast_max(max_speed_squared);
            material.deform(&mut block.state, &block.affine, dt, bounds.slow);
            let ratios = material.volume_ratios(&block.state);
            for i in 0..LANES {
                // False for NaN.
                let sound = ratios[i] > 0.0;
                broken[i] |= u32::from(!sound);
            }
            if moved.outside {
                sound &= keep_inside(block, bounds, reactions);
            }
            if obstacles.any() && sound && broken == [0; LANES] {
                obstacle_work += push_out(block, &stencils, obstacles, friction, reactions);
            }
        }
        Outcome {
            max_speed_squared: max_speed_squared.to_array().into_iter().fold(0.0, f32::max),
            sound: sound && broken == [0; LANES],
            obstacle_work,
        }
    }
}

/// Sums over the nodes of the first `count` particles of a block.
#[inline(always)]
pub fn gather<Q: Quad, const D: usize>(
    grid: View<'_, D>,
    stencils: &Stencils<D>,
    count: usize,
) -> Sums {
    let mut sums = Sums([[f32x4::ZERO; 4]; LANES]);
    // Nodes shifted by the offset of each row of a stencil; their equal lengths need one bounds check a particle.
    let length = grid.nodes.len() - grid.layout.stencil_row([2, 2]);
    let mut rows = [[&grid.nodes[..length]; 3]; 3];
    for a in 0..3 {
        for b in 0..3 {
            let offset = grid.layout.stencil_row([a, b]);
            rows[a][b] = &grid.nodes[offset..offset + length];
        }
    }
    for i in 0..count {
        let start = stencils.start[i] as usize - grid.first;
        sums.0[i] = sum_up::<Q, D>(stencils, i, |a, b| {
            let nodes = &rows[a][b][start..start + 4];
            Q::load(nodes.try_into().expect("four nodes"))
        });
    }
    sums
}

/// Replaces the sums of the particles of a block that touch slots.
struct GatherOwn<'a, 's, const D: usize> {
    own: OwnView<'a>,
    grid: View<'a, D>,
    stencils: &'s Stencils<D>,
    count: usize,
    sums: &'s mut Sums,
}

impl<const D: usize> Kernel for GatherOwn<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        let (own, layout) = (self.own, &self.grid.layout);
        let mut rows = [[[f32x4::ZERO; 4]; 3]; 3];
        let (mut previous, mut touches) = (usize::MAX, false);
        for i in 0..self.count {
            let start = self.stencils.start[i] as usize;
            if !own.fields.near(start) {
                continue;
            }
            // Neighbours in the order often have the same nodes. Behind each row is an empty one.
            if start != previous {
                (previous, touches) = (start, false);
                for_each_row::<D>(|a, b| {
                    let first = start + layout.stencil_row([a, b]);
                    let (row, has_own) = own.fields.row(self.grid, first, own.field);
                    rows[a][b][..3].copy_from_slice(&row);
                    touches |= has_own;
                });
            }
            if touches {
                self.sums.0[i] = sum_up::<Q, D>(self.stencils, i, |a, b| Q::load(&rows[a][b]));
            }
        }
    }
}

/// Sums over the nodes of one particle, row by row and then along the rows.
#[inline(always)]
fn sum_up<Q: Quad, const D: usize>(
    stencils: &Stencils<D>,
    i: usize,
    row: impl Fn(usize, usize) -> Q,
) -> [f32x4; 4] {
    let mut planes = [Q::zero(); 3];
    let mut moments = [Q::zero(); D];
    for a in 0..3 {
        if D == 3 {
            let rows = [row(a, 0), row(a, 1), row(a, 2)];
            let (sum, moment) = weighted(rows, &stencils.weights[1], i);
            let weight = Q::splat(stencils.weights[0][a][i]);
            planes[a] = sum;
            moments[1] = moment.mul_add(weight, moments[1]);
        } else {
            planes[a] = row(a, 0);
        }
    }
    let (value, moment) = weighted(planes, &stencils.weights[0], i);
    moments[0] = moment;
    // By index: copies of whole arrays would be stored and waited for.
    let last = &stencils.weights[D - 1];
    let along = Q::of_nodes([last[0][i], last[1][i], last[2][i], 0.0]);
    let value = value.mul(along);
    let moment_along = value.mul(Q::of_nodes([0.0, 1.0, 2.0, 0.0]));
    let first = moments[0].mul(along);
    let quads = if D == 3 {
        [value, first, moments[1].mul(along), moment_along]
    } else {
        [value, first, moment_along, Q::zero()]
    };
    Q::sums(quads)
}

/// Weighted sum of three for one lane, and that of each times its steps from the first.
#[inline(always)]
fn weighted<Q: Quad>(nodes: [Q; 3], weights: &[Lanes; 3], lane: usize) -> (Q, Q) {
    let end = nodes[2].mul(Q::splat(weights[2][lane]));
    let beyond = nodes[1].mul_add(Q::splat(weights[1][lane]), end);
    let sum = nodes[0].mul_add(Q::splat(weights[0][lane]), beyond);
    (sum, beyond.add(end))
}

/// Findings of `move_block`.
struct Moved {
    max_speed_squared: f32x4,
    /// Whether a particle has left the walls.
    outside: bool,
}

/// Sets velocity and affine matrix, and moves the particles.
#[inline(always)]
fn move_block<const D: usize, S: State>(
    block: &mut Block<D, S>,
    stencils: &Stencils<D>,
    sums: &Sums,
    layout: Layout<D>,
    bounds: &Bounds<D>,
    dt: f32,
) -> Moved {
    let (dt, per_cell) = (f32x4::splat(dt), f32x4::splat(4.0 / layout.dx()));
    let mut moved = Moved {
        max_speed_squared: f32x4::ZERO,
        outside: false,
    };
    let mut inside = f32x4::ZERO.simd_eq(f32x4::ZERO);
    // Four particles at a time, from one vector a particle to one vector a component.
    for four in (0..LANES).step_by(4) {
        let v = transposed(|lane| sums.value(lane), four);
        let mut speed_squared = f32x4::ZERO;
        for row in 0..D {
            let x = load(&block.x[row], four) + v[row] * dt;
            store(&mut block.v[row], four, v[row]);
            store(&mut block.x[row], four, x);
            speed_squared += v[row] * v[row];
            // False for NaN.
            inside &= x.simd_ge(f32x4::splat(bounds.walls.lower[row]));
            inside &= x.simd_le(f32x4::splat(bounds.walls.upper[row]));
        }
        // Of two numbers of which one is NaN, the second.
        moved.max_speed_squared = speed_squared.fast_max(moved.max_speed_squared);
        for axis in 0..D {
            let moments = transposed(|lane| sums.moment(axis, lane), four);
            let offset = load(&stencils.offset[axis], four);
            for row in 0..D {
                store(
                    &mut block.affine[row][axis],
                    four,
                    (moments[row] - v[row] * offset) * per_cell,
                );
            }
        }
    }
    moved.outside = !inside.all();
    moved
}

#[inline(always)]
fn transposed(values: impl Fn(usize) -> f32x4, from: usize) -> [f32x4; 4] {
    f32x4::transpose(std::array::from_fn(|k| values(from + k)))
}

#[inline(always)]
fn load(lanes: &Lanes, from: usize) -> f32x4 {
    f32x4::from(std::array::from_fn::<f32, 4, _>(|k| lanes[from + k]))
}

#[inline(always)]
fn store(lanes: &mut Lanes, from: usize, values: f32x4) {
    lanes[from..from + 4].copy_from_slice(&values.to_array());
}

/// Puts particles back between the walls; false if one is too far past them.
#[cold]
fn keep_inside<const D: usize, S: State>(
    block: &mut Block<D, S>,
    bounds: &Bounds<D>,
    reactions: &mut Reactions<D>,
) -> bool {
    let mut sound = true;
    for lane in 0..block.count {
        let mut particle = block.get(lane, Activity::Awake);
        if !bounds.walls.contains(&particle.x) {
            let before = particle.v;
            sound &= bounds.put_back(&mut particle.x, &mut particle.v);
            reactions.hold(&particle.x, particle.mass, &(particle.v - before));
            block.set(lane, &particle);
        }
    }
    sound
}

/// Moves particles that got into an obstacle back to its surface, and returns the work of moving obstacles [J].
fn push_out<const D: usize, S: State>(
    block: &mut Block<D, S>,
    stencils: &Stencils<D>,
    obstacles: &Obstacles<D>,
    friction: f32,
    reactions: &mut Reactions<D>,
) -> f64 {
    let mut work = 0.0;
    for lane in 0..block.count {
        let x = Vector::from_fn(|axis, _| block.x[axis][lane]);
        // Few of those near an obstacle are inside; the others are not touched.
        if obstacles.near(stencils.start[lane] as usize) && obstacles.contains(&x) {
            let mut particle = block.get(lane, Activity::Awake);
            let mass = particle.mass;
            let pushed = |obstacle: usize, x: &Vector<D>, change: &Vector<D>| {
                reactions.push(obstacle, x, &(change * mass));
            };
            let by_mass = obstacles.push_out(&mut particle.x, &mut particle.v, friction, pushed);
            work += by_mass * f64::from(mass);
            block.set(lane, &particle);
        }
    }
    work
}
