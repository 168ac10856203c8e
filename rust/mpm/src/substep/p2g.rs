//! Particles to grid (Hu et al. 2018, eq. 16-19; APIC by Jiang et al. 2015).
//!
//! Node i receives w_ip (m v + A (x_i - x_p)) with A = m C - dt V_0 (4 / dx^2) tau, and w_ip m. Where velocities before
//! forces are kept, it also receives the same without tau.

use wide::f32x4;

use crate::force::FrameForce;
use crate::grid::{CHUNK, FieldWindow, Layout, RowPlace, Stencils, Window};
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
pub struct Own<'a, 'f, const D: usize> {
    pub fields: &'a mut FieldWindow<'f, D>,
    pub field: u16,
}

/// Adds blocks of one group to the grid, where their particles rub against walls with this friction, and to its slots.
pub fn p2g<const D: usize, M: Constitutive<D>>(
    blocks: &[Block<D, M::State>],
    material: &M,
    friction: f32,
    window: &mut Window<'_, D>,
    own: Option<Own<'_, '_, D>>,
    step: P2gStep<'_, D>,
) {
    let mut own = own;
    if window.old.is_empty() {
        scatter::<D, M, false>(blocks, material, window, own.as_mut(), step);
    } else {
        scatter::<D, M, true>(blocks, material, window, own.as_mut(), step);
    }
    if let Some(own) = &mut own
        && !own.fields.volume.is_empty()
    {
        scatter_volume(blocks, &window.layout, own);
    }
    // That of a field with one body is known: see `Meeting::set_friction`.
    if !M::HAS_OWN_FIELD && !window.friction_mass.is_empty() {
        scatter_friction(blocks, friction, window, own);
    }
}

/// `KEEPS` whether the momentum before forces is summed up, too.
fn scatter<const D: usize, M: Constitutive<D>, const KEEPS: bool>(
    blocks: &[Block<D, M::State>],
    material: &M,
    window: &mut Window<'_, D>,
    own: Option<&mut Own<'_, '_, D>>,
    step: P2gStep<'_, D>,
) {
    let (layout, first) = (window.layout, window.first);
    let grid = GridNodes {
        nodes: &mut *window.nodes,
        old: &mut *window.old,
        dirty: &mut *window.dirty,
    };
    if let Some(own) = own {
        let sink = OwnNodes { grid, first, own };
        run_wide(Scatter::<_, _, _, KEEPS> {
            blocks,
            material,
            layout,
            step,
            first,
            sink,
        });
    } else {
        run_wide(Scatter::<_, _, _, KEEPS> {
            blocks,
            material,
            layout,
            step,
            first,
            sink: grid,
        });
    }
}

/// The blocks of one group in one slab.
struct Scatter<'a, const D: usize, M: Constitutive<D>, S, const KEEPS: bool> {
    blocks: &'a [Block<D, M::State>],
    material: &'a M,
    layout: Layout<D>,
    step: P2gStep<'a, D>,
    /// Memory index of the first node.
    first: usize,
    sink: S,
}

/// Steps from the lowest node of each along a row.
const STEPS: [f32; 4] = [0.0, 1.0, 2.0, 0.0];

/// Contribution of a particle to its nodes, in lanes of momentum and mass.
struct Shares<const D: usize> {
    /// The lowest node at weight one.
    lowest: [[f32; 4]; LANES],
    /// Difference of the contributions to neighbouring nodes along each axis.
    per_step: [[[f32; 4]; LANES]; D],
    /// The same of momentum before forces; in 2D its first component is the third number of those above.
    old: OldShares<D>,
}

/// Contribution of a particle to the momentum before forces of its nodes, as in `Shares`.
struct OldShares<const D: usize> {
    /// The second component in 2D.
    lowest: Lanes,
    per_step: [Lanes; D],
    /// All components in 3D.
    lowest_3d: [[f32; 4]; LANES],
    per_step_3d: [[[f32; 4]; LANES]; D],
}

/// Nodes that sums of cells are added to.
trait Sink<const D: usize> {
    fn take<Q: Quad, const KEEPS: bool>(
        &mut self,
        sums: &mut CellSums<Q, D, KEEPS>,
        layout: &Layout<D>,
    );
}

