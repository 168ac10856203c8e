//! Contact with the six (four) sides of the box at their true positions between grid nodes.
//!
//! On the line of nodes that crosses a wall at x_w, the velocity of the material at the wall is
//! u = sum_i w_i(x_w) v_i over three nodes. An impulse lambda at that point changes node i by
//! w_i lambda / m_i, so u changes by K lambda with K = sum_i w_i^2 / m_i. Separating contact requires
//! lambda >= 0 with u . n >= 0, friction for a tangential impulse of at most mu lambda. Uniform pressure
//! p pushes node i with exactly -p w_i(x_w) per area, so fluid at rest stays at rest: a wall on the
//! nearest node line would let it sink by up to half a cell.
//!
//! Contact begins where the face of the material is nearer to the wall than its reach. The distance d of a plane face
//! follows from the ratio of the masses of the middle and the inner node, and from the position of the wall between
//! nodes. So the reach does not depend on that position. With a test for mass on a single node it would vary by up to a
//! cell: material would stop at a third of a cell from one wall, and at one and a third from another.

use super::contact::{Contact, ContactKind, Walls, remaining_slip};
use super::node::MaterialFriction;
use super::reactions::{Reactions, Wrench};
use super::touch::{Touch, touching};
use crate::grid::{
    ActiveSpans, CHUNK, Fields, Layout, PADDING, SMALLEST_MASS, Span, Window, spline,
};
use crate::linalg::{Kernel, LANES, Lanes, Quad, run_wide};

/// Which lines across walls to change.
#[derive(Debug, Clone, Copy)]
pub struct Lines<'a> {
    /// Those of the grid, or of a field that has its own nodes; and whether that is elastic.
    pub own: Option<bool>,
    /// Those across the first axis, the others, or one after the other.
    pub across_first: &'a [bool],
    /// Duration of the substep [s].
    pub dt: f32,
}

/// One wall on the grid.
#[derive(Debug, Clone)]
struct Side {
    axis: usize,
    /// +1 at a lower wall, -1 at an upper one.
    inward: f32,
    contact: Contact,
    /// [m]
    position: f64,
    /// Coordinate along the axis of the middle one of the three nodes.
    middle: usize,
    /// Weights of the outer, middle and inner node at the wall.
    weights: [f32; 3],
    /// See `touching`.
    touching: [Touch; 2],
    /// Memory indices of the middle nodes of the lines that may carry material, in ascending order: those of each line if
    /// lines are parts of rows, else the first of each chunk of lines side by side. First those that something may reach that
    /// flows, and then those that only elastic bodies reach.
    lines: [Vec<usize>; 2],
    /// Those of them whose nodes carry several fields.
    shared_lines: Vec<usize>,
}

/// All walls of a scene, prepared for one grid.
#[derive(Debug, Clone)]
pub struct WallContact {
    sides: Vec<Side>,
}

impl WallContact {
    pub fn new<const D: usize>(walls: &Walls<D>, layout: &Layout<D>) -> Self {
        let side = |axis: usize, position: f32, inward: f32, contact: Contact| {
            let xi = f64::from(position) * layout.resolution as f64 + PADDING as f64;
            let base = (xi - 0.5).floor();
            let mut weights = spline((xi - base) as f32);
            if inward < 0.0 {
                weights.reverse();
            }
            let face = (xi - base - 1.0) * f64::from(inward);
            Side {
                axis,
                inward,
                contact,
                position: f64::from(position),
                middle: base as usize + 1,
                weights,
                touching: touching(
                    face,
                    1.0,
                    contact.kind,
                    1.0 / layout.resolution as f64,
                    true,
                ),
                lines: [Vec::new(), Vec::new()],
                shared_lines: Vec::new(),
            }
        };
        let sides = (0..D)
            .flat_map(|axis| {
                let [lower, upper] = walls.contacts[axis];
                [
                    side(axis, walls.lower[axis], 1.0, lower),
                    side(axis, walls.upper[axis], -1.0, upper),
                ]
            })
            .collect();
        Self { sides }
    }

