//! Small hand-made hierarchies, so that this area needs no structure of the crate.

use cullmark::hierarchy::{BoundsBlock, Hierarchy, LANES, LinkBlock, NONE};
use cullmark::math::{Aabb, Box32, Camera, DVec3, Pose, View};
use cullmark::scene::Scene;

/// Seeded numbers.
pub struct Rng(rand_chacha::ChaCha8Rng);

impl Rng {
    pub fn new(seed: u64) -> Rng {
        use rand_chacha::rand_core::SeedableRng;
        Rng(rand_chacha::ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn bits(&mut self) -> u64 {
        use rand_chacha::rand_core::RngCore;
        self.0.next_u64()
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn range(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.unit()
    }

    /// Each coordinate in [-half, half).
    pub fn cube(&mut self, half: f64) -> DVec3 {
        DVec3::new(self.range(-half, half), self.range(-half, half), self.range(-half, half))
    }

    /// Uniform on the unit sphere.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = self.cube(1.0);
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    pub fn pose(&mut self, half: f64) -> Pose {
        let forward = self.direction();
        let up = if forward.z.abs() > 0.9 { DVec3::X } else { DVec3::Z };
        Pose { eye: self.cube(half), forward, up }
    }
}

pub fn camera(fov_y_deg: f64, aspect: f64) -> Camera {
    let projection = cullmark::math::Projection::Perspective { fov_y_rad: fov_y_deg.to_radians() };
    Camera { projection, aspect, ..Camera::default() }
}

pub fn view_along(eye: DVec3, forward: DVec3, camera: &Camera) -> View {
    View::new(camera, &Pose { eye, forward, up: if forward.z.abs() > 0.9 { DVec3::X } else { DVec3::Z } })
}

/// A list: clusters of `leaf_size` triangles in scene order.
pub fn list(scene: &Scene, leaf_size: usize) -> Hierarchy {
    let mut h = Hierarchy { origin: scene.origin, entries: (0..scene.len() as u32).collect(), ..Default::default() };
    let starts: Vec<usize> = (0..scene.len()).step_by(leaf_size).collect();
    for starts in starts.chunks(LANES) {
        let block = push_block(&mut h, NONE);
        for (lane, first) in starts.iter().enumerate() {
            let end = (first + leaf_size).min(scene.len());
            set_lane(&mut h, scene, block, lane, *first, end, end);
        }
    }
    h.root_blocks = h.links.len() as u32;
    h.number_material_runs(scene);
    h.assert_well_formed(scene);
    h
}

/// An eight-way tree of median cuts with at most `leaf_size` triangles a leaf.
/// Internal nodes keep `own` triangles to themselves, as policy E does.
pub fn tree(scene: &Scene, leaf_size: usize, own: usize) -> Hierarchy {
    let mut h = Hierarchy { origin: scene.origin, entries: (0..scene.len() as u32).collect(), ..Default::default() };
    let root = push_block(&mut h, NONE);
    h.root_blocks = 1;
    fill(&mut h, scene, root, 0, 0, scene.len(), leaf_size, own);
    h.number_material_runs(scene);
    h.assert_well_formed(scene);
    h
}

fn fill(
    h: &mut Hierarchy,
    scene: &Scene,
    block: usize,
    lane: usize,
    first: usize,
    end: usize,
    leaf_size: usize,
    own: usize,
) {
    if end - first <= leaf_size.max(own + LANES) {
        set_lane(h, scene, block, lane, first, end, end);
        return;
    }
    set_lane(h, scene, block, lane, first, first + own, end);
    let mut cuts = vec![first + own, end];
    for _ in 0..3 {
        for pair in cuts.clone().windows(2) {
            let part = &mut h.entries[pair[0]..pair[1]];
            let box_ = part.iter().fold(Aabb::EMPTY, |b, t| b.with(scene.triangle_aabb(*t).centre()));
            let axis = (0..3).max_by(|a, b| box_.size()[*a].total_cmp(&box_.size()[*b])).unwrap();
            part.sort_by(|a, b| {
                let key = |t: &u32| scene.triangle_aabb(*t).centre()[axis];
                key(a).total_cmp(&key(b)).then(a.cmp(b))
            });
            cuts.push((pair[0] + pair[1]) / 2);
        }
        cuts.sort();
    }
    let child = push_block(h, (block * LANES + lane) as u32);
    h.links[block].child[lane] = child as u32;
    for (l, pair) in cuts.windows(2).enumerate() {
        fill(h, scene, child, l, pair[0], pair[1], leaf_size, own);
    }
}

fn push_block(h: &mut Hierarchy, parent: u32) -> usize {
    h.bounds.push(BoundsBlock::EMPTY);
    h.links.push(LinkBlock::EMPTY);
    h.parent.push(parent);
    h.links.len() - 1
}

fn set_lane(h: &mut Hierarchy, scene: &Scene, block: usize, lane: usize, first: usize, own_end: usize, end: usize) {
    let box_ = h.entries[first..end].iter().fold(Box32::EMPTY, |b, t| b.union(scene.triangle_box(*t)));
    h.bounds[block].set(lane, box_);
    let links = &mut h.links[block];
    links.live |= 1 << lane;
    (links.first[lane], links.own_end[lane], links.end[lane]) = (first as u32, own_end as u32, end as u32);
}

/// Boxes as they are, in blocks of 8, without a scene behind them.
pub fn blocks(boxes: &[Box32]) -> (Vec<BoundsBlock>, Vec<u8>) {
    boxes
        .chunks(LANES)
        .map(|chunk| {
            let mut block = BoundsBlock::EMPTY;
            chunk.iter().enumerate().for_each(|(lane, b)| block.set(lane, *b));
            (block, ((1u16 << chunk.len()) - 1) as u8)
        })
        .unzip()
}
