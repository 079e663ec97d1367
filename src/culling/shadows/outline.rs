//! Convex polygons of the image plane, and cutting them along lines.

/// `line . (x, y, 1)`: with a normal of length 1 the distance from the line, positive on
/// one side.
pub type Line = [f64; 3];

#[inline]
pub fn distance(line: &Line, p: [f64; 2]) -> f64 {
    line[0] * p[0] + line[1] * p[1] + line[2]
}

/// Room for corners. A cut adds one at most.
const MOST: usize = 24;

#[derive(Debug, Clone, Copy)]
pub struct Outline {
    len: usize,
    corners: [[f64; 2]; MOST],
}

impl Outline {
    pub const EMPTY: Outline = Outline { len: 0, corners: [[0.0; 2]; MOST] };

    pub fn rectangle(half: [f64; 2]) -> Outline {
        let [x, y] = half;
        [[-x, -y], [x, -y], [x, y], [-x, y]].into_iter().collect()
    }

    pub fn corners(&self) -> &[[f64; 2]] {
        &self.corners[..self.len]
    }

    #[inline]
    pub fn push(&mut self, p: [f64; 2]) {
        self.corners[self.len] = p;
        self.len += 1;
    }

    /// The least and the greatest distance of a corner.
    #[inline]
    pub fn range(&self, line: &Line) -> (f64, f64) {
        self.corners().iter().map(|p| distance(line, *p)).fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), d| {
            (if d < lo { d } else { lo }, if d > hi { d } else { hi })
        })
    }

    /// The part at distance `at` or more (Sutherland & Hodgman 1974); `None` if it has too
    /// many corners.
    pub fn above(&self, line: &Line, at: f64) -> Option<Outline> {
        let mut out = Outline::EMPTY;
        let Some(mut a) = self.corners().last().copied() else { return Some(out) };
        let mut from = distance(line, a) - at;
        for b in self.corners().iter().copied() {
            let to = distance(line, b) - at;
            if out.len + 2 > MOST {
                return None;
            }
            if (from < 0.0) != (to < 0.0) {
                let part = from / (from - to);
                out.push([a[0] + (b[0] - a[0]) * part, a[1] + (b[1] - a[1]) * part]);
            }
            if to >= 0.0 {
                out.push(b);
            }
            (a, from) = (b, to);
        }
        Some(out)
    }

    /// The part at distance `at` or less.
    pub fn below(&self, line: &Line, at: f64) -> Option<Outline> {
        self.above(&line.map(|x| -x), -at)
    }

    pub fn area(&self) -> f64 {
        let c = self.corners();
        let across = |i: usize| {
            let (a, b) = (c[i], c[i + 1]);
            (a[0] - c[0][0]) * (b[1] - c[0][1]) - (a[1] - c[0][1]) * (b[0] - c[0][0])
        };
        (1..self.len.saturating_sub(1)).map(across).sum::<f64>().abs() * 0.5
    }
}

impl FromIterator<[f64; 2]> for Outline {
    /// # Panics
    /// If there are too many corners.
    fn from_iter<I: IntoIterator<Item = [f64; 2]>>(corners: I) -> Outline {
        let mut out = Outline::EMPTY;
        corners.into_iter().for_each(|p| out.push(p));
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_gives_two_parts_of_the_whole() {
        let square = Outline::rectangle([1.0, 1.0]);
        assert_eq!(square.area(), 4.0);
        let slope = [0.6, 0.8, -0.1];
        let [a, b] = [square.above(&slope, 0.0).unwrap(), square.below(&slope, 0.0).unwrap()];
        assert!((a.area() + b.area() - 4.0).abs() < 1e-12);
        assert!(a.range(&slope).0 > -1e-12 && b.range(&slope).1 < 1e-12);
        assert_eq!(square.above(&[1.0, 0.0, 0.0], 2.0).unwrap().corners().len(), 0);
        assert_eq!(square.above(&[1.0, 0.0, 0.0], -1.0).unwrap().corners(), square.corners());
    }

    #[test]
    fn too_many_corners_are_none_rather_than_wrong() {
        let mut circle = Outline::rectangle([2.0, 2.0]);
        let mut cuts = 0;
        for k in 0..64 {
            let (s, c) = (f64::from(k) * 0.1).sin_cos();
            match circle.above(&[-c, -s, 1.0], 0.0) {
                Some(part) => circle = part,
                None => break,
            }
            cuts += 1;
        }
        assert!((15..64).contains(&cuts), "{cuts}");
    }
}
