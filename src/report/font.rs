//! The embedded font: charts look the same on a machine without any fonts.
//! Inter (SIL OFL 1.1), subset to Latin, Greek and mathematical signs.

use plotters::style::{FontFamily, FontStyle, register_font};
use std::sync::Once;

static REGULAR: &[u8] = include_bytes!("assets/Inter-Regular.otf");
static BOLD: &[u8] = include_bytes!("assets/Inter-SemiBold.otf");
pub static REGULAR_WOFF2: &[u8] = include_bytes!("assets/Inter-Regular.woff2");
pub static BOLD_WOFF2: &[u8] = include_bytes!("assets/Inter-SemiBold.woff2");

/// Name the font has in plotters; in an SVG it is replaced by [`STACK`].
pub const FAMILY: &str = "inter";
pub const STACK: &str = "Inter, 'Helvetica Neue', Helvetica, Arial, 'DejaVu Sans', sans-serif";

/// Ascender minus descender over the em: the size plotters' rasteriser wants is
/// this height, while SVG and people count in ems.
pub const HEIGHT_EM: f64 = (2728.0 + 680.0) / 2816.0;

/// Registers the fonts with plotters, once.
pub fn register() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let fonts = [(FontStyle::Normal, REGULAR), (FontStyle::Bold, BOLD)];
        for (style, bytes) in fonts {
            assert!(register_font(FAMILY, style, bytes).is_ok(), "the embedded font is readable");
        }
    });
}

/// `text`, or as much of its beginning as fits into `room`, with an ellipsis.
pub fn clipped(text: &str, size: f64, bold: bool, room: f64) -> String {
    if width(text, size, bold) <= room {
        return text.to_string();
    }
    let mut out = String::new();
    for c in text.chars() {
        if width(&format!("{out}{c}…"), size, bold) > room {
            break;
        }
        out.push(c);
    }
    out.trim_end().to_string() + "…"
}

/// Advance of `text` at em size `size`, in the same unit.
pub fn width(text: &str, size: f64, bold: bool) -> f64 {
    register();
    let style = if bold { FontStyle::Bold } else { FontStyle::Normal };
    // plotters cuts widths to whole pixels, so ask at 1000 a em.
    let font = plotters::style::FontDesc::new(FontFamily::Name(FAMILY), 1000.0 * HEIGHT_EM, style);
    font.box_size(text).map_or(0.0, |(w, _)| f64::from(w) / 1000.0 * size)
}