    /// Finds the node lines across each wall that may have mass.
    pub fn activate<const D: usize>(
        &mut self,
        active: &ActiveSpans,
        fields: &Fields<D>,
        layout: &Layout<D>,
    ) {
        for side in &mut self.sides {
            let mut lines = std::mem::take(&mut side.lines[0]);
            lines.clear();
            let chunks = |span: &Span| {
                let start = span.row * layout.row_length;
                (start + span.lo..start + span.hi).step_by(CHUNK)
            };
            if side.axis == 0 {
                let planes = side.middle..side.middle + 1;
                lines.extend(active.of_planes(planes).iter().flat_map(chunks));
            } else if side.axis == D - 1 {
                let reached = |span: &&Span| span.lo < side.middle && side.middle + 1 < span.hi;
                let middle = |span: &Span| span.row * layout.row_length + side.middle;
                let spans = active.all().iter().filter(reached);
                lines.extend(spans.map(middle));
            } else {
                for plane in 0..layout.planes() {
                    let row = plane * layout.rows_per_plane() + side.middle;
                    let spans = active.of_planes(plane..plane + 1);
                    let first = spans.partition_point(|span| span.row < row);
                    let of_row = spans[first..].iter().take_while(|span| span.row == row);
                    lines.extend(of_row.flat_map(chunks));
                }
            }
            side.shared_lines.clear();
            if fields.meet() {
                let shared = lines.iter();
                let shared = shared.filter(|line| fields.is_shared(**line / CHUNK));
                side.shared_lines.extend(shared);
            }
            side.lines[1].clear();
            let elastic = lines.extract_if(.., |line| fields.only_elastic(*line / CHUNK));
            side.lines[1].extend(elastic);
            side.lines[0] = lines;
        }
    }

    /// The other chunks of the lines across walls that have nodes in a chunk.
    pub fn chunks_of_lines<const D: usize>(
        &self,
        layout: &Layout<D>,
        chunk: usize,
        others: &mut Vec<usize>,
    ) {
        for side in &self.sides {
            let (at, stride, of_line) = if side.axis == D - 1 {
                let of_node = |node: usize| node / CHUNK;
                let of_line = of_node(side.middle - 1)..=of_node(side.middle + 1);
                (chunk % (layout.row_length / CHUNK), 1, of_line)
            } else {
                let stride = layout.stride(side.axis) / CHUNK;
                let at = chunk / stride % layout.extents[side.axis];
                (at, stride, side.middle - 1..=side.middle + 1)
            };
            if of_line.contains(&at) {
                others.extend(
                    of_line
                        .filter(|&k| k != at)
                        .map(|k| chunk + k * stride - at * stride),
                );
            }
        }
    }

    /// Whether lines in a window carry several fields.
    pub fn has_shared_lines<const D: usize>(&self, window: &Window<'_, D>) -> bool {
        let shared = |side: &Side| !lines_in(window, &side.shared_lines).is_empty();
        self.sides.iter().any(shared)
    }

    /// Coordinates along the first axis of the walls across it.
    pub fn planes(&self) -> Vec<usize> {
        let across = self.sides.iter().filter(|side| side.axis == 0);
        across.map(|side| side.middle).collect()
    }

