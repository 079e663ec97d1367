//! `portals`: from the camera's cell through what is open (Luebke & Georges 1995, over
//! the cells of a portal-octree after Silva 2009).
//!
//! Every cell that can be seen into carries the screen rectangle through which it is
//! seen. A neighbour is seen through the part of that rectangle that the opening
//! between them shows; an empty part ends the way. Without `clip` only "seen or not"
//! is kept: a flood through open faces in the view.
//!
//! What we changed:
//! - Luebke & Georges recurse by path, whose number explodes where all is open. A view
//!   ray only moves away from the eye, on every axis by itself, so cells are taken by
//!   their distance in planes from the eye, and each is taken once, with the union of
//!   the rectangles of all ways to it. (Parallel rays along a plane know no direction
//!   there; then a cell is taken again when its rectangle grows. Rectangles are whole
//!   and only grow, so this ends.)
//! - Rays start on the near window, as nothing nearer hides anything: the cells that it
//!   touches are the first ones, be it in a wall; the eye need not be in any cell. What
//!   of the window lies outside of the root box sees in through its outer faces.
//! - The tests of the sum judge the hierarchy above the cells that were reached, and the
//!   box of a reached cell must show in the cell's rectangle.
//!
//! Conservative. A point that is seen is the end of a ray that crosses faces beyond the
//! near plane, none of them where it is closed in the ray's direction. By induction the
//! ray's place on the screen is in the rectangle of every cell on the way: the first
//! rectangle holds it, each opening's rectangle holds all that is seen through it
//! ([`Screen`]), and unions only add. Rays through an edge of cells cross all faces that
//! meet there, as faces, texels and rectangles are closed.

use super::descent::Descent;
use super::portals_screen::{Rect, Screen};
use super::skipping::{STILL, Skipping, WHOLE_BELOW};
use super::*;
use crate::hierarchy::portals::CLOSED;
use crate::hierarchy::{LANES, NONE, Portals as Cells};
use crate::math::{Aabb, DVec3};

pub const ENTRY: Entry<dyn Walk> = Entry {
    name: "portals",
    about: "from the camera's cell through the openings of a portal_octree (Luebke & Georges 1995)",
    revision: 1,
    params: &[
        Param {
            name: "clip",
            default: Allowed::Bool(true),
            about: "see through the part of the screen that the portals so far leave; false: flood through open faces in view",
        },
        STILL,
        WHOLE_BELOW,
    ],
    make: |spec| Box::new(Portals { skipping: Skipping::new(spec), ..Portals::new(spec.bool("clip")) }),
};

/// Parallel rays closer to a plane than this may cross it either way.
const ALONG: f64 = 1e-9;

#[derive(Clone, Copy)]
struct Cell {
    rect: Rect,
    queued: bool,
}

const UNSEEN: Cell = Cell { rect: Rect::EMPTY, queued: false };

pub struct Portals {
    clip: bool,
    /// By cell; all [`UNSEEN`] between frames.
    cells: Vec<Cell>,
    reached: Vec<u32>,
    /// Cells to take, by their distance from the eye in planes.
    queue: Vec<Vec<u32>>,
    level: usize,
    /// By axis, the distance of every layer of cells.
    distance: [Vec<u16>; 3],
    /// By axis and plane: whether a ray may cross it upwards (1), downwards (2).
    crossed: [Vec<u8>; 3],
    /// By block, the lanes to be visited; all 0 between frames.
    marks: Vec<u8>,
    marked: Vec<u32>,
    descent: Descent,
    skipping: Skipping,
}

impl Portals {
    pub fn new(clip: bool) -> Portals {
        Portals {
            clip,
            cells: Vec::new(),
            reached: Vec::new(),
            queue: Vec::new(),
            level: 0,
            distance: Default::default(),
            crossed: Default::default(),
            marks: Vec::new(),
            marked: Vec::new(),
            descent: Descent::default(),
            skipping: Skipping::default(),
        }
    }

    /// Which way rays cross each plane, and how many planes each layer is away.
    fn orient(&mut self, view: &View, cells: &Cells) {
        for axis in 0..3 {
            let planes = &cells.planes[axis];
            let (eye, along) = (view.eye[axis], view.forward[axis]);
            let way = |plane: &f64| match view.is_perspective() {
                true => u8::from(eye < *plane) | u8::from(eye > *plane) << 1,
                false => u8::from(along > -ALONG) | u8::from(along < ALONG) << 1,
            };
            self.crossed[axis].clear();
            self.crossed[axis].extend(planes.iter().map(way));
            let ways = &self.crossed[axis];
            // Planes below that are crossed upwards only, and above downwards only.
            let below = |i: usize| ways[..=i].iter().filter(|w| **w == 1).count();
            let above = |i: usize| ways[i + 1..].iter().filter(|w| **w == 2).count();
            self.distance[axis].clear();
            self.distance[axis].extend((0..cells.side()).map(|i| (below(i) + above(i)) as u16));
        }
    }

