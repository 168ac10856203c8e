//! The graph as a table with as many columns as the most neighbours.

use crate::error::GraphError;

/// Most neighbours of a point, which must not be more than `limit`; `argument` is what sets that.
pub fn most_neighbors(
    starts: &[u32],
    limit: usize,
    argument: &'static str,
) -> Result<usize, GraphError> {
    let lengths = starts.windows(2).map(|pair| (pair[1] - pair[0]) as usize);
    let mut most = 0;
    for (point, neighbors) in lengths.enumerate() {
        if neighbors > limit {
            return Err(GraphError::Width {
                point,
                neighbors,
                limit,
                argument,
            });
        }
        most = most.max(neighbors);
    }
    Ok(most)
}

/// Writes the senders of point i to the front of row i of `neighbors`, and its own index behind them.
///
/// `mask` is true where there is a neighbour. Both have N rows of `width` columns, which is enough.
pub fn write_padded(
    starts: &[u32],
    senders: &[u32],
    width: usize,
    neighbors: &mut [i32],
    mask: &mut [bool],
) {
    if width == 0 {
        return;
    }
    let rows = neighbors
        .chunks_exact_mut(width)
        .zip(mask.chunks_exact_mut(width));
    for ((own, range), (row, mask)) in (0i32..).zip(starts.windows(2)).zip(rows) {
        let senders = &senders[range[0] as usize..range[1] as usize];
        let (there, rest) = row.split_at_mut(senders.len());
        for (neighbor, &sender) in there.iter_mut().zip(senders) {
            *neighbor = sender as i32;
        }
        rest.fill(own);
        mask[..senders.len()].fill(true);
        mask[senders.len()..].fill(false);
    }
}
