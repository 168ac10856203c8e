//! Grid to particles: velocity, affine matrix, deformation and position.
//!
//! v = sum_i w_ip v_i and C = (4 / dx^2) sum_i w_ip v_i (x_i - x_p)^T. Where velocities before forces are kept,
//! v = sum_i w_ip v_i + k (v_p - sum_i w_ip v_i,old) with k = exp(-rate dt): a blend of APIC and FLIP (Brackbill and Ruppel
//! 1986) by time. The particle moves by the first part.

use wide::f32x4;

use crate::boundary::{Bounds, Obstacles, Reactions};
use crate::grid::{FieldView, Layout, RowPlace, Stencils, View};
use crate::linalg::{Kernel, LANES, Lanes, Quad, Vector, run_wide};
use crate::material::{Constitutive, State};
use crate::particles::{Activity, Block};

/// Result of a substep for some particles and nodes.
#[derive(Debug, Clone, Copy)]
pub struct Outcome {
    pub max_speed_squared: f32,
    /// All particles are finite, inside and of positive volume.
    pub sound: bool,
    /// Work of moving obstacles on them [J].
    pub obstacle_work: f64,
    /// How far moving obstacles have moved a particle at most, besides its velocity [m].
    pub longest_push: f32,
}

impl Outcome {
    pub const NOTHING: Self = Self {
        max_speed_squared: 0.0,
        sound: true,
        obstacle_work: 0.0,
        longest_push: 0.0,
    };

    pub fn and(self, other: Self) -> Self {
        Self {
            max_speed_squared: self.max_speed_squared.max(other.max_speed_squared),
            sound: self.sound && other.sound,
            obstacle_work: self.obstacle_work + other.obstacle_work,
            longest_push: self.longest_push.max(other.longest_push),
        }
    }
}

/// The nodes that a group reads: those of the grid, and its own slots.
#[derive(Clone, Copy)]
pub struct Nodes<'a, const D: usize> {
    pub grid: View<'a, D>,
    pub own: Option<OwnView<'a, D>>,
}

/// Slots that a group reads, and its field.
#[derive(Clone, Copy)]
pub struct OwnView<'a, const D: usize> {
    pub fields: FieldView<'a, D>,
    pub field: u16,
}

/// Solids that particles are kept out of.
#[derive(Clone, Copy)]
pub struct Solids<'a, const D: usize> {
    pub bounds: &'a Bounds<D>,
    pub obstacles: &'a Obstacles<D>,
    /// Whether obstacles or the order of particles are new, so that blocks near obstacles have to be found.
    pub are_new: bool,
}

/// Updates blocks of one group from the nodes' velocities, over a substep of `dt` [s].
pub fn g2p<const D: usize, M: Constitutive<D>>(
    blocks: &mut [Block<D, M::State>],
    material: &M,
    friction: f32,
    nodes: Nodes<'_, D>,
    solids: Solids<'_, D>,
    reactions: &mut Reactions<D>,
    time: Time,
) -> Outcome {
    let Nodes { grid, own } = nodes;
    let blocks = GatherBlocks::<D, M, false> {
        blocks,
        material,
        friction,
        grid,
        own,
        solids,
        reactions,
        time,
    };
    if grid.old.is_empty() {
        run_wide(blocks)
    } else {
        run_wide(blocks.keeping())
    }
}

/// Length of a substep.
#[derive(Clone, Copy)]
pub struct Time {
    /// [s].
    pub dt: f32,
    /// Share of its deviation from the grid that a particle keeps over it [-], where velocities before forces are kept.
    pub kept: f32,
}

/// Some blocks of one group; `KEEPS` whether their particles keep deviations.
struct GatherBlocks<'a, const D: usize, M: Constitutive<D>, const KEEPS: bool> {
    blocks: &'a mut [Block<D, M::State>],
    material: &'a M,
    friction: f32,
    grid: View<'a, D>,
    own: Option<OwnView<'a, D>>,
    solids: Solids<'a, D>,
    reactions: &'a mut Reactions<D>,
    time: Time,
}

impl<'a, const D: usize, M: Constitutive<D>> GatherBlocks<'a, D, M, false> {
    fn keeping(self) -> GatherBlocks<'a, D, M, true> {
        let Self {
            blocks,
            material,
            friction,
            grid,
            own,
            solids,
            reactions,
            time,
        } = self;
        GatherBlocks {
            blocks,
            material,
            friction,
            grid,
            own,
            solids,
            reactions,
            time,
        }
    }
}

