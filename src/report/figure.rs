//! A figure: plain marks in pixels, y downward, drawn later to SVG and PNG alike.
//! Layout keeps the boxes of its parts, so that tests can see what overlaps.

use super::font;
use super::style::{Colour, Shape};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rect {
    pub x: f64,
    pub y: f64,
    pub w: f64,
    pub h: f64,
}

impl Rect {
    pub fn new(x: f64, y: f64, w: f64, h: f64) -> Rect {
        Rect { x, y, w, h }
    }

    pub fn right(&self) -> f64 {
        self.x + self.w
    }

    pub fn bottom(&self) -> f64 {
        self.y + self.h
    }

    pub fn overlaps(&self, o: &Rect) -> bool {
        self.x < o.right() && o.x < self.right() && self.y < o.bottom() && o.y < self.bottom()
    }

    pub fn contains(&self, o: &Rect) -> bool {
        self.x <= o.x && o.right() <= self.right() && self.y <= o.y && o.bottom() <= self.bottom()
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TextStyle {
    /// Em size.
    pub size: f64,
    pub colour: Colour,
    pub bold: bool,
    pub anchor: Anchor,
    pub alpha: f64,
}

#[derive(Debug, Clone)]
pub enum Mark {
    Line {
        points: Vec<(f64, f64)>,
        colour: Colour,
        width: f64,
        alpha: f64,
    },
    Polygon {
        points: Vec<(f64, f64)>,
        colour: Colour,
        alpha: f64,
    },
    Circle {
        x: f64,
        y: f64,
        radius: f64,
        colour: Colour,
        alpha: f64,
    },
    /// `x`, `y` on the baseline; `upright` text runs upward (axis titles).
    Text {
        x: f64,
        y: f64,
        text: String,
        style: TextStyle,
        upright: bool,
    },
}

/// What a box on the figure is, for tests of the layout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    Plot,
    Legend,
    /// Text that must not lie on other text.
    Label,
}

/// What a run of marks stands for: in SVG a group with a title and data attributes.
#[derive(Debug, Clone)]
pub struct Tag {
    pub marks: std::ops::Range<usize>,
    pub title: String,
    /// `measurement-id` becomes `data-measurement-id`.
    pub data: Vec<(&'static str, String)>,
}

#[derive(Debug, Clone)]
pub struct Figure {
    /// File name without suffix.
    pub id: String,
    pub title: String,
    /// What a reader who cannot see the chart needs to know.
    pub description: String,
    /// Below the chart: what is shown, how many frames and repeats, what the band is.
    pub caption: String,
    pub width: f64,
    pub height: f64,
    pub marks: Vec<Mark>,
    pub boxes: Vec<(Part, Rect)>,
    /// In the order of their marks, never overlapping.
    pub tags: Vec<Tag>,
}

impl Figure {
    pub fn new(id: &str, title: &str, width: f64, height: f64) -> Figure {
        Figure {
            id: id.into(),
            title: title.into(),
            description: String::new(),
            caption: String::new(),
            width,
            height,
            marks: Vec::new(),
            boxes: Vec::new(),
            tags: Vec::new(),
        }
    }

