//! The occluders of a frame: those with the largest `area |cos| / distance^2`, found
//! front to back over the hierarchy.
//!
//! Every polygon belongs to the node that holds its centroid. Nodes are taken by the
//! most that anything below them can reach, so that the best are found without looking
//! at more than a few nodes; nearer ones come first.

use super::image::Image;
use super::polygons::{Polygon, Polygons};
use crate::culling::descent::bottom_up;
use crate::hierarchy::{Hierarchy, LANES, NONE};
use crate::math::{Box32, DVec3, Plane, View};
use crate::scene::Scene;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Occluders that appear smaller are not worth their planes, and their edges are too
/// close to each other.
const LEAST: f64 = 1e-6;

#[derive(Default)]
pub struct Choice {
    /// By node, where its polygons start in `polygons`, the largest first.
    start: Vec<u32>,
    polygons: Vec<u32>,
    /// By block and lane, the largest area at or below the node.
    most_m2: Vec<[f32; LANES]>,
    /// And the largest radius, as polygons reach out of the box that holds their centroid.
    reach_m: Vec<[f32; LANES]>,
    heap: BinaryHeap<Waiting>,
    chosen: Vec<(f64, u32)>,
}

/// A node by what anything in it can reach; equal ones in order of their numbers.
#[derive(PartialEq)]
struct Waiting(f64, u32);

impl Eq for Waiting {}

impl Ord for Waiting {
    fn cmp(&self, o: &Waiting) -> Ordering {
        self.0.total_cmp(&o.0).then(o.1.cmp(&self.1))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, o: &Waiting) -> Option<Ordering> {
        Some(self.cmp(o))
    }
}

impl Choice {
    pub fn new(scene: &Scene, hierarchy: &Hierarchy, polygons: &Polygons) -> Choice {
        debug_assert_eq!(polygons.of_triangle.len(), scene.len());
        // By polygon, the node whose box is nearest to its centroid.
        let mut home = vec![(f64::INFINITY, NONE); polygons.all.len()];
        for (block, links) in hierarchy.links.iter().enumerate() {
            for lane in (0..LANES).filter(|l| links.live >> l & 1 == 1) {
                let bounds = hierarchy.bounds[block].get(lane);
                for position in links.first[lane]..links.own_end[lane] {
                    let number = polygons.of_triangle[hierarchy.entries[position as usize] as usize];
                    if number != NONE {
                        let at = polygons.all[number as usize].centroid - hierarchy.origin;
                        let away = distance_squared(&bounds, at);
                        let home = &mut home[number as usize];
                        if away < home.0 {
                            *home = (away, (block * LANES + lane) as u32);
                        }
                    }
                }
            }
        }
        let area = |p: u32| polygons.all[p as usize].area_m2;
        let mut order: Vec<u32> = (0..home.len() as u32).filter(|p| home[*p as usize].1 != NONE).collect();
        order.sort_by(|a, b| {
            let node = |p: u32| home[p as usize].1;
            node(*a).cmp(&node(*b)).then(area(*b).total_cmp(&area(*a))).then(a.cmp(b))
        });
        let mut start = vec![0u32; hierarchy.links.len() * LANES + 1];
        order.iter().for_each(|p| start[home[*p as usize].1 as usize + 1] += 1);
        (1..start.len()).for_each(|n| start[n] += start[n - 1]);
        let mut most_m2 = vec![[0.0f32; LANES]; hierarchy.links.len()];
        let mut reach_m = most_m2.clone();
        bottom_up(hierarchy, |block, lane| {
            let node = block * LANES + lane;
            let own = order[start[node] as usize..start[node + 1] as usize].iter().map(|p| &polygons.all[*p as usize]);
            let child = hierarchy.links[block].child[lane] as usize;
            let below = |of: &[[f32; LANES]]| of.get(child).map_or(0.0, |b| b.iter().fold(0.0f32, |m, x| m.max(*x)));
            most_m2[block][lane] = own.clone().fold(below(&most_m2), |m, p| m.max((p.area_m2 as f32).next_up()));
            reach_m[block][lane] = own.fold(below(&reach_m), |m, p| m.max((p.radius_m as f32).next_up()));
        });
        Choice { start, polygons: order, most_m2, reach_m, ..Choice::default() }
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&self.start[..]) + size_of_val(&self.polygons[..]) + 2 * size_of_val(&self.most_m2[..])
    }

    /// The `count` best, nearest first.
    pub fn choose(
        &mut self,
        view: &View,
        image: &Image,
        hierarchy: &Hierarchy,
        polygons: &Polygons,
        count: usize,
    ) -> impl Iterator<Item = u32> + '_ {
        self.heap.clear();
        self.chosen.clear();
        let eye = view.eye - hierarchy.origin;
        for block in 0..hierarchy.root_blocks {
            self.wait(block, eye, view, image, hierarchy);
        }
        // The least that is good enough, once there are `count`.
        let mut least = LEAST;
        while let Some(Waiting(most, node)) = self.heap.pop() {
            if most < least {
                break;
            }
            let (block, lane) = (node as usize / LANES, node as usize % LANES);
            let weight = weight(image, &hierarchy.bounds[block].get(lane), eye);
            for at in self.start[node as usize]..self.start[node as usize + 1] {
                let number = self.polygons[at as usize];
                let polygon = &polygons.all[number as usize];
                if polygon.area_m2 * weight * (1.0 + 1e-6) < least {
                    break;
                }
                let score = score(view, image, polygon);
                if score < least || !may_be_seen(view, polygon) {
                    continue;
                }
                let place = self.chosen.partition_point(|c| c.0.total_cmp(&score).then(number.cmp(&c.1)).is_gt());
                self.chosen.insert(place, (score, number));
                if self.chosen.len() > count {
                    self.chosen.pop();
                    least = self.chosen[count - 1].0;
                }
            }
            let child = hierarchy.links[block].child[lane];
            if child != NONE {
                self.wait(child, eye, view, image, hierarchy);
            }
        }
        let away = |n: u32| polygons.corners(&polygons.all[n as usize]).iter();
        let nearest = |n: u32| away(n).fold(f64::INFINITY, |m, c| m.min(c.at.distance_squared(view.eye)));
        for chosen in &mut self.chosen {
            chosen.0 = nearest(chosen.1);
        }
        self.chosen.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        self.chosen.iter().map(|c| c.1)
    }

    fn wait(&mut self, block: u32, eye: DVec3, view: &View, image: &Image, hierarchy: &Hierarchy) {
        let live = hierarchy.links[block as usize].live;
        for lane in (0..LANES).filter(|l| live >> l & 1 == 1) {
            let area = f64::from(self.most_m2[block as usize][lane]);
            let bounds = hierarchy.bounds[block as usize].get(lane);
            let most = area * weight(image, &bounds, eye) * (1.0 + 1e-6);
            let reach_m = f64::from(self.reach_m[block as usize][lane]);
            if most >= LEAST && in_view(view, &bounds, eye, reach_m) {
                self.heap.push(Waiting(most, block * LANES as u32 + lane as u32));
            }
        }
    }
}