    /// Applies contact with all walls to the grid velocities of a window of planes, which contains with the planes of a
    /// wall also those before and behind it.
    pub fn apply<const D: usize>(
        &self,
        window: &mut Window<'_, D>,
        friction: &MaterialFriction,
        lines: Lines<'_>,
        reactions: &mut Reactions<D>,
    ) {
        let dt = lines.dt;
        for across_first in lines.across_first {
            // Corners: walls across the first axis come last.
            let sides = self.sides.iter();
            for side in sides.filter(|side| (side.axis == 0) == *across_first) {
                let upper = usize::from(side.inward < 0.0);
                let mut wrench = (reactions.kept).then_some(&mut reactions.walls[side.axis][upper]);
                let mut resolve = |lines: &[usize], elastic: bool| {
                    let touching = side.touching[usize::from(elastic)];
                    let lines = lines_in(window, lines);
                    if !lines.is_empty() {
                        Self::resolve(
                            window,
                            side,
                            (touching, dt),
                            lines,
                            friction,
                            wrench.as_deref_mut(),
                        );
                    }
                };
                if let Some(elastic) = lines.own {
                    resolve(&side.shared_lines, elastic);
                } else {
                    resolve(&side.lines[0], false);
                    resolve(&side.lines[1], true);
                }
            }
        }
    }

    /// Contact on node lines. They have no node in common, so their order has no influence.
    fn resolve<const D: usize>(
        window: &mut Window<'_, D>,
        side: &Side,
        (touching, dt): (Touch, f32),
        lines: &[usize],
        friction: &MaterialFriction,
        wrench: Option<&mut Wrench<D>>,
    ) {
        let friction = match (side.contact.friction, friction) {
            (Some(mu), _) => MaterialFriction::Uniform(mu),
            (None, of_material) => *of_material,
        };
        let places = Places::new(&window.layout);
        run_wide(ResolveLines {
            window,
            side,
            touching,
            dt,
            lines,
            kind: side.contact.kind,
            friction,
            places,
            wrench,
        });
    }
}

/// Those of some lines, in ascending order, that lie in a window.
fn lines_in<'l, const D: usize>(window: &Window<'_, D>, lines: &'l [usize]) -> &'l [usize] {
    let place = |node: usize| lines.partition_point(|&line| line < node);
    &lines[place(window.first)..place(window.first + window.nodes.len())]
}

/// Contact of one wall on node lines.
struct ResolveLines<'a, 'w, const D: usize> {
    window: &'a mut Window<'w, D>,
    side: &'a Side,
    /// See `touching`.
    touching: Touch,
    /// Duration of the substep [s].
    dt: f32,
    /// See `Side`.
    lines: &'a [usize],
    kind: ContactKind,
    friction: MaterialFriction,
    places: Places<D>,
    /// None where nobody reads forces: in 3D their sums take up to 3 % of a frame.
    wrench: Option<&'a mut Wrench<D>>,
}

impl<const D: usize> Kernel for ResolveLines<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self) {
        // Without friction nothing happens along the wall.
        let smooth = self.kind == ContactKind::Slip
            || self.kind == ContactKind::Separating
                && matches!(self.friction, MaterialFriction::Uniform(0.0));
        let axis = self.side.axis;
        let across = [axis];
        let all = std::array::from_fn(|k| match k {
            0 => axis,
            k if k <= axis => k - 1,
            k => k,
        });
        match (axis == D - 1, smooth) {
            (true, true) => self.resolve::<Q, 1, 1>(across),
            (true, false) => self.resolve::<Q, 1, D>(all),
            (false, true) => self.resolve::<Q, CHUNK, 1>(across),
            (false, false) => self.resolve::<Q, CHUNK, D>(all),
        }
    }
}

impl<const D: usize> ResolveLines<'_, '_, D> {
    /// Changes the components of the velocity along some axes, the first of which is across the wall. So many lines lie side by
    /// side: one or a chunk.
    #[inline(always)]
    fn resolve<Q: Quad, const SIDE_BY_SIDE: usize, const N: usize>(mut self, axes: [usize; N]) {
        let mut starts = [0; LANES];
        let (mut found, most) = (0, LANES / SIDE_BY_SIDE);
        for start in self.lines {
            let start = start - self.window.first;
            starts[found] = start;
            found += usize::from(self.window.dirty[start / CHUNK]);
            if found == most {
                self.resolve_batch::<Q, SIDE_BY_SIDE, N>(&starts, found, &axes);
                found = 0;
            }
        }
        if found > 0 {
            self.resolve_batch::<Q, SIDE_BY_SIDE, N>(&starts, found, &axes);
        }
    }