    #[inline]
    fn reach(&mut self, number: usize, at: [usize; 3], rect: Rect) {
        let rect = if self.clip { rect } else { Rect::FULL };
        let cell = &mut self.cells[number];
        let all = cell.rect.join(rect);
        if all == cell.rect {
            return;
        }
        if cell.rect.is_empty() {
            self.reached.push(number as u32);
        }
        cell.rect = all;
        if !std::mem::replace(&mut cell.queued, true) {
            let level: usize = (0..3).map(|axis| usize::from(self.distance[axis][at[axis]])).sum();
            if self.queue.len() <= level {
                self.queue.resize_with(level + 1, Vec::new);
            }
            self.queue[level].push(number as u32);
            self.level = self.level.min(level);
        }
    }

    /// The cells in which view rays start, or which they enter from outside.
    fn start(&mut self, view: &View, screen: &Screen, cells: &Cells, tally: &mut Tally) {
        let window = near_window(view);
        let range = |axis: usize| cells.touching(axis, window.lo[axis], window.hi[axis]);
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let at = [x, y, z];
                    let rect = screen.on_near_window(&cells.bounds(at)).meet(Rect::FULL);
                    if !rect.is_empty() {
                        self.reach(cells.cell(at), at, rect);
                    }
                }
            }
        }
        let root = cells.root();
        if root.contains(window.lo) && root.contains(window.hi) {
            return;
        }
        let side = cells.side();
        for axis in 0..3 {
            let [u, v] = crate::hierarchy::portals::across(axis);
            for (layer, plane, way) in [(0, 0, 1), (side - 1, side, 2)] {
                if self.crossed[axis][plane] & way == 0 {
                    continue;
                }
                let height = cells.planes[axis][plane];
                let shown = |lo: [usize; 2], hi: [usize; 2]| {
                    let corner = |c: [usize; 2]| [cells.planes[u][c[0]], cells.planes[v][c[1]]];
                    screen.face(axis, height, [corner(lo), corner(hi)]).meet(Rect::FULL)
                };
                for k in 0..side {
                    // A whole row first: most rows are not in view.
                    tally.portals_tested += 1;
                    if shown([0, k], [side, k + 1]).is_empty() {
                        continue;
                    }
                    for j in 0..side {
                        tally.portals_tested += 1;
                        let rect = shown([j, k], [j + 1, k + 1]);
                        if !rect.is_empty() {
                            let mut at = [layer; 3];
                            (at[u], at[v]) = (j, k);
                            self.reach(cells.cell(at), at, rect);
                        }
                    }
                }
            }
        }
    }

    /// Looks from a cell through its faces.
    fn look(&mut self, number: usize, screen: &Screen, cells: &Cells, tally: &mut Tally) {
        let at = cells.at(number);
        let rect = self.cells[number].rect;
        for axis in 0..3 {
            let step = 1usize << (axis as u32 * cells.bits);
            for (direction, way) in [(0, 1), (1, 2)] {
                let plane = at[axis] + 1 - direction;
                let outer = plane == 0 || plane == cells.side();
                if outer || self.crossed[axis][plane] & way == 0 {
                    continue;
                }
                let lower = number - direction * step;
                let opening = cells.openings[axis][lower][direction];
                if opening == CLOSED {
                    continue;
                }
                let mut to = at;
                to[axis] = at[axis] + 1 - 2 * direction;
                let neighbour = cells.cell(to);
                // Whatever the opening shows, the neighbour is seen through it already.
                if self.cells[neighbour].rect.join(rect) == self.cells[neighbour].rect {
                    continue;
                }
                tally.portals_tested += 1;
                let texels = cells.texels as u8;
                let part = if self.clip { opening } else { [0, 0, texels, texels] };
                // Its place across the axis is the same for both cells.
                let seen = screen.face(axis, cells.planes[axis][plane], cells.rectangle(axis, at, part)).meet(rect);
                if !seen.is_empty() {
                    self.reach(neighbour, to, seen);
                }
            }
        }
    }

    /// Marks the way from the roots to the node of every reached cell; forgets the cells.
    fn mark(&mut self, screen: &Screen, hierarchy: &Hierarchy, cells: &Cells) {
        for number in self.reached.drain(..) {
            let cell = std::mem::replace(&mut self.cells[number as usize], UNSEEN);
            let mut node = cells.node[number as usize];
            if node == NONE || self.clip && hides_behind(screen, hierarchy, node, cell.rect) {
                continue;
            }
            while node != NONE {
                let block = node as usize / LANES;
                let mark = &mut self.marks[block];
                let known = *mark != 0;
                *mark |= 1 << (node as usize % LANES);
                if known {
                    break;
                }
                self.marked.push(block as u32);
                node = hierarchy.parent[block];
            }
        }
    }

    /// Down to the marked leaves, with what the tests say on the way.
    fn submit(&mut self, hierarchy: &Hierarchy, tests: &mut [Box<dyn Test>], out: &mut DrawList, tally: &mut Tally) {
        let count = tests.len();
        for root in 0..hierarchy.root_blocks {
            self.descent.clear();
            self.descent.enter(hierarchy, root, self.marks[root as usize], 0, tests, None, tally);
            while let Some(at) = self.descent.next(count) {
                let links = &hierarchy.links[at.block as usize];
                let child = links.child[at.lane];
                if child == NONE {
                    out.push(links.first[at.lane], links.end[at.lane]);
                } else {
                    self.descent.enter(hierarchy, child, self.marks[child as usize], 0, tests, Some(at), tally);
                    self.descent.expect_children(hierarchy);
                }
            }
        }
        self.marked.drain(..).for_each(|block| self.marks[block as usize] = 0);
    }
}