    /// Marks that stand for a run: a reader finds in the SVG which.
    pub fn tagged(&mut self, title: String, data: Vec<(&'static str, String)>, draw: impl FnOnce(&mut Figure)) {
        let start = self.marks.len();
        draw(self);
        self.tags.push(Tag { marks: start..self.marks.len(), title, data });
    }

    pub fn line(&mut self, points: Vec<(f64, f64)>, colour: Colour, width: f64, alpha: f64) {
        if points.len() > 1 {
            self.marks.push(Mark::Line { points, colour, width, alpha });
        }
    }

    pub fn segment(&mut self, from: (f64, f64), to: (f64, f64), colour: Colour, width: f64) {
        self.line(vec![from, to], colour, width, 1.0);
    }

    /// A polyline cut into dashes of `dash` (on, off, ...) pixels; empty is solid.
    pub fn dashed(&mut self, points: &[(f64, f64)], colour: Colour, width: f64, alpha: f64, dash: &[f64]) {
        if dash.is_empty() {
            return self.line(points.to_vec(), colour, width, alpha);
        }
        let (mut index, mut left) = (0, dash[0]);
        let mut stroke = points.first().map(|p| vec![*p]).unwrap_or_default();
        for pair in points.windows(2) {
            let (mut from, to) = (pair[0], pair[1]);
            loop {
                let length = (to.0 - from.0).hypot(to.1 - from.1);
                if length <= left {
                    left -= length;
                    stroke.push(to);
                    break;
                }
                let t = left / length;
                from = (from.0 + t * (to.0 - from.0), from.1 + t * (to.1 - from.1));
                stroke.push(from);
                if index % 2 == 0 {
                    self.line(std::mem::take(&mut stroke), colour, width, alpha);
                }
                stroke = vec![from];
                index = (index + 1) % dash.len();
                left = dash[index];
            }
        }
        if index % 2 == 0 {
            self.line(stroke, colour, width, alpha);
        }
    }

    pub fn rect(&mut self, r: Rect, colour: Colour, alpha: f64) {
        let points = vec![(r.x, r.y), (r.right(), r.y), (r.right(), r.bottom()), (r.x, r.bottom())];
        self.marks.push(Mark::Polygon { points, colour, alpha });
    }

    pub fn outline(&mut self, r: Rect, colour: Colour, width: f64) {
        let points = vec![(r.x, r.y), (r.right(), r.y), (r.right(), r.bottom()), (r.x, r.bottom()), (r.x, r.y)];
        self.line(points, colour, width, 1.0);
    }

    /// Diagonal hatching: "there is no number here, and for a reason".
    pub fn hatch(&mut self, r: Rect, colour: Colour, step: f64) {
        let mut at = r.x - r.h;
        while at < r.right() {
            // The line y = bottom - (x - at), cut to the rectangle.
            let (x0, x1) = (at.max(r.x), (at + r.h).min(r.right()));
            if x1 > x0 {
                self.line(vec![(x0, r.bottom() - (x0 - at)), (x1, r.bottom() - (x1 - at))], colour, 0.8, 0.45);
            }
            at += step;
        }
    }

    pub fn marker(&mut self, x: f64, y: f64, radius: f64, shape: Shape, colour: Colour, alpha: f64) {
        if shape == Shape::Circle {
            return self.marks.push(Mark::Circle { x, y, radius, colour, alpha });
        }
        let points = corners(shape).iter().map(|(dx, dy)| (x + dx * radius, y + dy * radius)).collect();
        self.marks.push(Mark::Polygon { points, colour, alpha });
    }

    /// The outline of a marker on paper: "not told apart".
    pub fn hollow(&mut self, x: f64, y: f64, radius: f64, shape: Shape, colour: Colour) {
        let mut points: Vec<(f64, f64)> =
            corners(shape).iter().map(|(dx, dy)| (x + dx * radius, y + dy * radius)).collect();
        self.marks.push(Mark::Polygon { points: points.clone(), colour: super::style::PAPER, alpha: 1.0 });
        points.push(points[0]);
        // The second corner again, so that the line's last joint is closed.
        points.push(points[1]);
        self.line(points, colour, 1.6, 1.0);
    }

    /// Text on the baseline `y`. Returns the box it covers.
    pub fn text(&mut self, x: f64, y: f64, text: &str, style: TextStyle) -> Rect {
        self.marks.push(Mark::Text { x, y, text: text.into(), style, upright: false });
        text_box(x, y, text, style)
    }

    /// Text that must stay clear of other labels.
    pub fn label(&mut self, x: f64, y: f64, text: &str, style: TextStyle) -> Rect {
        let r = self.text(x, y, text, style);
        self.boxes.push((Part::Label, r));
        r
    }

    pub fn upright(&mut self, x: f64, y: f64, text: &str, style: TextStyle) {
        self.marks.push(Mark::Text { x, y, text: text.into(), style, upright: true });
    }

    pub fn part(&mut self, part: Part, r: Rect) {
        self.boxes.push((part, r));
    }
}

/// Corners of a marker of radius 1.
fn corners(shape: Shape) -> Vec<(f64, f64)> {
    match shape {
        Shape::Circle => (0..24).map(|i| (f64::from(i) * std::f64::consts::TAU / 24.0).sin_cos()).collect(),
        Shape::Square => vec![(-0.85, -0.85), (0.85, -0.85), (0.85, 0.85), (-0.85, 0.85)],
        Shape::Diamond => vec![(0.0, -1.2), (1.2, 0.0), (0.0, 1.2), (-1.2, 0.0)],
        Shape::Up => vec![(0.0, -1.15), (1.1, 0.8), (-1.1, 0.8)],
        Shape::Down => vec![(0.0, 1.15), (1.1, -0.8), (-1.1, -0.8)],
        Shape::Cross => cross(0.0).to_vec(),
        Shape::Times => cross(std::f64::consts::FRAC_PI_4).to_vec(),
    }
}

/// Twelve corners of a plus of half width 1.1, turned by `angle`.
fn cross(angle: f64) -> [(f64, f64); 12] {
    let (a, b) = (0.35, 1.1);
    let (sin, cos) = angle.sin_cos();
    [(-a, -b), (a, -b), (a, -a), (b, -a), (b, a), (a, a), (a, b), (-a, b), (-a, a), (-b, a), (-b, -a), (-a, -a)]
        .map(|(x, y)| (x * cos - y * sin, x * sin + y * cos))
}

/// The box of text on baseline `y`: from cap height to descender.
pub fn text_box(x: f64, y: f64, text: &str, style: TextStyle) -> Rect {
    let w = font::width(text, style.size, style.bold);
    let x = match style.anchor {
        Anchor::Start => x,
        Anchor::Middle => x - w / 2.0,
        Anchor::End => x - w,
    };
    Rect::new(x, y - 0.76 * style.size, w, 0.96 * style.size)
}

/// The usual text styles.
pub fn plain(size: f64, colour: Colour) -> TextStyle {
    TextStyle { size, colour, bold: false, anchor: Anchor::Start, alpha: 1.0 }
}

impl TextStyle {
    pub fn bold(mut self) -> Self {
        self.bold = true;
        self
    }

    pub fn middle(mut self) -> Self {
        self.anchor = Anchor::Middle;
        self
    }

    pub fn end(mut self) -> Self {
        self.anchor = Anchor::End;
        self
    }

    pub fn faded(mut self, alpha: f64) -> Self {
        self.alpha = alpha;
        self
    }
}
