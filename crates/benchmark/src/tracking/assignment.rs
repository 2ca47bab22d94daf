//! The linear assignment problem.

/// Returns the pairs of a row and a column that maximize the sum of the scores. Each row and each column occurs at most
/// once, and the number of pairs is the smaller side of the matrix.
///
/// The algorithm adds one row at a time along the shortest augmenting path (D. F. Crouse, "On implementing 2D rectangular
/// assignment algorithms", IEEE Transactions on Aerospace and Electronic Systems 52, 2016). Ties have the same result as
/// in SciPy: columns are searched from last to first, and a free column has priority.
pub(super) fn assign(scores: &[Vec<f64>]) -> Vec<(usize, usize)> {
    let (rows, columns) = (scores.len(), scores.first().map_or(0, Vec::len));
    if columns < rows {
        let transposed: Vec<Vec<f64>> =
            (0..columns).map(|j| scores.iter().map(|row| row[j]).collect()).collect();
        let mut pairs: Vec<(usize, usize)> = assign(&transposed).into_iter().map(|(j, i)| (i, j)).collect();
        pairs.sort_unstable();
        return pairs;
    }
    // Dual variables of the rows and columns.
    let (mut u, mut v) = (vec![0.0; rows], vec![0.0; columns]);
    let (mut column_of, mut row_of) = (vec![usize::MAX; rows], vec![None::<usize>; columns]);
    for start in 0..rows {
        let mut shortest = vec![f64::INFINITY; columns];
        let mut previous_row = vec![usize::MAX; columns];
        let mut open: Vec<usize> = (0..columns).rev().collect();
        let (mut visited_rows, mut visited_columns) = (Vec::new(), Vec::new());
        let (mut row, mut length) = (start, 0.0);
        let end = loop {
            visited_rows.push(row);
            let (mut nearest, mut lowest) = (0, f64::INFINITY);
            for (k, j) in open.iter().enumerate() {
                // The cost is the negative score.
                let reduced = length - scores[row][*j] - u[row] - v[*j];
                if reduced < shortest[*j] {
                    shortest[*j] = reduced;
                    previous_row[*j] = row;
                }
                if shortest[*j] < lowest || (shortest[*j] == lowest && row_of[*j].is_none()) {
                    (nearest, lowest) = (k, shortest[*j]);
                }
            }
            length = lowest;
            let column = open.swap_remove(nearest);
            visited_columns.push(column);
            match row_of[column] {
                Some(taken_by) => row = taken_by,
                None => break column,
            }
        };
        for i in visited_rows {
            u[i] += if i == start { length } else { length - shortest[column_of[i]] };
        }
        for j in visited_columns {
            v[j] -= length - shortest[j];
        }
        let mut column = end;
        loop {
            let i = previous_row[column];
            row_of[column] = Some(i);
            std::mem::swap(&mut column_of[i], &mut column);
            if i == start {
                break;
            }
        }
    }
    column_of.into_iter().enumerate().collect()
}

#[cfg(test)]
mod tests {
    use super::assign;

    /// Returns the largest sum over all assignments.
    fn best_sum(scores: &[Vec<f64>], used: &mut Vec<bool>) -> f64 {
        let Some((first, rest)) = scores.split_first() else { return 0.0 };
        let mut best =
            if scores.len() > used.iter().filter(|u| !**u).count() { best_sum(rest, used) } else { f64::MIN };
        for j in 0..first.len() {
            if !used[j] {
                used[j] = true;
                best = best.max(first[j] + best_sum(rest, used));
                used[j] = false;
            }
        }
        best
    }

    #[test]
    fn an_assignment_is_optimal_among_all() {
        let mut state = 9_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            // Scores of few values have many ties.
            ((state >> 33) % 7) as f64 / 7.0
        };
        for (rows, columns) in [(1, 1), (3, 3), (5, 5), (2, 5), (5, 2), (6, 4), (0, 0)] {
            for _ in 0..20 {
                let scores: Vec<Vec<f64>> =
                    (0..rows).map(|_| (0..columns).map(|_| random()).collect()).collect();
                let pairs = assign(&scores);
                assert_eq!(pairs.len(), rows.min(columns));
                let sum: f64 = pairs.iter().map(|(i, j)| scores[*i][*j]).sum();
                let best = best_sum(&scores, &mut vec![false; columns]);
                assert!((sum - best).abs() < 1e-12, "{sum} for {best}: {scores:?}");
            }
        }
    }
}
