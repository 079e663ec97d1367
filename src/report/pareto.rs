//! Pareto front of points of which both coordinates should be small.

/// Indices of the points that no other point beats in one coordinate without
/// losing in the other, by ascending x. Equal points are all on the front.
/// Points with a NaN are never on it.
pub fn front(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> =
        (0..points.len()).filter(|i| !points[*i].0.is_nan() && !points[*i].1.is_nan()).collect();
    order.sort_by(|a, b| {
        let ((ax, ay), (bx, by)) = (points[*a], points[*b]);
        ax.total_cmp(&bx).then(ay.total_cmp(&by)).then(a.cmp(b))
    });
    // By ascending x a point is on the front when it is lower than all before,
    // or the same as the last one that was.
    let mut on: Vec<usize> = Vec::new();
    for i in order {
        match on.last() {
            Some(last) if points[i].1 >= points[*last].1 && points[i] != points[*last] => {}
            _ => on.push(i),
        }
    }
    on
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point is dominated when another is no worse in both and better in one.
    fn naive(points: &[(f64, f64)]) -> Vec<usize> {
        let better = |a: (f64, f64), b: (f64, f64)| a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1);
        (0..points.len())
            .filter(|i| !points[*i].0.is_nan() && !points[*i].1.is_nan())
            .filter(|i| !points.iter().any(|p| better(*p, points[*i])))
            .collect()
    }

    #[test]
    fn the_front_equals_its_naive_twin_with_ties_and_strangers() {
        use rand_chacha::rand_core::{RngCore, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        for round in 0..500 {
            // Few distinct values, so that ties are common.
            let mut points: Vec<(f64, f64)> =
                (0..round % 23).map(|_| (f64::from(rng.next_u32() % 6), f64::from(rng.next_u32() % 6))).collect();
            if round % 5 == 0 {
                points.push((f64::NAN, 1.0));
                points.push((2.0, f64::INFINITY));
            }
            let mut found = front(&points);
            found.sort_unstable();
            assert_eq!(found, naive(&points), "{points:?}");
        }
    }
}
