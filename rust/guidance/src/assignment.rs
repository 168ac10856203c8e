//! The assignment problem, solved exactly by shortest augmenting paths.

use threads::interrupted;

const FREE: usize = usize::MAX;

/// Gives each row a column of its own so that the sum of their costs is least.
///
/// `cost(row, column)` is finite; there are at least as many columns as rows. Takes O(rows^2 columns) time. Where it is
/// `interrupted`, each row gets the column of its own number.
///
/// The algorithm is that of Crouse 2016, "On implementing 2D rectangular assignment algorithms", a rectangular
/// form of Jonker and Volgenant 1987 without its heuristics for the first rows.
pub fn assign(rows: usize, columns: usize, cost: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    assert!(rows <= columns, "every row needs a column");
    let table: Vec<f64> = (0..rows)
        .flat_map(|row| (0..columns).map(move |column| (row, column)))
        .map(|(row, column)| cost(row, column))
        .collect();
    let mut row_price = vec![0.0; rows];
    let mut column_price = vec![0.0; columns];
    let mut row_of = vec![FREE; columns];
    let mut column_of = vec![FREE; rows];
    let mut shortest = vec![f64::INFINITY; columns];
    let mut before = vec![0; columns];
    let mut open: Vec<usize> = Vec::with_capacity(columns);
    let mut closed: Vec<usize> = Vec::with_capacity(columns);
    for start in 0..rows {
        if interrupted() {
            return (0..rows).collect();
        }
        shortest.fill(f64::INFINITY);
        open.clear();
        open.extend((0..columns).rev());
        closed.clear();
        let (mut row, mut length) = (start, 0.0);
        let end = loop {
            let base = length - row_price[row];
            let costs = &table[row * columns..][..columns];
            let (mut nearest, mut place) = (f64::INFINITY, 0);
            for (index, &column) in open.iter().enumerate() {
                let through = base + costs[column] - column_price[column];
                if through < shortest[column] {
                    shortest[column] = through;
                    before[column] = row;
                }
                // Among columns as near as each other a free one ends the search at once.
                let better = shortest[column] < nearest
                    || (shortest[column] == nearest && row_of[column] == FREE);
                if better {
                    (nearest, place) = (shortest[column], index);
                }
            }
            length = nearest;
            let column = open.swap_remove(place);
            closed.push(column);
            if row_of[column] == FREE {
                break column;
            }
            row = row_of[column];
        };
        row_price[start] += length;
        for &column in &closed {
            let slack = length - shortest[column];
            column_price[column] -= slack;
            if row_of[column] != FREE {
                row_price[row_of[column]] += slack;
            }
        }
        let mut column = end;
        loop {
            let row = before[column];
            row_of[column] = row;
            std::mem::swap(&mut column_of[row], &mut column);
            if row == start {
                break;
            }
        }
    }
    column_of
}

#[cfg(test)]
mod tests {
    use super::*;

    fn total(columns: &[usize], cost: impl Fn(usize, usize) -> f64) -> f64 {
        columns
            .iter()
            .enumerate()
            .map(|(row, &column)| cost(row, column))
            .sum()
    }

    /// The least cost over all ways, tried one by one.
    fn least(
        row: usize,
        rows: usize,
        taken: &mut Vec<usize>,
        columns: usize,
        cost: &impl Fn(usize, usize) -> f64,
    ) -> f64 {
        if row == rows {
            return 0.0;
        }
        let mut best = f64::INFINITY;
        for column in 0..columns {
            if !taken.contains(&column) {
                taken.push(column);
                best = best.min(cost(row, column) + least(row + 1, rows, taken, columns, cost));
                taken.pop();
            }
        }
        best
    }

    #[test]
    fn no_other_assignment_costs_less() {
        for seed in 0..40_u64 {
            let rows = 1 + (seed % 5) as usize;
            let columns = rows + (seed % 3) as usize;
            let cost = |row: usize, column: usize| {
                let mixed =
                    (seed + 1) * 7919 + (row as u64) * 104_729 + (column as u64) * 1_299_709;
                (mixed.wrapping_mul(6_364_136_223_846_793_005) >> 40) as f64 % 17.0
            };
            let found = assign(rows, columns, cost);
            let mut distinct = found.clone();
            distinct.sort_unstable();
            distinct.dedup();
            assert_eq!(distinct.len(), rows);
            let best = least(0, rows, &mut Vec::new(), columns, &cost);
            assert!((total(&found, cost) - best).abs() < 1e-9, "seed {seed}");
        }
    }

    #[test]
    fn shifted_points_keep_their_order() {
        let found = assign(50, 50, |row, column| {
            (column as f64 - row as f64 - 3.5).powi(2)
        });
        assert_eq!(found, (0..50).collect::<Vec<_>>());
    }
}
