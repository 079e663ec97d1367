//! Triangles, meshes and boxes: the forms read back, states agree with the runner and the judge.

use super::{Form, Frame, rooms, run_spec};
use cullmark::culling::{DrawList, Tally};
use cullmark::oracle::image::Grid;
use cullmark::oracle::{FrameTruth, losses};
use cullmark::record::SceneSpec;
use cullmark::runner::{self, Setup, submitted};
use cullmark::scene::load;
use cullmark::viewing::{RunView, SceneView};

#[test]
fn mesh_and_nodes_read_back_as_the_scene_and_its_boxes() {
    let folder = tempfile::tempdir().unwrap();
    let spec = run_spec("octree:depth=4", "frustum+normal_mask:cells=6", "depth_first", 3);
    let view = RunView::open(&spec, folder.path()).unwrap();
    let setup = Setup::new(&spec, folder.path()).unwrap();
    let (scene, h) = (&setup.scene, &setup.hierarchy);

    let about = view.about();
    assert_eq!((about.triangles, about.vertices), (scene.len() as u32, scene.positions.len() as u32));
    assert_eq!((about.frames, about.poses.len(), about.judged.as_slice()), (3, 3, &[0, 2][..]));
    assert_eq!(about.nodes, h.node_count() as u32);
    assert_eq!(about.tests, ["frustum", "normal_mask:cells=6"]);
    let eye = setup.poses[1].eye - scene.origin;
    assert_eq!(about.poses[1][..3], eye.to_array());
    let json = serde_json::to_value(&about).unwrap();
    assert_eq!(json["camera"]["fov_y_deg"], 60.0);
    assert_eq!((&json["camera"]["far_m"], &json["camera"]["ortho_height_m"]), (&().into(), &().into()));
    assert_eq!((&json["up"], &json["scale"], &json["offset_m"][2]), (&"z".into(), &1.0.into(), &0.0.into()));

    let bytes = view.mesh();
    let mut form = Form::new(&bytes, b"CMSH");
    let [vertices, triangles]: [u32; 2] = form.words(2).try_into().unwrap();
    assert_eq!((vertices, triangles), (about.vertices, about.triangles));
    let positions = form.floats(3 * vertices);
    for (read, p) in positions.chunks(3).zip(&scene.positions) {
        assert_eq!(read, (*p - scene.origin).as_vec3().to_array());
    }
    let indices = form.words(3 * triangles);
    assert!(indices.iter().eq(scene.triangles.iter().flatten()));
    let colours = form.words(triangles);
    assert!(form.0.is_empty());
    for (t, colour) in colours.iter().enumerate() {
        assert_eq!(colour >> 24, u32::from(scene.two_sided[t]));
        let same = scene.material_id.iter().position(|m| *m == scene.material_id[t]).unwrap();
        assert_eq!(colour & 0xff_ffff, colours[same] & 0xff_ffff, "a material has one colour");
    }
    assert!(colours.iter().any(|c| *c != colours[0]), "materials differ");

    let bytes = view.nodes();
    let mut form = Form::new(&bytes, b"CMND");
    assert_eq!(form.words(2), [about.nodes, 0]);
    let mut deepest = 0;
    for block in 0..h.links.len() {
        for lane in (0..8).filter(|l| h.links[block].live >> l & 1 == 1) {
            let bounds = h.bounds[block].get(lane);
            assert_eq!(form.floats(3), bounds.lo.to_array());
            assert_eq!(form.floats(3), bounds.hi.to_array());
            let (mut up, mut depth) = (h.parent[block], 0);
            while up != u32::MAX {
                (up, depth) = (h.parent[up as usize / 8], depth + 1);
            }
            assert_eq!(form.word(), depth);
            deepest = deepest.max(depth);
        }
    }
    assert!(form.0.is_empty() && deepest == 4, "{deepest}");
}

