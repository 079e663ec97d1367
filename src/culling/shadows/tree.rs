//! The occlusion tree: inner nodes are lines of the image, leaves are in the shadow of one
//! occluder or in none (Bittner, Havran & Slavik 1998).

use super::TAU;
use super::caster::Caster;
use super::image::{Image, Sight};
use super::outline::{Line, Outline};
use crate::math::DVec3;

/// A node, a leaf without shadow ([`OPEN`]) or one in that of a caster ([`SHADOW`] + number).
pub type Place = u32;

/// Nothing hides here.
pub const OPEN: Place = u32::MAX;
const SHADOW: Place = 1 << 31;

/// Of the image's area: a smaller part of a shadow is not worth its lines.
const SPECK: f64 = 1e-10;

#[derive(Debug, Clone, Copy)]
struct Node {
    line: Line,
    at: f64,
    /// Below `at`, and at or above it.
    child: [Place; 2],
}

/// What becomes of a box.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    Hidden,
    /// Whatever lies in the box may be asked about from this place on; nothing in it is
    /// hidden if that is [`OPEN`].
    Shows(Place),
}

#[derive(Default)]
pub struct Tree {
    nodes: Vec<Node>,
    casters: Vec<Caster>,
    root: Place,
    tau: f64,
    speck: f64,
}

impl Tree {
    pub fn clear(&mut self, image: &Image) {
        self.nodes.clear();
        self.casters.clear();
        self.root = OPEN;
        let half = image.half[0].max(image.half[1]);
        self.tau = TAU * half;
        self.speck = SPECK * half * half;
    }

    pub fn root(&self) -> Place {
        self.root
    }

    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Adds what `caster` shadows and nothing else does yet.
    pub fn insert(&mut self, image: &Image, caster: Caster) {
        // A little beyond the image, as outlines of boxes are.
        let whole = Outline::rectangle(image.half.map(|h| h + 2.0 * image.guard));
        let mut shape = whole;
        for side in &caster.sides {
            let Some(part) = shape.above(&side.line, side.at) else { return };
            shape = part;
        }
        if shape.area() > self.speck {
            self.casters.push(caster);
            self.root = self.with(self.root, &whole, &shape);
        }
    }

    /// The place with the last caster's `shape` in it; both lie in `cell`.
    fn with(&mut self, place: Place, cell: &Outline, shape: &Outline) -> Place {
        if place == OPEN {
            return self.planted(cell);
        }
        if place >= SHADOW {
            return place;
        }
        let Node { line, at, child } = self.nodes[place as usize];
        let (least, most) = shape.range(&line);
        // Whether all of it lies below, and above.
        let whole = [most <= at, least >= at];
        for i in (0..2).filter(|i| !whole[1 - i]) {
            let part = |o: &Outline, at: f64| if i == 0 { o.below(&line, at) } else { o.above(&line, at) };
            let shape = if whole[i] { Some(*shape) } else { part(shape, at) };
            if let Some(shape) = shape.filter(|s| s.area() > self.speck) {
                // A cell with too many corners stays as wide as it is, which is safe.
                let tau = if i == 0 { self.tau } else { -self.tau };
                let cell = part(cell, at + tau).unwrap_or(*cell);
                self.nodes[place as usize].child[i] = self.with(child[i], &cell, &shape);
            }
        }
        place
    }

    /// The sides of the last caster that the cell does not lie within anyway, and below
    /// them its shadow.
    fn planted(&mut self, cell: &Outline) -> Place {
        let number = self.casters.len() - 1;
        let mut cell = *cell;
        let mut top = SHADOW + number as u32;
        let mut above = None;
        for i in 0..self.casters[number].sides.len() {
            let side = self.casters[number].sides[i];
            if cell.range(&side.line).0 >= side.at - 2.0 * self.tau {
                continue;
            }
            let node = self.nodes.len() as u32;
            self.nodes.push(Node { line: side.line, at: side.at, child: [OPEN, SHADOW + number as u32] });
            match above.replace(node) {
                Some(node_above) => self.nodes[node_above as usize].child[1] = node,
                None => top = node,
            }
            cell = cell.above(&side.line, side.at - self.tau).unwrap_or(cell);
        }
        top
    }

    /// What becomes of a box relative to the eye, asked from `place` on.
    #[inline]
    pub fn judge(&self, image: &Image, bounds: [DVec3; 2], place: Place) -> Answer {
        match image.sight(bounds) {
            Sight::Outside => Answer::Hidden,
            Sight::Open => Answer::Shows(place),
            Sight::Outline(outline) => self.descend(&outline, bounds, place),
        }
    }

    fn descend(&self, outline: &Outline, bounds: [DVec3; 2], mut place: Place) -> Answer {
        while place < SHADOW {
            let node = &self.nodes[place as usize];
            let (least, most) = outline.range(&node.line);
            if least < node.at && most >= node.at {
                return match self.all_hidden(place, outline, bounds) {
                    true => Answer::Hidden,
                    false => Answer::Shows(place),
                };
            }
            place = node.child[usize::from(least >= node.at)];
        }
        if place == OPEN {
            return Answer::Shows(OPEN);
        }
        match self.casters[(place - SHADOW) as usize].hides(bounds) {
            Some(true) => Answer::Hidden,
            Some(false) => Answer::Shows(place),
            None => Answer::Shows(OPEN),
        }
    }

    fn all_hidden(&self, mut place: Place, outline: &Outline, bounds: [DVec3; 2]) -> bool {
        while place < SHADOW {
            let node = &self.nodes[place as usize];
            let (least, most) = outline.range(&node.line);
            if least < node.at && most >= node.at {
                // Parts overlap, so that no direction is in neither.
                let part =
                    |side: Option<Outline>, child: Place| side.is_some_and(|o| self.all_hidden(child, &o, bounds));
                // The side that is open at once first.
                return (node.child[0] != OPEN)
                    && (node.child[1] != OPEN)
                    && part(outline.above(&node.line, node.at - self.tau), node.child[1])
                    && part(outline.below(&node.line, node.at + self.tau), node.child[0]);
            }
            place = node.child[usize::from(least >= node.at)];
        }
        place != OPEN && self.casters[(place - SHADOW) as usize].hides(bounds) == Some(true)
    }
}
