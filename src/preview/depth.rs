//! A depth buffer to look at: near is bright, far is dark, and where nothing is is blue.

use super::Image;

const NOTHING: [u8; 4] = [22, 34, 72, 255];
const DARKEST: f64 = 38.0;

/// Of `nearness` row by row from the top, larger is nearer: `1 / depth`, or `-depth` of
/// parallel rays; negative infinity where nothing was drawn.
pub fn depth(width: u32, height: u32, nearness: &[f32]) -> Image {
    // Of 1/depth equal steps would all be spent on the first metres: by its logarithm
    // each doubling of the distance darkens as much.
    let step = |n: f32| if n > 0.0 { f64::from(n).ln() } else { f64::from(n) };
    let drawn = nearness.iter().filter(|n| n.is_finite()).map(|n| step(*n));
    let (low, high) = drawn.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), s| (l.min(s), h.max(s)));
    let span = if high > low { high - low } else { 1.0 };
    let pixel = |n: &f32| {
        if !n.is_finite() {
            return NOTHING;
        }
        let grey = (DARKEST + (255.0 - DARKEST) * (step(*n) - low) / span).round() as u8;
        [grey, grey, grey, 255]
    };
    Image { width, height, rgba: nearness.iter().flat_map(pixel).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_is_brighter_and_nothing_is_blue() {
        let image = depth(4, 1, &[1.0, 0.1, 0.01, f32::NEG_INFINITY]);
        let grey = |i: usize| image.rgba[4 * i];
        assert_eq!((grey(0), grey(2)), (255, 38));
        assert_eq!(grey(1), 147, "half way between, by factors");
        assert_eq!(image.rgba[12..], NOTHING);
        let parallel = depth(3, 1, &[-5.0, -10.0, -15.0]);
        assert_eq!([parallel.rgba[0], parallel.rgba[4], parallel.rgba[8]], [255, 147, 38]);
    }
}