/// Weighted sums over the nodes of each particle, each as velocity and mass; in 2D as velocity and that before forces where
/// it is kept.
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

impl<const D: usize, M: Constitutive<D>, const KEEPS: bool> Kernel
    for GatherBlocks<'_, D, M, KEEPS>
{
    type Output = Outcome;

    #[inline(always)]
    fn run<Q: Quad>(self) -> Outcome {
        let Self {
            material,
            grid,
            own,
            solids,
            reactions,
            time,
            friction,
            ..
        } = self;
        let Solids {
            bounds, obstacles, ..
        } = solids;
        let finds_solids = solids.are_new && obstacles.any();
        let mut max_speed_squared = f32x4::ZERO;
        let mut sound = true;
        let (mut obstacle_work, mut longest_push) = (0.0, 0.0f32);
        // Lane by lane: a sum across lanes for each block takes longer than all that it sums up.
        let mut broken = [0u32; LANES];
        for block in self.blocks {
            let stencils = Stencils::at(&block.x, &grid.layout);
            let count = block.count.min(LANES);
            if finds_solids {
                let mut starts = stencils.start[..count].iter();
                block.near_solid = starts.any(|start| obstacles.near_until_sort(*start as usize));
            }
            let own = own.filter(|own| {
                let mut starts = stencils.start[..count].iter();
                starts.any(|&start| own.fields.near(start as usize))
            });
            // Blocks that touch slots are gathered by their own.
            let on_grid = if own.is_some() { 0 } else { count };
            let mut sums = gather::<Q, D, KEEPS>(grid, &stencils, on_grid);
            let mut old = [f32x4::ZERO; LANES];
            if KEEPS && D == 3 {
                old = gather_old::<Q, D>(grid, &stencils, on_grid);
            }
            if let Some(own) = own {
                run_wide(GatherOwn {
                    own,
                    grid,
                    stencils: &stencils,
                    count,
                    sums: &mut sums,
                    old: (KEEPS && D == 3).then_some(&mut old),
                });
            }
            let deviating = Deviating {
                old: &old,
                kept: time.kept,
            };
            let moved = move_block::<_, _, KEEPS>(
                block,
                &stencils,
                &sums,
                deviating,
                grid.layout,
                bounds,
                time.dt,
            );
            max_speed_squared = moved.max_speed_squared.fast_max(max_speed_squared);
            material.deform(&mut block.state, &block.affine, time.dt, bounds.slow);
            let ratios = material.volume_ratios(&block.state);
            for i in 0..LANES {
                // False for NaN.
                let sound = ratios[i] > 0.0;
                broken[i] |= u32::from(!sound);
            }
            if moved.outside {
                sound &= keep_inside(block, bounds, reactions);
            }
            if block.near_solid && obstacles.any() && sound && broken == [0; LANES] {
                let inside = obstacles.may_contain(&block.x);
                if inside != [false; LANES] {
                    let places = (&stencils, &inside);
                    let (work, push) = push_out(block, places, obstacles, friction, reactions);
                    obstacle_work += work;
                    longest_push = longest_push.max(push);
                }
            }
        }
        Outcome {
            max_speed_squared: max_speed_squared.to_array().into_iter().fold(0.0, f32::max),
            sound: sound && broken == [0; LANES],
            obstacle_work,
            longest_push,
        }
    }
}

/// Sums over the nodes of the first `count` particles of a block.
#[inline(always)]
pub fn gather<Q: Quad, const D: usize, const KEEPS: bool>(
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
    let mut old = [[&[][..]; 3]; 3];
    if KEEPS && D == 2 {
        for a in 0..3 {
            let offset = grid.layout.stencil_row([a, 0]);
            old[a][0] = &grid.old[offset..offset + length];
        }
    }
    for i in 0..count {
        let start = stencils.start[i] as usize - grid.first;
        let row = |a: usize, b: usize| load_row::<Q, D>(rows[a][b], old[a][b], start).0;
        sums.0[i] = sum_up::<Q, D>(stencils, i, row);
    }
    sums
}

