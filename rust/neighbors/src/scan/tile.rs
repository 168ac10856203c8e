//! The points around one cell, and which of them are near one of them: the innermost loop of the search.

use std::ops::Range;

use super::cells::{CellList, LANES};
use super::reach::Reach;

/// Result of a scan.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Found {
    pub count: usize,
    /// Some are too near the radius for single precision.
    pub doubtful: bool,
}

/// Copies of the points that may be near those of one cell, in groups of `LANES`.
///
/// All points of the cell are tested against the same groups, the last of which is filled up with points that are
/// nowhere.
#[derive(Debug)]
pub(crate) struct Tile<const D: usize> {
    x: [Vec<[f32; LANES]>; D],
    points: Vec<[u32; LANES]>,
    groups: usize,
    /// Place of the first point of the cell itself.
    first: usize,
}

impl<const D: usize> Tile<D> {
    pub fn new() -> Self {
        Self {
            x: std::array::from_fn(|_| Vec::new()),
            points: Vec::new(),
            groups: 0,
            first: 0,
        }
    }

    /// Most points that a scan can find.
    pub fn room(&self) -> usize {
        self.groups * LANES
    }

    /// Takes the points in `runs` of slots, which are around those in the slots from `own` on.
    pub fn fill(&mut self, list: &CellList<D>, runs: &[Range<usize>], own: usize) {
        let count = runs.iter().map(Range::len).sum::<usize>();
        self.resize(count);
        let mut place = 0;
        for run in runs {
            if run.contains(&own) {
                self.first = place + own - run.start;
            }
            for from in run.clone().step_by(LANES) {
                let to = place + from - run.start;
                copy_group(
                    &list.order[from..],
                    &mut self.points.as_flattened_mut()[to..],
                );
                for (x, copy) in list.x.iter().zip(&mut self.x) {
                    copy_group(&x[from..], &mut copy.as_flattened_mut()[to..]);
                }
            }
            place += run.len();
        }
        self.end(count);
    }

    fn resize(&mut self, count: usize) {
        self.groups = count.div_ceil(LANES);
        // Whole groups are copied, so that the last of a run may reach beyond them.
        let groups = self.groups + 1;
        if self.points.len() < groups {
            self.points.resize(groups, [0; LANES]);
            self.x
                .iter_mut()
                .for_each(|x| x.resize(groups, [0.0; LANES]));
        }
    }

    fn end(&mut self, count: usize) {
        self.x[0].as_flattened_mut()[count..][..LANES].fill(f32::NAN);
    }

    /// Writes the points that may be in reach of the cell's n-th to the front of `into`, which has `room`.
    ///
    /// That one itself is among them if `with_self`.
    pub fn scan(&mut self, n: usize, with_self: bool, reach: &Reach, into: &mut [u32]) -> Found {
        let own = self.first + n;
        let centre = std::array::from_fn(|axis| self.x[axis].as_flattened()[own]);
        if !with_self {
            self.x[0].as_flattened_mut()[own] = f32::NAN;
        }
        let found = self.scan_around(&centre, reach, into);
        self.x[0].as_flattened_mut()[own] = centre[0];
        found
    }

    /// Writes the points that may be in reach of `centre` to the front of `into`, which has `room`.
    pub fn scan_around(&self, centre: &[f32; D], reach: &Reach, into: &mut [u32]) -> Found {
        let x = std::array::from_fn(|axis| &self.x[axis][..self.groups]);
        let points = &self.points[..self.groups];
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2")
            && std::arch::is_x86_feature_detected!("popcnt")
        {
            // SAFETY: the condition above checks for its instructions.
            return unsafe { wide::scan(&x, points, centre, reach, into) };
        }
        scan(&x, points, centre, reach, into)
    }
}

fn copy_group<T: Copy>(from: &[T], to: &mut [T]) {
    to[..LANES].copy_from_slice(&from[..LANES]);
}

fn scan<const D: usize>(
    x: &[&[[f32; LANES]]; D],
    points: &[[u32; LANES]],
    centre: &[f32; D],
    reach: &Reach,
    into: &mut [u32],
) -> Found {
    let (mut count, mut doubtful) = (0, false);
    for (group, points) in points.iter().enumerate() {
        for lane in 0..LANES {
            let squared = (0..D).fold(0.0, |sum, axis| {
                let apart = x[axis][group][lane] - centre[axis];
                sum + apart * apart
            });
            let hit = squared <= reach.most;
            doubtful |= hit & (squared > reach.sure);
            // Written in any case, and kept by counting it: the outcome is too random for a branch.
            into[count] = points[lane];
            count += usize::from(hit);
        }
    }
    Found { count, doubtful }
}

