//! Particles to grid (Hu et al. 2018, eq. 16-19; APIC by Jiang et al. 2015).
//!
//! Node i receives w_ip (m v + A (x_i - x_p)) with A = m C - dt V_0 (4 / dx^2) tau, and w_ip m.

use wide::f32x4;

use crate::force::FrameForce;
use crate::grid::{CHUNK, FieldWindow, Layout, Stencils, Window};
use crate::linalg::{Kernel, LANES, Lanes, Quad, run_wide, shear_index};
use crate::material::{Constitutive, State};
use crate::particles::Block;

/// Inputs of a substep besides the state.
#[derive(Clone, Copy)]
pub struct P2gStep<'a, const D: usize> {
    /// Length of the substep [s].
    pub dt: f32,
    pub force: FrameForce<'a, D>,
}

/// Slots that a group writes to, and its field.
pub struct Own<'a, 'f> {
    pub fields: &'a mut FieldWindow<'f>,
    pub field: u16,
}

/// Adds blocks of one group to the grid, where their particles rub against walls with this friction, and to its slots.
pub fn p2g<const D: usize, M: Constitutive<D>>(
    blocks: &[Block<D, M::State>],
    material: &M,
    friction: f32,
    window: &mut Window<'_, D>,
    own: Option<Own<'_, '_>>,
    step: P2gStep<'_, D>,
) {
    let (layout, first) = (window.layout, window.first);
    let grid = GridNodes {
        nodes: &mut *window.nodes,
        dirty: &mut *window.dirty,
    };
    let mut own = own;
    if let Some(own) = &mut own {
        let sink = OwnNodes { grid, first, own };
        run_wide(Scatter {
            blocks,
            material,
            layout,
            step,
            first,
            sink,
        });
    } else {
        run_wide(Scatter {
            blocks,
            material,
            layout,
            step,
            first,
            sink: grid,
        });
    }
    if let Some(own) = &mut own
        && !own.fields.volume.is_empty()
    {
        scatter_volume(blocks, &layout, own);
    }
    if !window.friction_mass.is_empty() {
        scatter_friction(blocks, friction, window, own);
    }
}

/// The blocks of one group in one slab.
struct Scatter<'a, const D: usize, M: Constitutive<D>, S> {
    blocks: &'a [Block<D, M::State>],
    material: &'a M,
    layout: Layout<D>,
    step: P2gStep<'a, D>,
    /// Memory index of the first node.
    first: usize,
    sink: S,
}

/// Contribution of a particle to its nodes, in lanes of momentum and mass.
struct Shares<const D: usize> {
    /// The lowest node at weight one.
    lowest: [[f32; 4]; LANES],
    /// Difference of the contributions to neighbouring nodes along each axis.
    per_step: [[[f32; 4]; LANES]; D],
}

/// Nodes that sums of cells are added to.
trait Sink<const D: usize> {
    fn take<Q: Quad>(&mut self, sums: &mut CellSums<Q, D>, layout: &Layout<D>);
}

/// The nodes of the grid alone.
struct GridNodes<'a> {
    nodes: &'a mut [f32x4],
    /// Marks of the chunks that are written to.
    dirty: &'a mut [bool],
}

impl<const D: usize> Sink<D> for GridNodes<'_> {
    #[inline(always)]
    fn take<Q: Quad>(&mut self, sums: &mut CellSums<Q, D>, layout: &Layout<D>) {
        sums.flush(self.nodes, self.dirty, layout);
    }
}

/// The nodes of the grid, and the slots of one field where there are some.
struct OwnNodes<'a, 'o, 'w, 'f> {
    grid: GridNodes<'a>,
    /// Memory index of the first node.
    first: usize,
    own: &'o mut Own<'w, 'f>,
}

impl<const D: usize> Sink<D> for OwnNodes<'_, '_, '_, '_> {
    #[inline(always)]
    fn take<Q: Quad>(&mut self, sums: &mut CellSums<Q, D>, layout: &Layout<D>) {
        if sums.start == usize::MAX || !self.own.fields.near(self.first + sums.start) {
            return self.grid.take(sums, layout);
        }
        let rows = sums.taken();
        self.add(sums.start, &rows, layout);
    }
}

impl OwnNodes<'_, '_, '_, '_> {
    #[inline(never)]
    fn add<const D: usize>(
        &mut self,
        start: usize,
        rows: &[[[f32x4; 4]; 3]; 3],
        layout: &Layout<D>,
    ) {
        for_each_row::<D>(|a, b| {
            let begin = start + layout.stencil_row([a, b]);
            let places = self.own.fields.places(self.first + begin, self.own.field);
            for step in 0..3 {
                if let Some(place) = places[step] {
                    self.own.fields.nodes[place] += rows[a][b][step];
                } else {
                    let node = begin + step;
                    self.grid.nodes[node] += rows[a][b][step];
                    self.grid.dirty[node / CHUNK] = true;
                }
            }
        });
    }
}