    /// The same for lines that start at the first `found` of some middle nodes.
    #[inline(always)]
    fn resolve_batch<Q: Quad, const SIDE_BY_SIDE: usize, const N: usize>(
        &mut self,
        starts: &[usize; LANES],
        found: usize,
        axes: &[usize; N],
    ) {
        let inward = self.side.inward as isize * self.window.layout.stride(self.side.axis) as isize;
        let steps = [-inward, 0, inward];
        let nodes = &mut *self.window.nodes;
        let mut lines = LineNodes {
            mass: [[0.0; LANES]; 3],
            v: [[[0.0; LANES]; 3]; N],
        };
        let place = |step: usize, k: usize| starts[k].wrapping_add_signed(steps[step]);
        // A second chunk that is missing is the first once more, to be left out.
        let chunks = |step: usize| {
            [place(step, 0), place(step, found - 1)].map(|start| {
                let chunk = &nodes[start..start + CHUNK];
                chunk.try_into().expect("a chunk")
            })
        };
        for step in 0..3 {
            if SIDE_BY_SIDE == CHUNK {
                lines.mass[step] = Q::column(chunks(step), 3);
            } else {
                for lane in 0..found {
                    lines.mass[step][lane] = nodes[place(step, lane)].as_array()[3];
                }
            }
        }
        // In a splash most lines do not touch: their velocities are not read.
        if !lines.leave_out_what_does_not_touch(self.touching, found * SIDE_BY_SIDE) {
            return;
        }
        for step in 0..3 {
            for k in 0..N {
                if SIDE_BY_SIDE == CHUNK {
                    lines.v[k][step] = Q::column(chunks(step), axes[k]);
                } else {
                    for lane in 0..found {
                        lines.v[k][step][lane] = nodes[place(step, lane)].as_array()[axes[k]];
                    }
                }
            }
        }
        let mut mu = [0.0; LANES];
        if N > 1 {
            for lane in 0..found * SIDE_BY_SIDE {
                let node = starts[lane / SIDE_BY_SIDE] + lane % SIDE_BY_SIDE;
                let mass = lines.mass[1][lane].max(SMALLEST_MASS);
                mu[lane] = self.friction.at(self.window.friction_mass, node, mass);
            }
        }
        let closing = lines.closing_speeds(self.touching, self.dt);
        let resting = self.touching.resting_speed(self.dt);
        let given = lines.apply(self.kind, self.side, &mu, &closing, resting);
        self.sum_up::<SIDE_BY_SIDE, N>(starts, found, axes, &given);
        let nodes = &mut *self.window.nodes;
        for step in 0..3 {
            for k in 0..N {
                let (v, _) = lines.v[k][step].as_chunks::<SIDE_BY_SIDE>();
                for (start, v) in starts[..found].iter().zip(v) {
                    let place = start.wrapping_add_signed(steps[step]);
                    if SIDE_BY_SIDE == CHUNK {
                        let chunk = &mut nodes[place..place + CHUNK];
                        let v = v[..].try_into().expect("a chunk");
                        Q::set_column(chunk.try_into().expect("a chunk"), axes[k], v);
                    } else {
                        nodes[place].as_mut_array()[axes[k]] = v[0];
                    }
                }
            }
        }
    }
}

