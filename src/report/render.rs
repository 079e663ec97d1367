//! A [`Figure`] to SVG through plotters, and what drawing one on any of its backends takes.

use super::figure::{Anchor, Figure, Mark, TextStyle};
use super::font;
use super::format::html;
use super::style::{Colour, Look, PAPER};
use crate::error::{Error, Result};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// plotters places by whole pixels, even in SVG: everything is drawn this much
/// larger and the view box scales it back, or curves would wobble.
const SVG_FINE: f64 = 10.0;

/// The SVG text. `paper` paints the background, for files that stand alone.
pub fn svg(figure: &Figure, paper: bool) -> Result<String> {
    font::register();
    let mut body = String::new();
    if paper {
        body += &layer(figure, &[], true)?;
    }
    let mut at = 0;
    for tag in &figure.tags {
        let (start, end) = (tag.marks.start, tag.marks.end);
        body += &layer(figure, &figure.marks[at..start], false)?;
        let data: Vec<String> = tag.data.iter().map(|(k, v)| format!(" data-{k}=\"{}\"", html(v))).collect();
        body += &format!("<g{}>\n<title>{}</title>\n", data.concat(), html(&tag.title));
        body += &layer(figure, &figure.marks[start..end], false)?;
        body += "</g>\n";
        at = end;
    }
    body += &layer(figure, &figure.marks[at..], false)?;
    Ok(finish_svg(&body, figure))
}

/// Some marks as SVG elements, without the document around them.
fn layer(figure: &Figure, marks: &[Mark], paper: bool) -> Result<String> {
    if marks.is_empty() && !paper {
        return Ok(String::new());
    }
    let size = |x: f64| (x * SVG_FINE).round() as u32;
    let mut out = String::new();
    {
        let root = SVGBackend::with_string(&mut out, (size(figure.width), size(figure.height))).into_drawing_area();
        // plotters writes the em as size / 1.24 whatever the font is.
        draw((&figure.id, marks), &root, SVG_FINE, 1.24, Baseline::AtAnchor, paper)?;
    }
    let start = out.find('>').map_or(0, |i| i + 1);
    let end = out.rfind("</svg>").unwrap_or(out.len());
    Ok(out[start..end].trim_start_matches('\n').to_string())
}

/// A marker to stand before a name in the text of a page.
pub fn swatch(look: Look) -> String {
    let mut figure = Figure::new("swatch", "", 12.0, 12.0);
    figure.marker(6.0, 6.0, 4.4, look.shape, look.colour, 1.0);
    let body = match figure.marks.first() {
        Some(Mark::Polygon { points, .. }) => {
            let points: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
            format!("<polygon points=\"{}\" fill=\"#{:06X}\"/>", points.join(" "), look.colour)
        }
        _ => format!("<circle cx=\"6\" cy=\"6\" r=\"4.4\" fill=\"#{:06X}\"/>", look.colour),
    };
    format!("<svg class=\"w\" width=\"12\" height=\"12\" aria-hidden=\"true\">{body}</svg> ")
}

/// Gives the document its real size, a title and a description for screen
/// readers, the font stack, and text on its baseline.
fn finish_svg(raw: &str, figure: &Figure) -> String {
    let (w, h) = (figure.width, figure.height);
    let id = &figure.id;
    let head = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {} {}\" role=\"img\" \
         aria-labelledby=\"{id}-title {id}-desc\">\n<title id=\"{id}-title\">{}</title>\n<desc id=\"{id}-desc\">{}</desc>\n",
        w * SVG_FINE,
        h * SVG_FINE,
        html(&figure.title),
        html(&figure.description),
    );
    // `dy` would move the baseline by font metrics of the reader's machine; and
    // plotters leaves a line end inside the text, which browsers draw as a space.
    let body = raw
        .replace(" dy=\"-0.5ex\"", "")
        .replace(&format!("font-family=\"{}\"", font::FAMILY), &format!("font-family=\"{}\"", font::STACK))
        .replace("font-weight=\"bold\"", "font-weight=\"600\"")
        .replace("\n</text>", "</text>");
    let mut body = trim_text(&body);
    if !body.ends_with('\n') {
        body.push('\n');
    }
    head + &body + "</svg>\n"
}

