//! A [`Figure`] to PNG, a band of rows at a time: what a chart costs in memory does not
//! depend on how many runs it shows.

use super::figure::{Figure, Mark};
use super::font;
use super::render::{Baseline, draw};
use crate::error::{Error, Result};
use plotters::prelude::{BitMapBackend, DrawingBackend, IntoDrawingArea};
use plotters_backend::{BackendColor, BackendCoord, BackendStyle, DrawingErrorKind};
use std::io::Write;

/// PNG pixels a figure pixel.
const PNG_SCALE: usize = 2;
/// Samples a PNG pixel and axis: plotters smooths only hairlines by itself.
const PNG_SAMPLES: usize = 2;
/// Rows of a PNG that are painted at a time.
const BAND_ROWS: usize = 256;

/// An RGB PNG at twice the figure's size.
pub fn png(figure: &Figure) -> Result<Vec<u8>> {
    let (w, h) = png_size(figure);
    let mut out = Vec::new();
    let bad = |e: png::EncodingError| Error::new(format!("cannot encode {}.png: {e}", figure.id));
    let mut encoder = png::Encoder::new(&mut out, w as u32, h as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    // Of drawings with large even areas: smaller than the usual setting, in half its time.
    encoder.set_filter(png::Filter::NoFilter);
    encoder.set_deflate_compression(png::DeflateCompression::Level(4));
    // 2 pixels a figure pixel of 1/96 inch.
    let per_metre = (96.0 * PNG_SCALE as f64 / 0.0254).round() as u32;
    encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: per_metre, yppu: per_metre, unit: png::Unit::Meter }));
    let mut writer = encoder.write_header().map_err(bad)?;
    let mut rows = writer.stream_writer().map_err(bad)?;
    paint(figure, BAND_ROWS, |pixels| rows.write_all(pixels).map_err(|e| bad(e.into())))?;
    rows.finish().map_err(bad)?;
    writer.finish().map_err(bad)?;
    Ok(out)
}

fn png_size(figure: &Figure) -> (usize, usize) {
    let size = |x: f64| (x.ceil() as usize) * PNG_SCALE;
    (size(figure.width), size(figure.height))
}

/// Hands over the pixels of a figure from the top, so many rows at a time: a chart of a
/// thousand runs is 16,000 pixels high, and its samples at once would be 390 MB.
fn paint(figure: &Figure, band_rows: usize, mut row: impl FnMut(&[u8]) -> Result<()>) -> Result<()> {
    font::register();
    let (w, h) = png_size(figure);
    let scale = (PNG_SCALE * PNG_SAMPLES) as f64;
    let mut fine = Vec::new();
    for top in (0..h).step_by(band_rows) {
        let rows = band_rows.min(h - top);
        // White from the start: the paper needs no painting.
        fine.clear();
        fine.resize(3 * w * rows * PNG_SAMPLES * PNG_SAMPLES, 255u8);
        let (from, to) = (top as f64 / PNG_SCALE as f64, (top + rows) as f64 / PNG_SCALE as f64);
        let marks = figure.marks.iter().filter(|m| {
            let (low, high) = reach(m);
            low <= to && high >= from
        });
        let size = ((w * PNG_SAMPLES) as u32, (rows * PNG_SAMPLES) as u32);
        {
            let whole = ((w * PNG_SAMPLES) as u32, (h * PNG_SAMPLES) as u32);
            let band = BitMapBackend::with_buffer(&mut fine, size);
            let root = Band { band, top: (top * PNG_SAMPLES) as i32, whole }.into_drawing_area();
            draw((&figure.id, marks), &root, scale, font::HEIGHT_EM, Baseline::HalfSizeBelow, false)?;
        }
        row(&average(&fine, w))?;
    }
    Ok(())
}

/// From where to where a mark may be seen, downward; rather too far.
fn reach(mark: &Mark) -> (f64, f64) {
    let of = |points: &[(f64, f64)], more: f64| {
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = points.iter().fold(ends, |(low, high), p| (low.min(p.1), high.max(p.1)));
        (low - more, high + more)
    };
    match mark {
        // A joint of a line may stand out by a multiple of its width.
        Mark::Line { points, width, .. } => of(points, 16.0 * width + 2.0),
        Mark::Polygon { points, .. } => of(points, 2.0),
        Mark::Circle { y, radius, .. } => (y - radius - 2.0, y + radius + 2.0),
        Mark::Text { upright: true, .. } => (f64::NEG_INFINITY, f64::INFINITY),
        Mark::Text { y, style, .. } => (y - 3.0 * style.size, y + 3.0 * style.size),
    }
}