/// The nodes of the grid alone.
struct GridNodes<'a> {
    nodes: &'a mut [f32x4],
    /// See `Grid`.
    old: &'a mut [f32],
    /// Marks of the chunks that are written to.
    dirty: &'a mut [bool],
}

impl<const D: usize> Sink<D> for GridNodes<'_> {
    #[inline(always)]
    fn take<Q: Quad, const KEEPS: bool>(
        &mut self,
        sums: &mut CellSums<Q, D, KEEPS>,
        layout: &Layout<D>,
    ) {
        sums.flush(self, layout);
    }
}

/// The nodes of the grid, and the slots of one field where there are some.
struct OwnNodes<'a, 'o, 'w, 'f, const D: usize> {
    grid: GridNodes<'a>,
    /// Memory index of the first node.
    first: usize,
    own: &'o mut Own<'w, 'f, D>,
}

impl<const D: usize> Sink<D> for OwnNodes<'_, '_, '_, '_, D> {
    #[inline(always)]
    fn take<Q: Quad, const KEEPS: bool>(
        &mut self,
        sums: &mut CellSums<Q, D, KEEPS>,
        layout: &Layout<D>,
    ) {
        if sums.start == usize::MAX || !self.own.fields.near(self.first + sums.start) {
            return self.grid.take(sums, layout);
        }
        let rows = sums.taken();
        self.add(sums.start, &rows, layout);
    }
}

impl<const D: usize> OwnNodes<'_, '_, '_, '_, D> {
    #[inline(always)]
    fn add(&mut self, start: usize, sums: &[[RowSums; 3]; 3], layout: &Layout<D>) {
        let (grid, own) = (&mut self.grid, &mut *self.own);
        for a in 0..3 {
            for b in 0..if D == 3 { 3 } else { 1 } {
                let begin = start + layout.stencil_row([a, b]);
                let of_row = &sums[a][b];
                match own.fields.row(self.first + begin, own.field) {
                    RowPlace::Grid => {
                        of_row.add::<D>(begin, grid.nodes, grid.old);
                        grid.dirty[begin / CHUNK] = true;
                        grid.dirty[(begin + 2) / CHUNK] = true;
                    }
                    RowPlace::Slot(node) => {
                        of_row.add::<D>(node, own.fields.nodes, own.fields.old);
                    }
                    RowPlace::Parts(nodes) => {
                        for step in 0..3 {
                            if let Some(node) = nodes[step] {
                                own.fields.nodes[node] += of_row.nodes[step];
                                of_row.add_old::<D>(step, node, own.fields.old);
                            } else {
                                let node = begin + step;
                                grid.nodes[node] += of_row.nodes[step];
                                of_row.add_old::<D>(step, node, grid.old);
                                grid.dirty[node / CHUNK] = true;
                            }
                        }
                    }
                }
            }
        }
    }
}