/// Weighted sums of the velocities before forces of the nodes of the first `count` particles of a block in 3D.
#[inline(always)]
fn gather_old<Q: Quad, const D: usize>(
    grid: View<'_, D>,
    stencils: &Stencils<D>,
    count: usize,
) -> [f32x4; LANES] {
    let mut sums = [f32x4::ZERO; LANES];
    let length = grid.old.len() - 4 * grid.layout.stencil_row([2, 2]);
    let mut rows = [[&grid.old[..length]; 3]; 3];
    for a in 0..3 {
        for b in 0..3 {
            let offset = 4 * grid.layout.stencil_row([a, b]);
            rows[a][b] = &grid.old[offset..offset + length];
        }
    }
    for four in (0..count).step_by(4) {
        let mut quads = [Q::zero(); 4];
        for k in 0..4 {
            // Lanes without a particle read what the last one does.
            let i = (four + k).min(count - 1);
            let start = 4 * (stencils.start[i] as usize - grid.first);
            quads[k] = sum_up_old(stencils, i, |a, b| {
                let numbers = &rows[a][b][start..start + 16];
                Q::of_numbers(numbers.try_into().expect("sixteen numbers"))
            });
        }
        sums[four..four + 4].copy_from_slice(&Q::sums(quads));
    }
    sums
}

/// Finds the sums of the first `count` particles of a block, some of which touch slots.
struct GatherOwn<'a, 's, const D: usize> {
    own: OwnView<'a, D>,
    grid: View<'a, D>,
    stencils: &'s Stencils<D>,
    count: usize,
    sums: &'s mut Sums,
    /// Those of velocities before forces in 3D, where they are kept.
    old: Option<&'s mut [f32x4; LANES]>,
}

impl<const D: usize> Kernel for GatherOwn<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(mut self) {
        let (own, layout) = (self.own, &self.grid.layout);
        let mut rows = [[Q::zero(); 3]; 3];
        let mut old_rows = [[Q::zero(); 3]; 3];
        let mut previous = usize::MAX;
        for i in 0..self.count {
            let start = self.stencils.start[i] as usize;
            // Neighbours in the order often have the same nodes.
            if start != previous {
                previous = start;
                let near = own.fields.near(start);
                for a in 0..3 {
                    for b in 0..if D == 3 { 3 } else { 1 } {
                        let first = start + layout.stencil_row([a, b]);
                        let on_grid = first - self.grid.first;
                        (rows[a][b], old_rows[a][b]) = if near {
                            self.row(first)
                        } else {
                            load_row::<Q, D>(self.grid.nodes, self.grid.old, on_grid)
                        };
                    }
                }
            }
            self.sums.0[i] = sum_up::<Q, D>(self.stencils, i, |a, b| rows[a][b]);
            if let Some(old) = &mut self.old {
                let quad = sum_up_old(self.stencils, i, |a, b| old_rows[a][b]);
                [old[i], ..] = Q::sums([quad, Q::zero(), Q::zero(), Q::zero()]);
            }
        }
    }
}

impl<const D: usize> GatherOwn<'_, '_, D> {
    /// Three nodes side by side, some of which may be the field's own, with an empty one behind; and in 3D what they keep of
    /// before forces, which in 2D is part of them.
    #[inline(always)]
    fn row<Q: Quad>(&self, first: usize) -> (Q, Q) {
        let (fields, grid) = (self.own.fields, self.grid);
        let on_grid = first - grid.first;
        let place = fields.row(first, self.own.field);
        let (nodes, old) = match place {
            RowPlace::Grid => load_row::<Q, D>(grid.nodes, grid.old, on_grid),
            RowPlace::Slot(node) if node + 4 <= fields.nodes.len() => {
                load_row::<Q, D>(fields.nodes, fields.old, node)
            }
            place => {
                let numbers = Layout::<D>::OLD;
                let (mut row, mut row_old) = ([f32x4::ZERO; 4], [0.0; 16]);
                for (step, place) in place.each().into_iter().enumerate() {
                    let (place, nodes, old) = match place {
                        Some(place) => (place, fields.nodes, fields.old),
                        None => (on_grid + step, grid.nodes, grid.old),
                    };
                    row[step] = nodes[place];
                    if !old.is_empty() {
                        row_old[step * numbers..(step + 1) * numbers]
                            .copy_from_slice(&old[place * numbers..(place + 1) * numbers]);
                    }
                }
                let old = if grid.old.is_empty() {
                    &[][..]
                } else {
                    &row_old
                };
                load_row::<Q, D>(&row, old, 0)
            }
        };
        (
            nodes.with_last_node(f32x4::ZERO),
            old.with_last_node(f32x4::ZERO),
        )
    }
}

