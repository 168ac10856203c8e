//! Which particle goes where: places that fill a region evenly, and for each particle one of them.

use crate::assignment::assign;
use crate::error::{GuidanceError, finite};
use crate::free_space::FreeSpace;
use crate::partition::{divide, mean, square_distance};

/// Groups that are matched with each other. More change little: 200 serve nearly as well as 400.
const FEWEST_GROUPS: usize = 160;
const MOST_GROUPS: usize = 208;
/// Particles of a group in small scenes, where there are fewer groups.
const SMALL_GROUP: usize = 8;
/// Particles that are matched one by one; larger groups are divided first.
const MOST_AT_ONCE: usize = 32;
const PART: usize = 16;
/// A detour is taken into account from this factor of the straight way on; lengths on the grid are up to 8 % off.
const DETOUR: f64 = 1.15;
/// Groups of goals that share a field of distances, by dimension; one field serves neighbours.
const FIELDS: [usize; 4] = [0, 1, 32, 8];

/// Places of particles, and the ways of groups of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Matching<const D: usize> {
    /// Place of each particle [m].
    pub places: Vec<[f64; D]>,
    /// Group of each particle.
    pub group: Vec<u32>,
    /// Way of the centre of each group: start, corners and end [m].
    pub ways: Vec<Vec<[f64; D]>>,
    /// Groups whose places cannot be reached.
    pub cut_off: Vec<bool>,
}

/// Fills a region evenly with as many places as there are particles `x`, and gives each particle one.
///
/// `cells` are centres of equal cells that make up the region, several for each particle. Particles and places are
/// divided into groups; groups are assigned to each other so that the sum of squared ways is least, then the
/// particles of each pair of groups, whose centres are laid upon each other. With `space`, ways lead around
/// obstacles. Equal input gives equal output, to the bit.
pub fn match_to_region<const D: usize>(
    x: &[[f64; D]],
    cells: &[[f64; D]],
    space: Option<&FreeSpace<D>>,
) -> Result<Matching<D>, GuidanceError> {
    finite("x", x.as_flattened())?;
    finite("cells", cells.as_flattened())?;
    if x.is_empty() {
        return Err(GuidanceError::new("x", "at least 1 particle", &0));
    }
    let sizes = Sizes::of(x.len());
    let count = sizes.groups * sizes.places;
    if cells.len() < count {
        return Err(GuidanceError::new(
            "cells",
            format!("at least {count}"),
            &cells.len(),
        ));
    }
    let places = even_places(cells, count);
    let (from, to) = (
        Groups::of(x, sizes.groups),
        Groups::of(&places, sizes.groups),
    );
    let fields = space.map(|space| Fields::new(space, &to));
    // What depends on one of the two alone changes no assignment. This is what the shift from all groups to all
    // places costs; without it far fewer ways compete for the same places.
    let shift: [f64; D] = {
        let (from, to) = (middle(&from.centers), middle(&to.centers));
        std::array::from_fn(|axis| 2.0 * (to[axis] - from[axis]))
    };
    let along = |x: &[f64; D]| (0..D).map(|axis| shift[axis] * x[axis]).sum::<f64>();
    let cost = |row: usize, column: usize| {
        let (start, end) = (&from.centers[row], &to.centers[column]);
        let straight = square_distance(start, end);
        let way = fields
            .as_ref()
            .map_or(straight, |fields| fields.cost(start, column, straight));
        way + along(start) - along(end)
    };
    let partner = assign(sizes.groups, sizes.groups, cost);
    let mut matching = Matching {
        places: vec![[0.0; D]; x.len()],
        group: vec![0; x.len()],
        ways: Vec::with_capacity(sizes.groups),
        cut_off: vec![false; sizes.groups],
    };
    for (group, &target) in partner.iter().enumerate() {
        let (members, offered) = (from.members(group), to.members(target));
        match_within(
            x,
            members,
            &places,
            offered,
            sizes.parts,
            &mut matching.places,
        );
        for &member in members {
            matching.group[member] = group as u32;
        }
        let (start, end) = (from.centers[group], mean(&matching.places, members));
        let way = fields
            .as_ref()
            .and_then(|fields| fields.way(&start, &end, target));
        matching.cut_off[group] = way.as_ref().is_some_and(Vec::is_empty);
        matching.ways.push(
            way.filter(|way| !way.is_empty())
                .unwrap_or_else(|| vec![start, end]),
        );
    }
    Ok(matching)
}