impl<const D: usize> ResolveLines<'_, '_, D> {
    /// Adds the impulses on lines that start at the first `found` of some middle nodes, at the wall itself.
    #[inline(always)]
    fn sum_up<const SIDE_BY_SIDE: usize, const N: usize>(
        &mut self,
        starts: &[usize; LANES],
        found: usize,
        axes: &[usize; N],
        given: &[Lanes; N],
    ) {
        let Some(wrench) = &mut self.wrench else {
            return;
        };
        let mut any = false;
        given
            .iter()
            .flatten()
            .for_each(|impulse| any |= *impulse != 0.0);
        if !any {
            return;
        }
        // Each component, and that times each coordinate of its place in nodes.
        let (mut sums, mut moments) = ([0.0; N], [[0.0; D]; N]);
        for line in 0..found {
            let node = self.places.of(starts[line] + self.window.first);
            for k in 0..N {
                let (parts, _) = given[k].as_chunks::<SIDE_BY_SIDE>();
                let (mut sum, mut along) = (parts[line], parts[line]);
                if SIDE_BY_SIDE > 1 {
                    (0..SIDE_BY_SIDE).for_each(|step| along[step] *= step as f32);
                    let mut half = SIDE_BY_SIDE / 2;
                    while half > 0 {
                        for step in 0..half {
                            sum[step] += sum[step + half];
                            along[step] += along[step + half];
                        }
                        half /= 2;
                    }
                }
                let sum = f64::from(sum[0]);
                sums[k] += sum;
                for axis in 0..D {
                    moments[k][axis] += node[axis] * sum;
                }
                if SIDE_BY_SIDE > 1 {
                    moments[k][D - 1] += f64::from(along[0]);
                }
            }
        }
        let dx = self.places.dx;
        for (k, &axis) in axes.iter().enumerate() {
            wrench.impulse[axis] += sums[k];
            for across in (0..D).filter(|across| *across != axis) {
                let moment = if across == self.side.axis {
                    self.side.position * sums[k]
                } else {
                    (moments[k][across] - PADDING as f64 * sums[k]) * dx
                };
                // The sign of e_across x e_axis.
                let about = &mut wrench.moment[3 - across - axis];
                *about += if (across + 1) % 3 == axis {
                    moment
                } else {
                    -moment
                };
            }
        }
    }
}

/// Coordinates of nodes from their memory indices, without divisions.
#[derive(Clone, Copy)]
struct Places<const D: usize> {
    /// Cell size [m].
    dx: f64,
    row_length: f64,
    per_row: f64,
    rows_per_plane: f64,
    per_plane: f64,
}

impl<const D: usize> Places<D> {
    fn new(layout: &Layout<D>) -> Self {
        let (row_length, rows) = (layout.row_length as f64, layout.rows_per_plane() as f64);
        Self {
            dx: 1.0 / layout.resolution as f64,
            row_length,
            per_row: 1.0 / row_length,
            rows_per_plane: rows,
            per_plane: 1.0 / rows,
        }
    }

    /// Coordinates of a node [nodes].
    #[inline(always)]
    fn of(&self, node: usize) -> [f64; D] {
        // The half keeps rounding from crossing an integer.
        let node = node as f64;
        let row = ((node + 0.5) * self.per_row).floor();
        let mut place = [row; D];
        if D == 3 {
            place[0] = ((row + 0.5) * self.per_plane).floor();
            place[1] = row - place[0] * self.rows_per_plane;
        }
        place[D - 1] = node - row * self.row_length;
        place
    }
}

/// The outer, middle and inner nodes of `LANES` lines, with N components of their velocities, the one across the wall first.
struct LineNodes<const N: usize> {
    mass: [Lanes; 3],
    v: [[Lanes; 3]; N],
}

impl<const N: usize> LineNodes<N> {
    /// Takes the masses of lines away that have no material at the wall, or that are not among the first `count`. Returns
    /// whether any are left.
    #[inline(always)]
    fn leave_out_what_does_not_touch(&mut self, touching: Touch, count: usize) -> bool {
        let [_, middle, inner] = self.mass;
        let mut any = false;
        let mut touches = [false; LANES];
        for i in 0..LANES {
            touches[i] =
                (middle[i] > SMALLEST_MASS) & touching.touches(middle[i], inner[i]) & (i < count);
            any |= touches[i];
        }
        for mass in &mut self.mass {
            let mut kept = [0.0; LANES];
            for i in 0..LANES {
                kept[i] = if touches[i] { mass[i] } else { 0.0 };
            }
            *mass = kept;
        }
        any
    }