impl<const D: usize, M: Constitutive<D>, S: Sink<D>, const KEEPS: bool> Kernel
    for Scatter<'_, D, M, S, KEEPS>
{
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(mut self) {
        let mut sums = CellSums::<Q, D, KEEPS>::new();
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
struct CellSums<Q: Quad, const D: usize, const KEEPS: bool> {
    /// Lowest node of the stencil; none before the first particle.
    start: usize,
    /// The rows of the stencil, by their steps along the first axes. In 2D the last node, which no stencil reaches, has the
    /// second components of momentum before forces at the others.
    rows: [[Q; 3]; 3],
    /// The same of momentum before forces in 3D.
    old: [[Q; 3]; 3],
}

/// The sums of the nodes of a row.
#[derive(Clone, Copy)]
struct RowSums {
    nodes: [f32x4; 4],
    old: [f32x4; 4],
}

impl RowSums {
    /// Adds those of nodes side by side to nodes, from one on, and to their momenta before forces.
    #[inline(always)]
    fn add<const D: usize>(&self, first: usize, nodes: &mut [f32x4], old: &mut [f32]) {
        let row: &mut [f32x4; 3] = (&mut nodes[first..first + 3])
            .try_into()
            .expect("three nodes");
        for step in 0..3 {
            row[step] += self.nodes[step];
        }
        for step in 0..3 {
            self.add_old::<D>(step, first + step, old);
        }
    }

    /// Adds the momentum before forces of a node of the row to those of many nodes, where these have some.
    #[inline(always)]
    fn add_old<const D: usize>(&self, step: usize, place: usize, old: &mut [f32]) {
        if old.is_empty() {
            return;
        }
        if D == 2 {
            old[place] += self.nodes[3].as_array()[step];
        } else {
            let of_node: &mut [f32; 4] = (&mut old[4 * place..4 * place + 4])
                .try_into()
                .expect("four numbers");
            *of_node = (f32x4::from(*of_node) + self.old[step]).to_array();
        }
    }
}

impl<Q: Quad, const D: usize, const KEEPS: bool> CellSums<Q, D, KEEPS> {
    #[inline(always)]
    fn new() -> Self {
        Self {
            start: usize::MAX,
            rows: [[Q::zero(); 3]; 3],
            old: [[Q::zero(); 3]; 3],
        }
    }

    #[inline(always)]
    fn add(&mut self, stencils: &Stencils<D>, shares: &Shares<D>, i: usize) {
        // By index: copies of whole arrays would be stored and waited for.
        let last = &stencils.weights[D - 1];
        let along = [last[0][i], last[1][i], last[2][i], 0.0];
        let (mut last, mut steps) = (Q::of_nodes(along), Q::of_nodes(STEPS));
        if KEEPS && D == 2 {
            last = last.with_last_node(f32x4::from(along));
            steps = steps.with_last_node(f32x4::from(STEPS));
        }
        let quad = |numbers: [f32; 4], second_old: f32| {
            let quad = Q::repeat(f32x4::from(numbers));
            if KEEPS && D == 2 {
                quad.with_last_node(f32x4::splat(second_old))
            } else {
                quad
            }
        };
        let per_step = |axis: usize| quad(shares.per_step[axis][i], shares.old.per_step[axis][i]);
        let lowest = quad(shares.lowest[i], shares.old.lowest[i]);
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
        if KEEPS && D == 3 {
            self.add_old(stencils, shares, i);
        }
    }

    /// Momentum before forces in 3D.
    #[inline(always)]
    fn add_old(&mut self, stencils: &Stencils<D>, shares: &Shares<D>, i: usize) {
        let last = &stencils.weights[D - 1];
        let last = Q::of_nodes([last[0][i], last[1][i], last[2][i], 0.0]);
        let per_step = |axis: usize| Q::repeat(f32x4::from(shares.old.per_step_3d[axis][i]));
        let steps = Q::of_nodes(STEPS);
        let lowest = Q::repeat(f32x4::from(shares.old.lowest_3d[i]));
        let mut value = per_step(D - 1).mul_add(steps, lowest).mul(last);
        let along_first = per_step(0).mul(last);
        let along_second = per_step(1 % D).mul(last);
        for a in 0..3 {
            let weight = Q::splat(stencils.weights[0][a][i]);
            let (mut of_row, step) = (value.mul(weight), along_second.mul(weight));
            for b in 0..3 {
                let weight = Q::splat(stencils.weights[1][b][i]);
                self.old[a][b] = of_row.mul_add(weight, self.old[a][b]);
                of_row = of_row.add(step);
            }
            value = value.add(along_first);
        }
    }

    /// The sums of each node, which start anew. By index: closures would not be compiled for wide vectors.
    #[inline(always)]
    fn taken(&mut self) -> [[RowSums; 3]; 3] {
        let empty = RowSums {
            nodes: [f32x4::ZERO; 4],
            old: [f32x4::ZERO; 4],
        };
        let mut rows = [[empty; 3]; 3];
        for a in 0..3 {
            for b in 0..if D == 3 { 3 } else { 1 } {
                rows[a][b] = self.take_row(a, b);
            }
        }
        rows
    }

    /// The sums of a row, which start anew.
    #[inline(always)]
    fn take_row(&mut self, a: usize, b: usize) -> RowSums {
        let sums = RowSums {
            nodes: self.rows[a][b].store(),
            old: self.old[a][b].store(),
        };
        self.rows[a][b] = Q::zero();
        if KEEPS && D == 3 {
            self.old[a][b] = Q::zero();
        }
        sums
    }

    /// Adds the sums to the nodes. Node by node: a wide load would have to wait for the narrower or shifted stores of the
    /// neighbouring cell.
    #[inline(always)]
    fn flush(&mut self, grid: &mut GridNodes<'_>, layout: &Layout<D>) {
        let GridNodes { nodes, old, dirty } = grid;
        if self.start == usize::MAX {
            return;
        }
        for a in 0..3 {
            for b in 0..if D == 3 { 3 } else { 1 } {
                let begin = self.start + layout.stencil_row([a, b]);
                let row: &mut [f32x4; 3] = (&mut nodes[begin..begin + 3])
                    .try_into()
                    .expect("three nodes");
                let sums = self.take_row(a, b);
                for step in 0..3 {
                    row[step] += sums.nodes[step];
                }
                if KEEPS && D == 2 {
                    let old: &mut [f32; 3] = (&mut old[begin..begin + 3])
                        .try_into()
                        .expect("three numbers");
                    let sums = sums.nodes[3].as_array();
                    for step in 0..3 {
                        old[step] += sums[step];
                    }
                } else if KEEPS {
                    let old: &mut [f32; 12] = (&mut old[4 * begin..4 * begin + 12])
                        .try_into()
                        .expect("three times four numbers");
                    for (numbers, sums) in old.as_chunks_mut::<4>().0.iter_mut().zip(sums.old) {
                        *numbers = (f32x4::from(*numbers) + sums).to_array();
                    }
                }
                dirty[begin / CHUNK] = true;
                dirty[(begin + 2) / CHUNK] = true;
            }
        }
    }
}

impl<const D: usize, M: Constitutive<D>, S, const KEEPS: bool> Scatter<'_, D, M, S, KEEPS> {
    #[inline(always)]
    fn shares(&self, block: &Block<D, M::State>, stencils: &Stencils<D>) -> Shares<D> {
        let dx = self.layout.dx();
        let stress_factor = -self.step.dt * 4.0 / dx;
        let stress = self.material.kirchhoff_stress(&block.state);
        let v = self.pushed(block);
        let mut shares = Shares {
            lowest: [[0.0; 4]; LANES],
            per_step: [[[0.0; 4]; LANES]; D],
            old: OldShares {
                lowest: [0.0; LANES],
                per_step: [[0.0; LANES]; D],
                lowest_3d: [[0.0; 4]; LANES],
                per_step_3d: [[[0.0; 4]; LANES]; D],
            },
        };
        for i in 0..LANES {
            let mass = block.mass[i];
            let (inertia, tension) = (mass * dx, stress_factor * block.volume[i]);
            let (mut lowest, mut old_lowest) = ([0.0; 4], [0.0; 4]);
            for row in 0..D {
                lowest[row] = mass * v[row][i];
                old_lowest[row] = mass * block.v[row][i];
            }
            lowest[3] = mass;
            for axis in 0..D {
                let (mut step, mut old_step) = ([0.0; 4], [0.0; 4]);
                for row in 0..D {
                    let tau = if row == axis {
                        stress.diagonal[row][i]
                    } else {
                        stress.shear[shear_index::<D>(row, axis)][i]
                    };
                    old_step[row] = block.affine[row][axis][i] * inertia;
                    step[row] = old_step[row] + tau * tension;
                    lowest[row] -= step[row] * stencils.offset[axis][i];
                    old_lowest[row] -= old_step[row] * stencils.offset[axis][i];
                }
                if KEEPS && D == 2 {
                    step[2] = old_step[0];
                    shares.old.per_step[axis][i] = old_step[1];
                } else if KEEPS {
                    shares.old.per_step_3d[axis][i] = old_step;
                }
                shares.per_step[axis][i] = step;
            }
            if KEEPS && D == 2 {
                lowest[2] = old_lowest[0];
                shares.old.lowest[i] = old_lowest[1];
            } else if KEEPS {
                shares.old.lowest_3d[i] = old_lowest;
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
    mut own: Option<Own<'_, '_, D>>,
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
            let places = own.fields.row(begin, own.field).each();
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
    own: &mut Own<'_, '_, D>,
) {
    for_each_row_of(blocks, layout, |block, i, begin, of_row, along| {
        let places = own.fields.row(begin, own.field).each();
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