/// Moves places that lie in no cell of a side [m], as between two arms of a shape, to the middle of the nearest cell.
pub fn in_cells<const D: usize>(places: &mut [[f64; D]], cells: &[[f64; D]], side: f64) {
    let mut corner = [f64::INFINITY; D];
    for cell in cells {
        corner = std::array::from_fn(|axis| corner[axis].min(cell[axis]));
    }
    let node = |x: &[f64; D]| -> [f64; D] {
        std::array::from_fn(|axis| ((x[axis] - corner[axis]) / side).round_ties_even())
    };
    let mut counts = [1.0_f64; D];
    for cell in cells.iter().map(&node) {
        counts = std::array::from_fn(|axis| counts[axis].max(cell[axis] + 1.0));
    }
    let flat = |node: [f64; D]| -> usize {
        (0..D).fold(0, |flat, axis| {
            let along = node[axis].clamp(0.0, counts[axis] - 1.0);
            flat * counts[axis] as usize + along as usize
        })
    };
    let mut taken = vec![false; counts.iter().map(|&count| count as usize).product()];
    for cell in cells {
        taken[flat(node(cell))] = true;
    }
    for place in places {
        if taken[flat(node(place))] {
            continue;
        }
        let mut nearest = (f64::INFINITY, *place);
        for cell in cells {
            let square = square_distance(cell, place);
            if square < nearest.0 {
                nearest = (square, *cell);
            }
        }
        *place = nearest.1;
    }
}

/// Mean of points.
fn middle<const D: usize>(points: &[[f64; D]]) -> [f64; D] {
    let count = points.len() as f64;
    std::array::from_fn(|axis| points.iter().map(|x| x[axis]).sum::<f64>() / count)
}

/// Number of groups, and number of places in each.
struct Sizes {
    groups: usize,
    places: usize,
    /// Parts into which a group is divided before its particles are matched.
    parts: usize,
}

impl Sizes {
    /// Number of groups that leaves the fewest places empty.
    fn of(particles: usize) -> Self {
        let most = particles.div_ceil(SMALL_GROUP).clamp(1, MOST_GROUPS);
        let fewest = if most < FEWEST_GROUPS {
            most
        } else {
            FEWEST_GROUPS
        };
        let padded = |groups: usize| {
            let places = particles.div_ceil(groups);
            let parts = if places > MOST_AT_ONCE {
                places.div_ceil(PART)
            } else {
                1
            };
            (parts, parts * places.div_ceil(parts))
        };
        let groups = (fewest..=most)
            .min_by_key(|&groups| (groups * padded(groups).1, most - groups))
            .expect("the range has one number or more");
        let (parts, places) = padded(groups);
        Self {
            groups,
            places,
            parts,
        }
    }
}

/// Centres of equal parts of a region.
fn even_places<const D: usize>(cells: &[[f64; D]], count: usize) -> Vec<[f64; D]> {
    let mut order: Vec<usize> = (0..cells.len()).collect();
    let ranges = divide(cells, &mut order, count);
    ranges
        .into_iter()
        .map(|range| mean(cells, &order[range]))
        .collect()
}

/// Points in groups of neighbours.
struct Groups<const D: usize> {
    order: Vec<usize>,
    ranges: Vec<std::ops::Range<usize>>,
    centers: Vec<[f64; D]>,
}

impl<const D: usize> Groups<D> {
    fn of(points: &[[f64; D]], count: usize) -> Self {
        let mut order: Vec<usize> = (0..points.len()).collect();
        let ranges = divide(points, &mut order, count);
        let centers = ranges
            .iter()
            .map(|range| mean(points, &order[range.clone()]))
            .collect();
        Self {
            order,
            ranges,
            centers,
        }
    }