#[test]
fn a_scene_alone_is_the_same_mesh_and_may_have_two_sides_and_another_place() {
    let folder = tempfile::tempdir().unwrap();
    let view = RunView::open(&run_spec("list", "none", "flat", 1), folder.path()).unwrap();
    let alone = SceneView::open(&rooms(), folder.path()).unwrap();
    assert!(alone.mesh() == view.mesh());
    assert_eq!((alone.about().frames, alone.about().nodes), (0, 0));

    let two_sided = SceneSpec { winding: cullmark::record::Winding::TwoSided, ..rooms() };
    let spec = load::describe("rooms", two_sided.source, two_sided.winding, None, 0.5, false).unwrap();
    let placed = SceneView::open(&load::moved(spec, [10.0, 0.0, -3.0]), folder.path()).unwrap();
    let about = placed.about();
    assert_eq!((about.scale, about.offset_m), (0.5, [10.0, 0.0, -3.0]));
    let bytes = placed.mesh();
    let mut form = Form::new(&bytes[..], b"CMSH");
    let (vertices, triangles) = (form.word(), form.word());
    form.bytes(12 * (vertices + triangles) as usize);
    assert!(form.words(triangles).iter().all(|c| c >> 24 == 1));
}

/// Draw list, view and scene of one frame, without the viewer.
fn cull(setup: &mut Setup, n: usize) -> DrawList {
    let mut list = DrawList::default();
    setup.cull(n, &mut list, &mut Tally::default());
    list
}

#[test]
fn states_are_the_submitted_set_and_losses_those_of_the_judgement() {
    let mut lost_anything = false;
    for (structure, culling, walk) in [
        ("octree:depth=4", "frustum+octant_mask", "depth_first"),
        ("octree:depth=3,policy=S", "frustum+look_at", "depth_first"),
        ("list", "octant_mask+back_face", "flat"),
    ] {
        let spec = run_spec(structure, culling, walk, 5);
        let folder = tempfile::tempdir().unwrap();
        let judgement = runner::judge(&spec, folder.path()).unwrap();
        // Once with the truth that the judge left in its cache, once without.
        for cache in [folder.path(), &folder.path().join("other")] {
            let mut view = RunView::open(&spec, cache).unwrap();
            let mut setup = Setup::new(&spec, cache).unwrap();
            assert_eq!(view.about().judged, [0, 4]);
            for n in 0..5 {
                let list = cull(&mut setup, n);
                let sent = submitted(&setup.scene, &setup.hierarchy, &list);
                let plain = Frame::read(&view.frame(n, false).unwrap());
                assert!(!plain.truth && plain.visible == 0 && plain.lost == 0);
                assert_eq!(u64::from(plain.submitted), sent.triangles.count());
                for (t, state) in (0u32..).zip(&plain.triangles) {
                    assert_eq!(*state, u8::from(sent.triangles.contains(t)));
                }
                let bytes = view.frame(n, true).unwrap();
                assert!(view.frame(n, true).unwrap() == bytes, "from memory");
                let frame = Frame::read(&bytes);
                assert!(frame.truth && frame.nodes == plain.nodes && frame.submitted == plain.submitted);
                let (visible, lost) = match judgement.frames.iter().find(|f| f.frame as usize == n) {
                    Some(judged) => (judged.visible, judged.false_culls),
                    None => {
                        let grid = Grid { width_px: 960, height_px: 540, samples: 1 };
                        let truth = FrameTruth::of(&setup.scene, &setup.views[n], n as u32, grid);
                        let found = losses(&setup.scene, &setup.views[n], &truth, &sent, setup.removes);
                        let marked = (0u32..).zip(&frame.triangles).filter(|(_, s)| **s == 3).map(|(t, _)| t);
                        assert!(marked.eq(found.seen.iter().copied()));
                        (found.errors.visible, found.errors.false_culls)
                    }
                };
                assert_eq!((u64::from(frame.visible), u64::from(frame.lost)), (visible, lost));
                assert_eq!(frame.count(3), frame.lost);
                assert!(frame.count(2) > 0 && frame.count(2) + frame.lost <= frame.visible);
                for (t, state) in (0u32..).zip(&frame.triangles) {
                    assert!(*state == 3 || (*state > 0) == sent.triangles.contains(t), "triangle {t}");
                }
                lost_anything |= lost > 0;
            }
            assert!(view.frame(5, true).unwrap_err().to_string().contains("from 0 to 4"));
        }
    }
    assert!(lost_anything, "aggressive methods lose something here");
}
