//! Sorting short rows.

/// Length of an array so that a row of `length` at its front may be sorted.
pub(crate) fn room(length: usize) -> usize {
    length + 8
}

/// Writes the first `length` entries of `row`, which differ and have 31 bits, in ascending order to `into`.
///
/// `row` has `room`, `into` is as long as the row.
pub(crate) fn write_sorted(row: &[u32], length: usize, into: &mut [u32]) {
    #[cfg(target_arch = "x86_64")]
    if length <= wide::LONGEST && std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the condition above checks for its instructions.
        return unsafe { wide::write_sorted(row, length, into) };
    }
    into.copy_from_slice(&row[..length]);
    into.sort_unstable();
}

#[cfg(target_arch = "x86_64")]
#[expect(
    clippy::cast_ptr_alignment,
    reason = "the instructions take any address"
)]
mod wide {
    use std::arch::x86_64::{
        __m256i, _mm256_cmpgt_epi32, _mm256_loadu_si256, _mm256_set1_epi32, _mm256_setzero_si256,
        _mm256_storeu_si256, _mm256_sub_epi32,
    };

    /// Longer rows are faster sorted by comparing two at a time.
    pub const LONGEST: usize = 64;

    #[target_feature(enable = "avx2")]
    pub fn write_sorted(row: &[u32], length: usize, into: &mut [u32]) {
        match length.div_ceil(8) {
            0 => {}
            1 => by_rank::<1>(row, length, into),
            2 => by_rank::<2>(row, length, into),
            3 => by_rank::<3>(row, length, into),
            4 => by_rank::<4>(row, length, into),
            5 => by_rank::<5>(row, length, into),
            6 => by_rank::<6>(row, length, into),
            7 => by_rank::<7>(row, length, into),
            _ => by_rank::<8>(row, length, into),
        }
    }

    /// Counts for each entry of W vectors how many are smaller: quadratic, but without a branch.
    #[target_feature(enable = "avx2")]
    fn by_rank<const W: usize>(row: &[u32], length: usize, into: &mut [u32]) {
        let vectors = row
            .as_chunks()
            .0
            .first_chunk::<W>()
            .expect("room behind the row");
        let mut entries = [_mm256_setzero_si256(); W];
        let mut ranks = [_mm256_setzero_si256(); W];
        for (entry, vector) in entries.iter_mut().zip(vectors) {
            let vector: &[u32; 8] = vector;
            // SAFETY: `vector` has eight numbers.
            *entry = unsafe { _mm256_loadu_si256(vector.as_ptr().cast::<__m256i>()) };
        }
        for &other in &row[..length] {
            let other = _mm256_set1_epi32(other as i32);
            for k in 0..W {
                // A true comparison is -1.
                ranks[k] = _mm256_sub_epi32(ranks[k], _mm256_cmpgt_epi32(entries[k], other));
            }
        }
        let mut places = [[0u32; 8]; W];
        for (place, rank) in places.iter_mut().zip(ranks) {
            // SAFETY: `place` has eight numbers.
            unsafe { _mm256_storeu_si256(place.as_mut_ptr().cast::<__m256i>(), rank) };
        }
        // Entries behind the row have ranks too, but are not written.
        for (&entry, &place) in row[..length].iter().zip(places.as_flattened()) {
            into[place as usize] = entry;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_all_lengths_are_sorted() {
        for length in 0..100 {
            let entry = |i| (i as u32).wrapping_mul(0x9e37_79b1) >> 1;
            let row: Vec<u32> = (0..room(length)).map(entry).collect();
            let (mut sorted, mut expected) = (vec![0; length], row[..length].to_vec());
            write_sorted(&row, length, &mut sorted);
            expected.sort_unstable();
            assert_eq!(sorted, expected);
        }
    }
}