    fn members(&self, group: usize) -> &[usize] {
        &self.order[self.ranges[group].clone()]
    }
}

/// Gives the members of a group places among those offered, which are at least as many.
fn match_within<const D: usize>(
    x: &[[f64; D]],
    members: &[usize],
    places: &[[f64; D]],
    offered: &[usize],
    parts: usize,
    found: &mut [[f64; D]],
) {
    let (center, goal) = (mean(x, members), mean(places, offered));
    let cost = |from: &[f64; D], to: &[f64; D]| -> f64 {
        (0..D)
            .map(|axis| (to[axis] - goal[axis] - from[axis] + center[axis]).powi(2))
            .sum()
    };
    if parts == 1 {
        let columns = assign(members.len(), offered.len(), |row, column| {
            cost(&x[members[row]], &places[offered[column]])
        });
        for (row, column) in columns.into_iter().enumerate() {
            found[members[row]] = places[offered[column]];
        }
        return;
    }
    let (mut members, mut offered) = (members.to_vec(), offered.to_vec());
    let from = divide(x, &mut members, parts);
    let to = divide(places, &mut offered, parts);
    let from_centers: Vec<_> = from
        .iter()
        .map(|range| mean(x, &members[range.clone()]))
        .collect();
    let to_centers: Vec<_> = to
        .iter()
        .map(|range| mean(places, &offered[range.clone()]))
        .collect();
    let partner = assign(parts, parts, |row, column| {
        cost(&from_centers[row], &to_centers[column])
    });
    for (part, &target) in partner.iter().enumerate() {
        let (members, offered) = (&members[from[part].clone()], &offered[to[target].clone()]);
        match_within(x, members, places, offered, 1, found);
    }
}

/// Lengths of ways around obstacles to all groups of places.
struct Fields<'a, const D: usize> {
    space: &'a FreeSpace<D>,
    /// Groups of places that share a field, by the last of them.
    ends: Vec<usize>,
    lengths: Vec<Vec<f64>>,
    centers: Vec<[f64; D]>,
}

impl<'a, const D: usize> Fields<'a, D> {
    fn new(space: &'a FreeSpace<D>, to: &Groups<D>) -> Self {
        let count = to.centers.len();
        let fields = FIELDS[D].min(count);
        // Groups that follow each other are neighbours.
        let ends: Vec<usize> = (1..=fields).map(|field| field * count / fields).collect();
        let mut start = 0;
        let lengths = ends
            .iter()
            .map(|&end| {
                let field = space.lengths_to(&to.centers[start..end]);
                start = end;
                field
            })
            .collect();
        Self {
            space,
            ends,
            lengths,
            centers: to.centers.clone(),
        }
    }

    fn field(&self, group: usize) -> usize {
        self.ends.partition_point(|&end| end <= group)
    }

    /// Square of the way to a group of places, of which `straight` is the square of the straight one.
    fn cost(&self, from: &[f64; D], group: usize, straight: f64) -> f64 {
        let field = self.field(group);
        let length = self.space.length_at(&self.lengths[field], from);
        let first = field.checked_sub(1).map_or(0, |before| self.ends[before]);
        let nearest = self.centers[first..self.ends[field]]
            .iter()
            .map(|center| square_distance(center, from))
            .fold(f64::INFINITY, f64::min)
            .sqrt();
        // Nothing is gained by distinguishing places without a way, but the sum must stay finite.
        let detour = (length.min(10.0) - DETOUR * nearest).max(0.0);
        (straight.sqrt() + detour).powi(2)
    }

    /// Way to a place of a group: None if it is straight, empty if there is none.
    fn way(&self, from: &[f64; D], to: &[f64; D], group: usize) -> Option<Vec<[f64; D]>> {
        if self.space.sees(from, to) {
            return None;
        }
        let way = self.space.way(from, to, &self.lengths[self.field(group)]);
        Some(way.unwrap_or_default())
    }
}

#[cfg(test)]
mod tests;
