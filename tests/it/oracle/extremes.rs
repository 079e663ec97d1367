//! Conservative methods on scenes and views made to break them: slivers, coplanar
//! and repeated triangles, points, flat scenes, offsets up to 1e8 m, fields of
//! view from 1e-4 to 3.14 rad, parallel rays, near planes through vertices and
//! eyes in the planes of triangles. And (fact A0.5) the picture of what they submit.

use cullmark::culling::{DrawList, Tally, make_tests, make_walk, promise};
use cullmark::hierarchy::Hierarchy;
use cullmark::math::{Camera, DVec3, Pose, Projection, View};
use cullmark::oracle::{FrameTruth, image::Grid, losses};
use cullmark::registry::{Spec, parse_sum};
use cullmark::runner::submitted;
use cullmark::scene::Scene;
use rand_chacha::rand_core::{RngCore, SeedableRng};

struct Rng(rand_chacha::ChaCha8Rng);

impl Rng {
    fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
}

fn scene_of(triangles: &[[DVec3; 3]], rng: &mut Rng) -> Scene {
    let n = triangles.len();
    let mut scene = Scene {
        positions: triangles.concat(),
        triangles: (0..n as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        source_triangle_id: (0..n as u32).collect(),
        object_id: vec![0; n],
        material_id: (0..n as u32).map(|t| t % 3).collect(),
        two_sided: (0..n).map(|_| rng.below(10) == 0).collect(),
        occluder: (0..n).map(|_| rng.below(10) > 0).collect(),
        source_triangle_count: n as u32,
        ..Scene::default()
    };
    scene.anchor();
    scene
}

/// A scene, its half size and where it lies.
fn nasty_scene(rng: &mut Rng, seed: u64) -> (Scene, f64, DVec3) {
    let offset = [DVec3::ZERO, rng.vector() * 1e5, rng.vector() * 1e7, rng.vector() * 1e8][seed as usize % 4];
    let size = [1.0, 30.0, 1e4][rng.below(3)];
    let mut all: Vec<[DVec3; 3]> = Vec::new();
    for i in 0..120 {
        let (at, edge) = (rng.vector() * size, size * libm::pow(10.0, -2.0 * rng.unit()));
        let mut t = [at, at + rng.vector() * edge, at + rng.vector() * edge];
        match (i + seed) % 6 {
            0 => t[2] = t[0].lerp(t[1], rng.unit()) + rng.vector() * edge * libm::pow(10.0, -3.0 - 9.0 * rng.unit()),
            1 => t = t.map(|p| (p / size * 4.0).round() / 4.0 * size),
            2 => t = *all.get(rng.below(all.len().max(1))).unwrap_or(&t),
            3 if i % 12 == 3 => t = [at; 3],
            4 => t = [t[0], t[1] * 3.0, t[2] * 3.0],
            _ => {}
        }
        if seed % 5 == 4 {
            t.iter_mut().for_each(|p| p.z = 0.25);
        }
        all.push(t);
    }
    all.iter_mut().flatten().for_each(|p| *p += offset);
    (scene_of(&all, rng), size, offset)
}

fn nasty_view(rng: &mut Rng, scene: &Scene, size: f64, offset: DVec3, i: usize) -> View {
    let projection = match i % 4 {
        0 => Projection::Orthographic { height_m: size * rng.unit() + 0.01 },
        _ => Projection::Perspective { fov_y_rad: [1e-4, 1.0, 1.6, 3.1][rng.below(4)] },
    };
    let near_m = [1e-6, 0.1, size * 0.2][rng.below(3)];
    let far_m = (rng.below(2) == 0).then(|| near_m + size * (rng.unit() + 0.01));
    let t = scene.corners(rng.below(scene.len()) as u32);
    let mut forward = rng.vector().normalize();
    let eye = match i % 3 {
        0 => offset + rng.vector() * size * 2.0,
        // In the plane of the triangle; with a corner in the near plane.
        1 => t[0] + (t[1] - t[0]) * rng.unit() * 2.0 - (t[2] - t[0]) * rng.unit(),
        _ => t[0] - forward * near_m,
    };
    if i % 3 < 2 && offset.distance(eye) > 0.0 {
        forward = (offset - eye).normalize();
    }
    let up = forward.any_orthonormal_vector();
    View::new(
        &Camera { projection, aspect: [1.0, 16.0 / 9.0, 8.0][rng.below(3)], near_m, far_m },
        &Pose { eye, forward, up },
    )
}

fn cull(
    scene: &Scene,
    h: &Hierarchy,
    culling: &str,
    walk: &str,
    view: &View,
) -> (DrawList, cullmark::culling::Removes) {
    let mut tests = make_tests(&parse_sum(culling).unwrap()).unwrap().0;
    for t in &mut tests {
        t.prepare(scene, h);
        t.begin(view, h);
    }
    let mut list = DrawList::default();
    let mut walk = make_walk(&Spec::new(walk)).unwrap().0;
    walk.run(view, h, &mut tests, &mut list, &mut Tally::default());
    (list, promise(&tests, walk.as_ref()).1)
}

fn build(text: &str, scene: &Scene) -> Option<Hierarchy> {
    cullmark::structure::make(&Spec::parse(text).unwrap()).unwrap().0.build(scene).ok()
}

#[test]
fn conservative_methods_lose_nothing_on_scenes_made_to_break_them() {
    let grid = Grid { width_px: 40, height_px: 24, samples: 1 };
    let (mut judged, mut seen) = (0, 0);
    for seed in 0..10 {
        let mut rng = Rng(rand_chacha::ChaCha8Rng::seed_from_u64(seed));
        let (scene, size, offset) = nasty_scene(&mut rng, seed);
        let views: Vec<View> = (0..6).map(|i| nasty_view(&mut rng, &scene, size, offset, i)).collect();
        let truths: Vec<FrameTruth> = views.iter().map(|v| FrameTruth::of(&scene, v, 0, grid)).collect();
        seen += truths.iter().map(|t| t.visible.len()).sum::<usize>();
        let octrees = ["L", "R", "S", "E"].map(|p| format!("octree:depth=3,policy={p}"));
        let others = ["list:leaf_size=3", "bsp:min_leaf=8", "bsp:min_leaf=8,layout=binary"].map(String::from);
        for structure in octrees.iter().chain(&others) {
            // A BSP may give up on such a scene, but not lose anything.
            let Some(h) = build(structure, &scene) else { continue };
            h.assert_well_formed(&scene);
            for culling in ["frustum", "frustum:node_test=plane", "normal_mask:cells=18", "frustum+normal_mask"] {
                for walk in ["depth_first", "flat"] {
                    for (view, truth) in views.iter().zip(&truths) {
                        let (list, removes) = cull(&scene, &h, culling, walk, view);
                        let lost = losses(&scene, view, truth, &submitted(&scene, &h, &list), removes);
                        assert!(
                            lost.seen.is_empty() && lost.hidden.is_empty(),
                            "{seed} {structure} {culling} {walk}: {lost:?}"
                        );
                        judged += 1;
                    }
                }
            }
        }
    }
    assert!(judged > 2500 && seen > 100, "{judged} judgements, {seen} triangles seen");
}

#[test]
fn the_picture_of_what_is_submitted_is_the_whole_picture_under_every_policy() {
    let scene = crate::common::soup(5, 900, 10.0, 2.0);
    let grid = Grid { width_px: 160, height_px: 90, samples: 1 };
    let pose = Pose { eye: DVec3::new(-9.0, -6.0, 1.0), forward: DVec3::new(1.0, 0.5, 0.0), up: DVec3::Z };
    let view = View::new(&Camera::default(), &pose);
    let whole = FrameTruth::of(&scene, &view, 0, grid).item_image();
    for policy in ["L", "E", "R", "S"] {
        let h = build(&format!("octree:depth=3,policy={policy}"), &scene).unwrap();
        let (list, _) = cull(&scene, &h, "frustum", "depth_first", &view);
        let mut positions: Vec<u32> = list.positions().collect();
        positions.sort_by_key(|p| h.entries[*p as usize]);
        if policy != "S" {
            positions.dedup_by_key(|p| h.entries[*p as usize]);
        }
        let pieces: Vec<[DVec3; 3]> = positions.iter().map(|p| h.piece(&scene, *p)).collect();
        let mut part = scene_of(&pieces, &mut Rng(rand_chacha::ChaCha8Rng::seed_from_u64(0)));
        part.two_sided.fill(false);
        part.occluder.fill(true);
        assert!(policy == "S" || part.len() < scene.len(), "something was culled");
        let drawn = FrameTruth::of(&part, &view, 0, grid).item_image();
        let original = |id: u32| if id == 0 { 0 } else { h.entries[positions[id as usize - 1] as usize] + 1 };
        let differ = whole.iter().zip(&drawn).filter(|(w, d)| **w != original(**d)).count();
        // Rounded corners of a split move its edges by far less than a sample.
        let allowed = if policy == "S" { whole.len() / 1000 } else { 0 };
        assert!(differ <= allowed, "{policy}: {differ} of {} samples differ", whole.len());
    }
}
