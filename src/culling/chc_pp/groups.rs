//! Which hidden nodes share a query (the multiqueries of CHC++).
//!
//! A node that has stayed as it is for `i` frames stays so with the chance 0.99 - 0.7
//! e^-i (the paper's fit). A query of a set M fails if any member changes, then each is
//! asked about by itself: cost 1 + p_fail |M|, use |M|. Sets grow, the most certain
//! members first, as long as use over cost rises. A set of one costs 1, as its failure
//! asks nobody again.

/// The chance to stay as it is after `i` frames without a change.
pub fn p_keep(i: u32) -> f64 {
    0.99 - 0.7 * libm::exp(-f64::from(i))
}

/// Use over cost of a set of `n` nodes that all stay with the chance `p_all`.
pub fn value(n: u32, p_all: f64) -> f64 {
    let n = f64::from(n);
    let cost = if n == 1.0 { 1.0 } else { 1.0 + (1.0 - p_all) * n };
    n / cost
}

/// How many of the first nodes make the first set; `ages` are their frames without a
/// change, descending. At least 1.
pub fn first_group(ages: impl Iterator<Item = u32>) -> usize {
    let (mut n, mut p_all, mut best) = (0, 1.0, 0.0);
    for age in ages {
        let p = p_all * p_keep(age);
        let v = value(n + 1, p);
        if v <= best {
            break;
        }
        (n, p_all, best) = (n + 1, p, v);
    }
    n.max(1) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    // D2.1
    #[test]
    fn sets_of_equal_age_have_the_published_sizes() {
        let size = |age: u32| first_group(std::iter::repeat_n(age, 100));
        let table = [(0, 1), (1, 3), (2, 4), (3, 5), (4, 7), (5, 9), (6, 10), (9, 10), (10, 11), (1000, 11)];
        for (age, expected) in table {
            assert_eq!(size(age), expected, "after {age} frames");
        }
        assert!((value(3, p_keep(1).powi(3)) - 1.06).abs() < 0.005);
        assert!((value(11, p_keep(50).powi(11)) - 5.11).abs() < 0.005);
        assert_eq!(size(0), 1, "fresh nodes are not thrown together");
        assert_eq!(first_group([7].into_iter()), 1);
    }

    #[test]
    fn no_other_prefix_has_a_higher_value_up_to_where_it_stops() {
        let ages = [30, 30, 9, 9, 5, 4, 4, 2, 1, 1, 0, 0, 0];
        for from in 0..ages.len() {
            let n = first_group(ages[from..].iter().copied());
            let of = |k: usize| value(k as u32, ages[from..from + k].iter().map(|a| p_keep(*a)).product());
            assert!((1..=n).all(|k| of(k) <= of(n)));
            assert!(from + n == ages.len() || of(n + 1) <= of(n));
        }
    }
}
