//! Non-negative least squares, small and dense.

/// `x >= 0` that makes the sum of squares of `rows x - b` least, by cyclic coordinate
/// descent on the normal equations: each step is exact in one unknown, the sum never
/// grows, and for a handful of unknowns thousands of sweeps cost nothing. Columns are
/// scaled to length 1 first; a column of zeros gets 0. Ends when a sweep moves nothing
/// by more than 1e-12 of the largest, after at most 100,000 sweeps.
///
/// # Panics
/// If rows differ in length, or there are not as many values as rows.
pub fn nnls(rows: &[Vec<f64>], b: &[f64]) -> Vec<f64> {
    assert_eq!(rows.len(), b.len(), "a value for each row");
    let n = rows.first().map_or(0, Vec::len);
    assert!(rows.iter().all(|r| r.len() == n), "rows of one length");
    let length: Vec<f64> = (0..n).map(|j| rows.iter().map(|r| r[j] * r[j]).sum::<f64>().sqrt()).collect();
    let unit = |r: &[f64], j: usize| if length[j] > 0.0 { r[j] / length[j] } else { 0.0 };
    let dot = |i: usize, j: usize| rows.iter().map(|r| unit(r, i) * unit(r, j)).sum::<f64>();
    let gram: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| dot(i, j)).collect()).collect();
    let target: Vec<f64> = (0..n).map(|j| rows.iter().zip(b).map(|(r, b)| unit(r, j) * b).sum()).collect();
    let mut x = vec![0.0f64; n];
    for _ in 0..100_000 {
        let mut moved = 0.0f64;
        for j in (0..n).filter(|j| length[*j] > 0.0) {
            let others: f64 = (0..n).filter(|i| *i != j).map(|i| gram[j][i] * x[i]).sum();
            let new = ((target[j] - others) / gram[j][j]).max(0.0);
            moved = moved.max((new - x[j]).abs());
            x[j] = new;
        }
        if moved <= 1e-12 * x.iter().fold(f64::MIN_POSITIVE, |m, x| m.max(*x)) {
            break;
        }
    }
    x.iter().zip(&length).map(|(x, l)| if *l > 0.0 { x / l } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_finds_what_made_the_values_and_never_a_negative_share() {
        let rows: Vec<Vec<f64>> = (0..40).map(|i| vec![1.0, f64::from(i), f64::from(i * i % 7) * 1e3, 0.0]).collect();
        let made = |x: [f64; 3]| -> Vec<f64> { rows.iter().map(|r| r[0] * x[0] + r[1] * x[1] + r[2] * x[2]).collect() };
        let found = nnls(&rows, &made([3.0, 0.5, 2e-3]));
        for (f, want) in found.iter().zip([3.0, 0.5, 2e-3, 0.0]) {
            assert!((f - want).abs() <= 1e-6 * (1.0 + want), "{found:?}");
        }
        // Best with a negative share: the share is 0, the others make the most of it.
        let held = nnls(&rows, &made([3.0, 0.5, -2e-3]));
        assert!(held[2] == 0.0 && held.iter().all(|x| *x >= 0.0), "{held:?}");
        assert!(nnls(&[], &[]).is_empty());
    }
}