/// Mean of each square of samples.
fn average(fine: &[u8], w: usize) -> Vec<u8> {
    const { assert!(PNG_SAMPLES == 2) };
    let mut out = Vec::with_capacity(fine.len() / 4);
    for rows in fine.chunks_exact(2 * 6 * w) {
        let (upper, lower) = rows.split_at(6 * w);
        for (u, l) in upper.chunks_exact(6).zip(lower.chunks_exact(6)) {
            let mean = |c: usize| {
                let sum = [u[c], u[c + 3], l[c], l[c + 3]].map(u32::from);
                (sum.iter().sum::<u32>() / 4) as u8
            };
            out.extend([mean(0), mean(1), mean(2)]);
        }
    }
    out
}

/// Some rows of a picture, which plotters takes for all of it: its rasteriser rounds and
/// clips by absolute places, so that a picture moved by a band would be another one.
struct Band<'a> {
    band: BitMapBackend<'a>,
    /// Its first row.
    top: i32,
    whole: (u32, u32),
}

impl<'a> DrawingBackend for Band<'a> {
    type ErrorType = <BitMapBackend<'a> as DrawingBackend>::ErrorType;

    fn get_size(&self) -> (u32, u32) {
        self.whole
    }

    fn ensure_prepared(&mut self) -> std::result::Result<(), DrawingErrorKind<Self::ErrorType>> {
        self.band.ensure_prepared()
    }

    fn present(&mut self) -> std::result::Result<(), DrawingErrorKind<Self::ErrorType>> {
        self.band.present()
    }

    fn draw_pixel(
        &mut self,
        (x, y): BackendCoord,
        colour: BackendColor,
    ) -> std::result::Result<(), DrawingErrorKind<Self::ErrorType>> {
        self.band.draw_pixel((x, y - self.top), colour)
    }

    fn draw_line<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
    ) -> std::result::Result<(), DrawingErrorKind<Self::ErrorType>> {
        if (from.0 == to.0 || from.1 == to.1) && style.stroke_width() == 1 {
            // Hairlines along an axis are what fills polygons; the bitmap has a fast way for them.
            return self.band.draw_line((from.0, from.1 - self.top), (to.0, to.1 - self.top), style);
        }
        plotters_backend::rasterizer::draw_line(self, from, to, style)
    }
}

#[cfg(test)]
mod tests {
    use super::super::figure::{Anchor, TextStyle};
    use super::super::style::Colour;
    use super::*;

    fn painted(figure: &Figure, band_rows: usize) -> Vec<u8> {
        let mut all = Vec::new();
        paint(figure, band_rows, |rows| {
            all.extend_from_slice(rows);
            Ok(())
        })
        .unwrap();
        all
    }

    /// The naive twin: all samples in one bitmap of plotters' own.
    fn at_once(figure: &Figure) -> Vec<u8> {
        font::register();
        let (w, h) = png_size(figure);
        let mut fine = vec![255u8; 3 * w * h * PNG_SAMPLES * PNG_SAMPLES];
        {
            let size = ((w * PNG_SAMPLES) as u32, (h * PNG_SAMPLES) as u32);
            let root = BitMapBackend::with_buffer(&mut fine, size).into_drawing_area();
            let scale = (PNG_SCALE * PNG_SAMPLES) as f64;
            draw((&figure.id, &figure.marks), &root, scale, font::HEIGHT_EM, Baseline::HalfSizeBelow, false).unwrap();
        }
        average(&fine, w)
    }

    #[test]
    fn bands_make_the_picture_that_is_painted_at_once() {
        let mut figure = Figure::new("bands", "", 90.0, 70.5);
        let style = TextStyle { size: 11.0, colour: 0x203040, alpha: 0.9, bold: false, anchor: Anchor::Middle };
        let mut seed = 1u32;
        let mut draw = |most: f64| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 8) / f64::from(1 << 24) * most
        };
        for i in 0..60 {
            // Some of them beyond the edges.
            let points: Vec<(f64, f64)> = (0..3).map(|_| (draw(110.0) - 10.0, draw(90.0) - 10.0)).collect();
            let (colour, alpha, (x, y)) = (draw(16e6) as Colour, 0.2 + draw(0.8), points[0]);
            figure.marks.push(match i % 5 {
                0 => Mark::Line { points, colour, width: 0.3 + draw(5.0), alpha },
                1 => Mark::Polygon { points, colour, alpha },
                // plotters draws no circle right whose centre lies above the picture.
                2 => Mark::Circle { x, y: y.max(0.0), radius: draw(15.0), colour, alpha },
                n => Mark::Text { x, y, text: "Quantity gjy Ä".into(), style, upright: n == 3 },
            });
        }
        let whole = at_once(&figure);
        assert_eq!(whole.len(), 3 * 180 * 142);
        assert!(whole.iter().any(|b| *b != 255));
        for band_rows in [1, 7, 64, 1000] {
            let bands = painted(&figure, band_rows);
            let differ = whole.iter().zip(&bands).filter(|(a, b)| a != b).count();
            assert_eq!((bands.len(), differ), (whole.len(), 0), "bands of {band_rows} rows");
        }
    }
}