impl<const D: usize, M: Constitutive<D>, S: Sink<D>> Kernel for Scatter<'_, D, M, S> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(mut self) {
        let mut sums = CellSums::<Q, D>::new();
        for block in self.blocks {
            let stencils = Stencils::at(&block.x, &self.layout);
            let shares = self.shares(block, &stencils);
            for i in 0..block.count.min(LANES) {
                let start = stencils.start[i] as usize - self.first;
                if start != sums.start {
                    self.sink.take(&mut sums, &self.layout);
                    sums.start = start;
                }
                sums.add(&stencils, &shares, i);
            }
        }
        self.sink.take(&mut sums, &self.layout);
    }
}

/// Contributions of consecutive particles with the same stencil to its nodes.
struct CellSums<Q: Quad, const D: usize> {
    /// Lowest node of the stencil; none before the first particle.
    start: usize,
    /// The rows of the stencil, by their steps along the first axes.
    rows: [[Q; 3]; 3],
}

impl<Q: Quad, const D: usize> CellSums<Q, D> {
    #[inline(always)]
    fn new() -> Self {
        Self {
            start: usize::MAX,
            rows: [[Q::zero(); 3]; 3],
        }
    }

    #[inline(always)]
    fn add(&mut self, stencils: &Stencils<D>, shares: &Shares<D>, i: usize) {
        // By index: copies of whole arrays would be stored and waited for.
        let last = &stencils.weights[D - 1];
        let last = Q::of_nodes([last[0][i], last[1][i], last[2][i], 0.0]);
        let per_step = |axis: usize| Q::repeat(f32x4::from(shares.per_step[axis][i]));
        let steps = Q::of_nodes([0.0, 1.0, 2.0, 0.0]);
        let lowest = Q::repeat(f32x4::from(shares.lowest[i]));
        // Along the row all is weighted at once.
        let mut value = per_step(D - 1).mul_add(steps, lowest).mul(last);
        let along_first = per_step(0).mul(last);
        let along_second = per_step(1 % D).mul(last);
        for a in 0..3 {
            let weight = Q::splat(stencils.weights[0][a][i]);
            if D == 3 {
                let (mut value, step) = (value.mul(weight), along_second.mul(weight));
                for b in 0..3 {
                    let weight = Q::splat(stencils.weights[1][b][i]);
                    self.rows[a][b] = value.mul_add(weight, self.rows[a][b]);
                    value = value.add(step);
                }
            } else {
                self.rows[a][0] = value.mul_add(weight, self.rows[a][0]);
            }
            value = value.add(along_first);
        }
    }

    /// The sums of each node, which start anew. By index: closures would not be compiled for wide vectors.
    #[inline(always)]
    fn taken(&mut self) -> [[[f32x4; 4]; 3]; 3] {
        let mut rows = [[[f32x4::ZERO; 4]; 3]; 3];
        for a in 0..3 {
            for b in 0..if D == 3 { 3 } else { 1 } {
                rows[a][b] = self.rows[a][b].store();
                self.rows[a][b] = Q::zero();
            }
        }
        rows
    }

    /// Adds the sums to the nodes. Node by node: a wide load would have to wait for the narrower or shifted stores of the
    /// neighbouring cell.
    #[inline(always)]
    fn flush(&mut self, nodes: &mut [f32x4], dirty: &mut [bool], layout: &Layout<D>) {
        if self.start == usize::MAX {
            return;
        }
        for a in 0..3 {
            for b in 0..if D == 3 { 3 } else { 1 } {
                let begin = self.start + layout.stencil_row([a, b]);
                let row: &mut [f32x4; 3] = (&mut nodes[begin..begin + 3])
                    .try_into()
                    .expect("three nodes");
                let sums = self.rows[a][b].store();
                for step in 0..3 {
                    row[step] += sums[step];
                }
                dirty[begin / CHUNK] = true;
                dirty[(begin + 2) / CHUNK] = true;
                self.rows[a][b] = Q::zero();
            }
        }
    }
}