/// What a square metre in the box can reach at most.
fn weight(image: &Image, bounds: &Box32, eye: DVec3) -> f64 {
    match image.perspective {
        true => 1.0 / distance_squared(bounds, eye).max(image.near_m * image.near_m),
        false => 1.0 / (image.half[0] * image.half[1]),
    }
}

fn score(view: &View, image: &Image, polygon: &Polygon) -> f64 {
    let away = polygon.centroid - view.eye;
    let (across, square) = match image.perspective {
        true => (polygon.normal.dot(away.normalize_or_zero()), away.length_squared().max(image.near_m * image.near_m)),
        false => (polygon.normal.dot(view.forward), image.half[0] * image.half[1]),
    };
    let towards = if polygon.two_sided { across.abs() } else { -across };
    polygon.area_m2 * towards / square
}

/// Its bounding sphere reaches into the view volume.
fn may_be_seen(view: &View, polygon: &Polygon) -> bool {
    let centre = polygon.centroid - view.eye;
    view.planes.iter().all(|p| p.normal.dot(centre) + p.offset_m >= -polygon.radius_m)
}

/// Something within `reach_m` of the box may be in view.
fn in_view(view: &View, b: &Box32, eye: DVec3, reach_m: f64) -> bool {
    let (lo, hi) = (b.lo.as_dvec3() - eye, b.hi.as_dvec3() - eye);
    let most = |p: &Plane| (p.normal * lo).max(p.normal * hi).element_sum() + p.offset_m;
    view.planes.iter().all(|p| most(p) >= -reach_m)
}

fn distance_squared(b: &Box32, p: DVec3) -> f64 {
    (b.lo.as_dvec3() - p).max(p - b.hi.as_dvec3()).max(DVec3::ZERO).length_squared()
}