/// Removes the line end plotters writes after `<text ...>`.
fn trim_text(body: &str) -> String {
    let mut out = String::with_capacity(body.len());
    let mut in_text = false;
    for line in body.lines() {
        out += line;
        in_text = if line.starts_with("<text") && !line.contains("</text>") {
            true
        } else {
            in_text && !line.contains("</text>")
        };
        if !in_text {
            out.push('\n');
        }
    }
    out
}

/// Where a backend puts text whose anchor is the bottom.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Baseline {
    /// SVG, once `dy` is removed.
    AtAnchor,
    /// The rasteriser puts the baseline half a size below the top of the text.
    HalfSizeBelow,
}

fn rgba(c: Colour, alpha: f64) -> RGBAColor {
    RGBAColor((c >> 16) as u8, (c >> 8) as u8, c as u8, alpha)
}

type Area<'a, B> = DrawingArea<B, plotters::coord::Shift>;

pub(super) fn draw<'m, B: DrawingBackend>(
    (id, marks): (&str, impl IntoIterator<Item = &'m Mark>),
    root: &Area<'_, B>,
    scale: f64,
    height_em: f64,
    baseline: Baseline,
    paper: bool,
) -> Result<()> {
    let bad = |e: DrawingAreaErrorKind<B::ErrorType>| Error::new(format!("cannot draw {id}: {e}"));
    let at = |p: &(f64, f64)| ((p.0 * scale).round() as i32, (p.1 * scale).round() as i32);
    if paper {
        root.fill(&rgba(PAPER, 1.0)).map_err(bad)?;
    }
    for mark in marks {
        match mark {
            Mark::Line { points, colour, width, alpha } => {
                let stroke = rgba(*colour, *alpha).stroke_width((width * scale).round().max(1.0) as u32);
                root.draw(&PathElement::new(points.iter().map(at).collect::<Vec<_>>(), stroke)).map_err(bad)?;
            }
            Mark::Polygon { points, colour, alpha } => {
                let fill = rgba(*colour, *alpha).filled();
                root.draw(&Polygon::new(points.iter().map(at).collect::<Vec<_>>(), fill)).map_err(bad)?;
            }
            Mark::Circle { x, y, radius, colour, alpha } => {
                let fill = rgba(*colour, *alpha).filled();
                root.draw(&Circle::new(at(&(*x, *y)), (radius * scale).round() as i32, fill)).map_err(bad)?;
            }
            Mark::Text { x, y, text, style, upright } => {
                draw_text(root, at(&(*x, *y)), text, style, *upright, (scale, height_em), baseline).map_err(bad)?;
            }
        }
    }
    root.present().map_err(bad)
}

fn draw_text<B: DrawingBackend>(
    root: &Area<'_, B>,
    (mut x, mut y): (i32, i32),
    text: &str,
    style: &TextStyle,
    upright: bool,
    (scale, height_em): (f64, f64),
    baseline: Baseline,
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    let size = style.size * scale * height_em;
    let h = match style.anchor {
        Anchor::Start => HPos::Left,
        Anchor::Middle => HPos::Center,
        Anchor::End => HPos::Right,
    };
    let mut v = VPos::Bottom;
    if baseline == Baseline::HalfSizeBelow {
        v = VPos::Top;
        let half = (size / 2.0).round() as i32;
        if upright { x -= half } else { y -= half }
    }
    let weight = if style.bold { FontStyle::Bold } else { FontStyle::Normal };
    let mut font = FontDesc::new(FontFamily::Name(font::FAMILY), size, weight);
    if upright {
        font = font.transform(FontTransform::Rotate270);
    }
    let ink = rgba(style.colour, style.alpha);
    let style = plotters::style::TextStyle::from(font).color(&ink).pos(Pos::new(h, v));
    root.draw(&Text::new(text.to_string(), (x, y), style))
}