    /// Speeds at which the material may come nearer [m/s].
    #[inline(always)]
    fn closing_speeds(&self, touching: Touch, dt: f32) -> Lanes {
        let mut speeds = [0.0; LANES];
        if touching.distance > 0.0 {
            let [_, middle, inner] = self.mass;
            for i in 0..LANES {
                speeds[i] = touching.closing(middle[i], inner[i], dt);
            }
        }
        speeds
    }

    /// Changes velocities so that the material at the wall obeys the contact, but for speeds `closing` towards it where it is
    /// faster than `resting` [m/s]. Returns the impulses, by components.
    #[inline(always)]
    fn apply(
        &mut self,
        kind: ContactKind,
        side: &Side,
        mu: &Lanes,
        closing: &Lanes,
        resting: f32,
    ) -> [Lanes; N] {
        let mut given = [[0.0; LANES]; N];
        let separates = kind == ContactKind::Separating;
        let lost_always = if kind == ContactKind::Sticky {
            1.0
        } else {
            0.0
        };
        if !separates {
            for i in 0..LANES {
                // An outer node that is lighter than its weight would take most of the change, and material would creep off by
                // a quarter of a cell before it is held. It stays with the wall, as an empty one does.
                let [outer, middle, _] = self.mass;
                let light = outer[i] * side.weights[1] < middle[i] * side.weights[0];
                self.mass[0][i] = if light { 0.0 } else { outer[i] };
                for k in 0..N {
                    let momentum = outer[i] * self.v[k][0][i];
                    given[k][i] = if light { -momentum } else { 0.0 };
                    self.v[k][0][i] = if light { 0.0 } else { self.v[k][0][i] };
                }
            }
        }
        // Read in the loop they would be gathered, lane by lane.
        let (weights, inward) = (side.weights, side.inward);
        for i in 0..LANES {
            let mut mobility = [0.0; 3];
            let mut at_wall = [0.0; N];
            let (mut total, mut held) = (0.0, 0.0);
            for step in 0..3 {
                // Empty nodes have no velocity to speak of and take no impulse.
                let mass = self.mass[step][i];
                let there = mass > SMALLEST_MASS;
                let weight = if there { weights[step] } else { 0.0 };
                mobility[step] = weight / if there { mass } else { 1.0 };
                total += mobility[step] * weight;
                held += weight;
                for k in 0..N {
                    at_wall[k] += weight * self.v[k][step][i];
                }
            }
            let approach = 0.0 - at_wall[0] * inward;
            let approach = approach - if approach > resting { closing[i] } else { 0.0 };
            let none = separates & (approach <= 0.0) | (total <= 0.0);
            // Impulse per change of the velocity at the wall; each node takes its share.
            let impulse = if none { 0.0 } else { 1.0 } / if none { 1.0 } else { total };
            let mut change = [approach * inward; N];
            if N > 1 {
                let slip_squared: f32 = at_wall[1..].iter().map(|slip| slip * slip).sum();
                // Coulomb friction takes at most this part of the slip.
                let lost = 1.0 - remaining_slip(slip_squared.sqrt(), mu[i] * approach);
                let lost = if separates { lost } else { lost_always };
                for k in 1..N {
                    change[k] = -at_wall[k] * lost;
                }
            }
            for k in 0..N {
                given[k][i] += change[k] * impulse * held;
                for step in 0..3 {
                    self.v[k][step][i] += change[k] * impulse * mobility[step];
                }
            }
        }
        given
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_are_found_from_their_memory_indices() {
        let layout = Layout::<3>::new(17, [17, 9, 30]);
        let places = Places::new(&layout);
        for node in 0..layout.row_count() * layout.row_length {
            let mut place = layout.row_coordinates(node / layout.row_length);
            place[2] = node % layout.row_length;
            assert_eq!(places.of(node), place.map(|axis| axis as f64));
        }
    }
}
