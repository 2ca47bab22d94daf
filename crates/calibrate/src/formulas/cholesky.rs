//! Solver for small symmetric systems of linear equations.

/// Solves `h x = g` for a symmetric, positive definite `k` x `k` matrix `h` by Cholesky's method.
///
/// Returns `x` and the diagonal of the inverse of `h`, or `None` if `h` is not positive definite.
pub(crate) fn solve_cholesky(h: &[f64], g: &[f64], k: usize) -> Option<(Vec<f64>, Vec<f64>)> {
    let mut l = vec![0.0; k * k];
    for i in 0..k {
        for j in 0..=i {
            let dot: f64 = (0..j).map(|m| l[i * k + m] * l[j * k + m]).sum();
            let rest = h[i * k + j] - dot;
            if i == j && (rest.is_nan() || rest <= 0.0) {
                return None;
            }
            l[i * k + j] = if i == j { rest.sqrt() } else { rest / l[j * k + j] };
        }
    }
    let column = |right: &[f64]| {
        let mut y = right.to_vec();
        for i in 0..k {
            let dot: f64 = (0..i).map(|m| l[i * k + m] * y[m]).sum();
            y[i] = (y[i] - dot) / l[i * k + i];
        }
        for i in (0..k).rev() {
            let dot: f64 = (i + 1..k).map(|m| l[m * k + i] * y[m]).sum();
            y[i] = (y[i] - dot) / l[i * k + i];
        }
        y
    };
    let variance = |i: usize| {
        let unit: Vec<f64> = (0..k).map(|j| if i == j { 1.0 } else { 0.0 }).collect();
        column(&unit)[i]
    };
    Some((column(g), (0..k).map(variance).collect()))
}