/// The box of a cell's node shows nowhere in the rectangle.
fn hides_behind(screen: &Screen, hierarchy: &Hierarchy, node: u32, rect: Rect) -> bool {
    let b = hierarchy.bounds[node as usize / LANES].get(node as usize % LANES);
    let bounds = Aabb { lo: b.lo.as_dvec3() + hierarchy.origin, hi: b.hi.as_dvec3() + hierarchy.origin };
    // The sum rounds by less than this.
    let hair = DVec3::splat(4.0 * f64::EPSILON) * bounds.lo.abs().max(bounds.hi.abs());
    screen.solid(&Aabb { lo: bounds.lo - hair, hi: bounds.hi + hair }).meet(rect).is_empty()
}

/// A box around the part of the near plane that is in view.
fn near_window(view: &View) -> Aabb {
    let (w, h) = (view.right * view.half_width, view.up * view.half_height);
    let near_m = view.camera.near_m;
    let corner = |x: f64, y: f64| {
        let aside = w * x + h * y;
        view.forward * near_m + if view.is_perspective() { aside * near_m } else { aside }
    };
    let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let offset = Aabb::of_points(&corners);
    let hair = (view.eye.abs() + offset.lo.abs().max(offset.hi.abs())) * (32.0 * f64::EPSILON);
    Aabb { lo: view.eye + offset.lo - hair, hi: view.eye + offset.hi + hair }
}

impl Walk for Portals {
    fn removes(&self) -> Removes {
        Removes { outside_frustum: true, occluded: true, ..Removes::default() }
    }

    fn refuses(&self, hierarchy: &Hierarchy) -> Option<String> {
        hierarchy.portals.is_none().then(|| {
            "`portals` looks through the openings between cells, and it has none; take the structure `portal_octree`, or the walk `depth_first`".to_string()
        })
    }

    fn skipping(&mut self) -> Option<&mut Skipping> {
        Some(&mut self.skipping)
    }

    fn remembers(&self) -> bool {
        false
    }

    fn run(
        &mut self,
        view: &View,
        hierarchy: &Hierarchy,
        tests: &mut [Box<dyn Test>],
        out: &mut DrawList,
        tally: &mut Tally,
    ) {
        let cells = hierarchy.portals.as_ref().expect("`refuses` asked for the column");
        let screen = Screen::new(view);
        self.cells.resize(cells.node.len(), UNSEEN);
        self.marks.resize(hierarchy.links.len(), 0);
        self.orient(view, cells);
        self.level = usize::MAX;
        self.start(view, &screen, cells, tally);
        while self.level < self.queue.len() {
            match self.queue[self.level].pop() {
                Some(number) => {
                    self.cells[number as usize].queued = false;
                    self.look(number as usize, &screen, cells, tally);
                }
                None => self.level += 1,
            }
        }
        tally.cells_reached += self.reached.len() as u64;
        self.mark(&screen, hierarchy, cells);
        self.submit(hierarchy, tests, out, tally);
    }
}
