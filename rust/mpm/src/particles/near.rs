//! Which groups are so near to each other that bodies may meet.

use super::group::{MaterialGroup, with_group};
use crate::grid::{CHUNK, Place};

/// Cells between places along planes and rows at which groups are near: stencils and what they reach before the next sort,
/// and lines of nodes across walls.
const NEAR: u16 = 10;
/// The same along columns, whose nodes are kept in whole chunks.
const NEAR_COLUMNS: u16 = NEAR + 3 * CHUNK as u16;

/// Places of a group that count, along each axis from the first to the second.
#[derive(Debug, Clone, Copy)]
pub struct Zone([Place; 2]);

impl Zone {
    fn around([low, high]: [Place; 2]) -> Self {
        Self([
            Place {
                plane: low.plane.saturating_sub(NEAR),
                row: low.row.saturating_sub(NEAR),
                column: low.column.saturating_sub(NEAR_COLUMNS),
            },
            Place {
                plane: high.plane + NEAR,
                row: high.row + NEAR,
                column: high.column + NEAR_COLUMNS,
            },
        ])
    }

    pub fn contains(&self, place: Place) -> bool {
        let Self([low, high]) = self;
        low.lowest(place) == *low && high.highest(place) == *high
    }

    fn touches(&self, [low, high]: [Place; 2]) -> bool {
        let Self([my_low, my_high]) = *self;
        my_low.highest(high) == high && my_high.lowest(low) == low
    }
}

/// The groups that are near to others, with their zones; besides what flows, all elastic ones. `bounds` returns the lowest
/// and the highest place of a group.
///
/// Elastic bodies count as a whole, what flows as far as it is near to some elastic one.
pub fn near_ones<const D: usize>(
    groups: &[MaterialGroup<D>],
    bounds: impl Fn(usize) -> Option<[Place; 2]>,
) -> Vec<(usize, Zone)> {
    struct Member {
        group: usize,
        field: u16,
        elastic: bool,
        bounds: [Place; 2],
        near: bool,
    }
    let member = |group: usize| {
        Some(Member {
            group,
            field: with_group!(&groups[group], group => group.field),
            elastic: groups[group].is_elastic(),
            bounds: bounds(group)?,
            near: false,
        })
    };
    let mut members: Vec<_> = (0..groups.len()).filter_map(member).collect();
    members.sort_by_key(|member| (member.bounds[0].plane, member.group));
    for one in 0..members.len() {
        let zone = Zone::around(members[one].bounds);
        for other in one + 1..members.len() {
            if members[other].bounds[0].plane > zone.0[1].plane {
                break;
            }
            let apart = members[one].field != members[other].field;
            if apart && zone.touches(members[other].bounds) {
                members[one].near = true;
                members[other].near = true;
            }
        }
    }
    let flows = groups.iter().any(|group| !group.is_elastic());
    members.retain(|member| member.near || member.elastic && flows);
    members.sort_by_key(|member| member.group);
    let union = |a: [Place; 2], b: [Place; 2]| [a[0].lowest(b[0]), a[1].highest(b[1])];
    let elastic = members.iter().filter(|member| member.elastic);
    let Some(all_elastic) = elastic.map(|member| member.bounds).reduce(union) else {
        return Vec::new();
    };
    let zone = Zone::around(all_elastic);
    members.iter().map(|member| (member.group, zone)).collect()
}