impl<const D: usize, M: Constitutive<D>, S> Scatter<'_, D, M, S> {
    #[inline(always)]
    fn shares(&self, block: &Block<D, M::State>, stencils: &Stencils<D>) -> Shares<D> {
        let dx = self.layout.dx();
        let stress_factor = -self.step.dt * 4.0 / dx;
        let stress = self.material.kirchhoff_stress(&block.state);
        let v = self.pushed(block);
        let mut shares = Shares {
            lowest: [[0.0; 4]; LANES],
            per_step: [[[0.0; 4]; LANES]; D],
        };
        for i in 0..LANES {
            let mass = block.mass[i];
            let (inertia, tension) = (mass * dx, stress_factor * block.volume[i]);
            let mut lowest = [0.0; 4];
            for row in 0..D {
                lowest[row] = mass * v[row][i];
            }
            lowest[3] = mass;
            for axis in 0..D {
                let mut step = [0.0; 4];
                for row in 0..D {
                    let tau = if row == axis {
                        stress.diagonal[row][i]
                    } else {
                        stress.shear[shear_index::<D>(row, axis)][i]
                    };
                    step[row] = block.affine[row][axis][i] * inertia + tau * tension;
                    lowest[row] -= step[row] * stencils.offset[axis][i];
                }
                shares.per_step[axis][i] = step;
            }
            shares.lowest[i] = lowest;
        }
        shares
    }

    /// Velocities after the push of the external force.
    #[inline(always)]
    fn pushed(&self, block: &Block<D, M::State>) -> [Lanes; D] {
        let mut v = block.v;
        match self.step.force {
            FrameForce::None => {}
            FrameForce::Uniform(a) => {
                for axis in 0..D {
                    let gain = self.step.dt * a[axis];
                    v[axis].iter_mut().for_each(|v| *v += gain);
                }
            }
            FrameForce::PerParticle(all) => {
                let (rows, _) = all.as_chunks::<D>();
                let last = rows.len() - 1;
                let mut a = [[0.0; LANES]; D];
                // Lanes without a particle read the last row: without branches all rows are on their way at once.
                for i in 0..LANES {
                    let row = &rows[(block.id[i] as usize).min(last)];
                    for axis in 0..D {
                        a[axis][i] = row[axis];
                    }
                }
                for axis in 0..D {
                    for (v, a) in v[axis].iter_mut().zip(a[axis]) {
                        *v += self.step.dt * a;
                    }
                }
            }
        }
        v
    }
}

/// Adds a particle's share to three nodes.
#[inline(always)]
pub fn scatter_row(
    nodes: &mut [f32x4],
    begin: usize,
    lowest: f32x4,
    along: f32x4,
    weight: f32,
    last: &[f32x4; 3],
) {
    let row: &mut [f32x4; 3] = (&mut nodes[begin..begin + 3])
        .try_into()
        .expect("three nodes");
    let weight = f32x4::splat(weight);
    let (lowest, along) = (lowest * weight, along * weight);
    let middle = lowest + along;
    row[0] += lowest * last[0];
    row[1] += middle * last[1];
    row[2] += (middle + along) * last[2];
}

/// Wall friction as a mass-weighted quantity, where materials differ in it.
fn scatter_friction<const D: usize, S: State>(
    blocks: &[Block<D, S>],
    friction: f32,
    window: &mut Window<'_, D>,
    mut own: Option<Own<'_, '_>>,
) {
    if friction <= 0.0 {
        return;
    }
    let (layout, first) = (window.layout, window.first);
    let on_grid = &mut *window.friction_mass;
    let share = |block: &Block<D, S>, i: usize, of_row: f32| of_row * block.mass[i] * friction;
    match &mut own {
        None => for_each_row_of(blocks, &layout, |block, i, begin, of_row, along| {
            let share = share(block, i, of_row);
            (0..3).for_each(|step| on_grid[begin + step - first] += share * along[step]);
        }),
        Some(own) => for_each_row_of(blocks, &layout, |block, i, begin, of_row, along| {
            let share = share(block, i, of_row);
            let places = own.fields.places(begin, own.field);
            for step in 0..3 {
                let sum = match places[step] {
                    Some(place) => &mut own.fields.friction_mass[place],
                    None => &mut on_grid[begin + step - first],
                };
                *sum += share * along[step];
            }
        }),
    }
}

/// Rest volume of what shares a field with materials of other densities.
fn scatter_volume<const D: usize, S: State>(
    blocks: &[Block<D, S>],
    layout: &Layout<D>,
    own: &mut Own<'_, '_>,
) {
    for_each_row_of(blocks, layout, |block, i, begin, of_row, along| {
        let places = own.fields.places(begin, own.field);
        for (place, along) in places.iter().zip(along) {
            if let Some(place) = place {
                own.fields.volume[*place] += of_row * block.volume[i] * along;
            }
        }
    });
}

/// Calls back with each particle, the first node of each row of its stencil, the weight of the row and those along it.
#[inline(always)]
fn for_each_row_of<const D: usize, S: State>(
    blocks: &[Block<D, S>],
    layout: &Layout<D>,
    mut visit: impl FnMut(&Block<D, S>, usize, usize, f32, [f32; 3]),
) {
    for block in blocks {
        let stencils = Stencils::at(&block.x, layout);
        for i in 0..block.count {
            let start = stencils.start[i] as usize;
            let along = std::array::from_fn(|step| stencils.weights[D - 1][step][i]);
            for_each_row::<D>(|a, b| {
                let across = if D == 3 {
                    stencils.weights[1][b][i]
                } else {
                    1.0
                };
                let of_row = stencils.weights[0][a][i] * across;
                visit(block, i, start + layout.stencil_row([a, b]), of_row, along);
            });
        }
    }
}

/// Calls back for each row of nodes of a stencil.
#[inline(always)]
pub fn for_each_row<const D: usize>(mut visit: impl FnMut(usize, usize)) {
    for a in 0..3 {
        for b in 0..if D == 3 { 3 } else { 1 } {
            visit(a, b);
        }
    }
}