#[cfg(target_arch = "x86_64")]
#[expect(
    clippy::cast_ptr_alignment,
    reason = "the instructions take any address"
)]
mod wide {
    use std::arch::x86_64::{
        __m256i, _CMP_GT_OQ, _CMP_LE_OQ, _mm_loadl_epi64, _mm256_add_ps, _mm256_and_ps,
        _mm256_cmp_ps, _mm256_cvtepu8_epi32, _mm256_loadu_ps, _mm256_loadu_si256,
        _mm256_movemask_ps, _mm256_mul_ps, _mm256_or_ps, _mm256_permutevar8x32_epi32,
        _mm256_set1_ps, _mm256_setzero_ps, _mm256_storeu_si256, _mm256_sub_ps,
    };

    use super::super::reach::Reach;
    use super::{Found, LANES};

    /// Numbers of the lanes in each set of lanes, ascending.
    static CHOSEN: [[u8; LANES]; 1 << LANES] = chosen();

    const fn chosen() -> [[u8; LANES]; 1 << LANES] {
        let mut table = [[0; LANES]; 1 << LANES];
        let mut set = 0;
        while set < table.len() {
            let (mut lane, mut count) = (0, 0);
            while lane < LANES {
                if set >> lane & 1 == 1 {
                    table[set][count] = lane as u8;
                    count += 1;
                }
                lane += 1;
            }
            set += 1;
        }
        table
    }

    #[target_feature(enable = "avx2,popcnt")]
    pub fn scan<const D: usize>(
        x: &[&[[f32; LANES]]; D],
        points: &[[u32; LANES]],
        centre: &[f32; D],
        reach: &Reach,
        into: &mut [u32],
    ) -> Found {
        let mut x = *x;
        // Not in a closure, which would not be compiled for these instructions.
        let mut around = [_mm256_setzero_ps(); D];
        for axis in 0..D {
            x[axis] = &x[axis][..points.len()];
            around[axis] = _mm256_set1_ps(centre[axis]);
        }
        let (most, sure) = (_mm256_set1_ps(reach.most), _mm256_set1_ps(reach.sure));
        let mut doubts = _mm256_setzero_ps();
        let mut count = 0;
        for group in 0..points.len() {
            let mut squared = _mm256_setzero_ps();
            for axis in 0..D {
                // SAFETY: a group has LANES numbers.
                let x = unsafe { _mm256_loadu_ps(x[axis][group].as_ptr()) };
                let apart = _mm256_sub_ps(x, around[axis]);
                squared = _mm256_add_ps(squared, _mm256_mul_ps(apart, apart));
            }
            let near = _mm256_cmp_ps::<_CMP_LE_OQ>(squared, most);
            let unsure = _mm256_cmp_ps::<_CMP_GT_OQ>(squared, sure);
            doubts = _mm256_or_ps(doubts, _mm256_and_ps(near, unsure));
            let hits = _mm256_movemask_ps(near) as usize;
            let kept = &mut into[count..count + LANES];
            // SAFETY: a group, a row of the table and `kept` have LANES entries.
            unsafe {
                let points = _mm256_loadu_si256(points[group].as_ptr().cast::<__m256i>());
                let lanes = _mm_loadl_epi64(CHOSEN[hits].as_ptr().cast());
                let chosen = _mm256_permutevar8x32_epi32(points, _mm256_cvtepu8_epi32(lanes));
                _mm256_storeu_si256(kept.as_mut_ptr().cast::<__m256i>(), chosen);
            }
            count += hits.count_ones() as usize;
        }
        Found {
            count,
            doubtful: _mm256_movemask_ps(doubts) != 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_instructions_find_the_same() {
        let points: Vec<f32> = (0..600)
            .map(|i| (i * 7919 % 1009) as f32 / 1009.0)
            .collect();
        let reach = Reach::new(0.3, true);
        for count in [0, 1, 7, 8, 9, 200] {
            let mut tile = Tile::<3>::new();
            tile.resize(count);
            for i in 0..count {
                let candidate = i * 37 % 200;
                tile.points.as_flattened_mut()[i] = candidate as u32;
                for axis in 0..3 {
                    tile.x[axis].as_flattened_mut()[i] = points[3 * candidate + axis];
                }
            }
            tile.end(count);
            let (mut mine, mut plain) = (vec![0; tile.room()], vec![0; tile.room()]);
            let found = tile.scan_around(&[0.5; 3], &reach, &mut mine);
            let x = std::array::from_fn(|axis| &tile.x[axis][..tile.groups]);
            let expected = scan(
                &x,
                &tile.points[..tile.groups],
                &[0.5; 3],
                &reach,
                &mut plain,
            );
            assert_eq!(mine[..found.count], plain[..expected.count]);
            assert_eq!(found.doubtful, expected.doubtful);
            assert!(found.count > 0 || count < 10);
        }
    }
}