/// Four nodes from one on; and in 3D what they keep of before forces, which in 2D is part of them.
#[inline(always)]
fn load_row<Q: Quad, const D: usize>(nodes: &[f32x4], old: &[f32], first: usize) -> (Q, Q) {
    let four = (&nodes[first..first + 4]).try_into().expect("four nodes");
    let nodes = Q::load(four);
    if old.is_empty() {
        (nodes, Q::zero())
    } else if D == 2 {
        let old = (&old[first..first + 4]).try_into().expect("four numbers");
        (nodes.with_last_numbers(old), Q::zero())
    } else {
        let old = &old[4 * first..4 * first + 16];
        (
            nodes,
            Q::of_numbers(old.try_into().expect("sixteen numbers")),
        )
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

/// The same row by row alone, in 3D without moments.
#[inline(always)]
fn sum_up_old<Q: Quad, const D: usize>(
    stencils: &Stencils<D>,
    i: usize,
    row: impl Fn(usize, usize) -> Q,
) -> Q {
    let mut sum = Q::zero();
    for a in 0..3 {
        let mut plane = Q::zero();
        for b in 0..3 {
            plane = row(a, b).mul_add(Q::splat(stencils.weights[1 % D][b][i]), plane);
        }
        sum = plane.mul_add(Q::splat(stencils.weights[0][a][i]), sum);
    }
    let last = &stencils.weights[D - 1];
    let along = Q::of_nodes([last[0][i], last[1][i], last[2][i], 0.0]);
    sum.mul(along)
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

/// Deviations of particles from the grid's velocity before forces.
#[derive(Clone, Copy)]
struct Deviating<'a> {
    /// That velocity in 3D; in 2D it is part of the sums.
    old: &'a [f32x4; LANES],
    /// Share that is kept [-].
    kept: f32,
}

/// Sets velocity and affine matrix, and moves the particles by the grid's velocity.
#[inline(always)]
fn move_block<const D: usize, S: State, const KEEPS: bool>(
    block: &mut Block<D, S>,
    stencils: &Stencils<D>,
    sums: &Sums,
    deviating: Deviating<'_>,
    layout: Layout<D>,
    bounds: &Bounds<D>,
    dt: f32,
) -> Moved {
    let (dt, per_cell) = (f32x4::splat(dt), f32x4::splat(4.0 / layout.dx()));
    let kept = f32x4::splat(deviating.kept);
    let mut moved = Moved {
        max_speed_squared: f32x4::ZERO,
        outside: false,
    };
    let mut inside = f32x4::ZERO.simd_eq(f32x4::ZERO);
    // Four particles at a time, from one vector a particle to one vector a component.
    for four in (0..LANES).step_by(4) {
        let v = transposed(|lane| sums.value(lane), four);
        let before = if KEEPS && D == 3 {
            transposed(|lane| deviating.old[lane], four)
        } else {
            [v[2], v[3], v[2], v[3]]
        };
        let mut speed_squared = f32x4::ZERO;
        for row in 0..D {
            let x = load(&block.x[row], four) + v[row] * dt;
            let own = if KEEPS {
                v[row] + (load(&block.v[row], four) - before[row]) * kept
            } else {
                v[row]
            };
            store(&mut block.v[row], four, own);
            store(&mut block.x[row], four, x);
            speed_squared += own * own;
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

/// Moves particles that got into an obstacle, all among those that may be `inside`, back to its surface. Returns the work of moving
/// obstacles [J], and how far they moved one of them at most [m].
fn push_out<const D: usize, S: State>(
    block: &mut Block<D, S>,
    (stencils, inside): (&Stencils<D>, &[bool; LANES]),
    obstacles: &Obstacles<D>,
    friction: f32,
    reactions: &mut Reactions<D>,
) -> (f64, f32) {
    let (mut work, mut longest_push) = (0.0, 0.0f32);
    for lane in 0..block.count {
        let x = Vector::from_fn(|axis, _| block.x[axis][lane]);
        // Few of those near an obstacle are inside; the others are not touched.
        if inside[lane]
            && obstacles.near_stencil(stencils.start[lane] as usize)
            && obstacles.contains(&x)
        {
            let mut particle = block.get(lane, Activity::Awake);
            let mass = particle.mass;
            let pushed = |obstacle: usize, x: &Vector<D>, change: &Vector<D>| {
                reactions.push(obstacle, x, &(change * mass));
            };
            let (x, v) = (&mut particle.x, &mut particle.v);
            let (by_mass, moved) = obstacles.push_out(x, v, friction, pushed);
            work += by_mass * f64::from(mass);
            longest_push = longest_push.max(moved);
            block.set(lane, &particle);
        }
    }
    (work, longest_push)
}
