//! Moved and scaled scenes: mesh and path stay together to the last bit.

use super::put;
use cullmark::math::{DVec3, Pose};
use cullmark::record::{PathSource, PathSpec, SceneSource, SceneSpec, Up, Winding};
use cullmark::registry::Spec;
use cullmark::scene::placement::along;
use cullmark::scene::{load, walkthrough};
use std::path::Path;

fn rooms(scale: f64, offset_m: [f64; 3]) -> SceneSpec {
    let source = SceneSource::Generated(Spec::parse("rooms:world=1,triangles=6000").unwrap());
    load::moved(load::describe("rooms", source, Winding::Ccw, None, scale, false).unwrap(), offset_m)
}

fn path(source: PathSource, scene: &SceneSpec) -> PathSpec {
    let fingerprint = walkthrough::fingerprint(&source, &scene.fingerprint).unwrap();
    PathSpec { name: "p".into(), source, frames: None, stride: 1, fingerprint }
}

/// Poses of a walk through `scene`, as a run reads them and as `inspect` does.
fn walked(scene: &SceneSpec, cache: &Path) -> Vec<Pose> {
    let walk = path(PathSource::Generated(Spec::parse("walk:frames=60,seed=3").unwrap()), scene);
    let loaded = load::load_cached(scene, cache).unwrap();
    let poses = walkthrough::load_cached(&walk, scene, &loaded, cache).unwrap();
    assert_eq!(poses, walkthrough::load_cached(&walk, scene, &loaded, cache).unwrap(), "from the cache");
    assert_eq!(poses, walkthrough::load(&walk, scene, &load::load(scene).unwrap()).unwrap(), "without one");
    poses
}

#[test]
fn a_moved_scene_is_walked_as_where_it_was() {
    let cache = tempfile::tempdir().unwrap();
    let home = rooms(1.0, [0.0; 3]);
    let (mesh, walk) = (load::load(&home).unwrap(), walked(&home, cache.path()));
    for offset_m in [along(1e3), along(1e6), [-5e5, 0.0, 3.0]] {
        let far = rooms(1.0, offset_m);
        assert_ne!(far.fingerprint, home.fingerprint);
        let by = DVec3::from_array(offset_m);
        let there = load::load(&far).unwrap();
        assert_eq!(there.len(), mesh.len());
        for t in 0..mesh.len() as u32 {
            for (a, b) in mesh.corners(t).iter().zip(there.corners(t)) {
                assert_eq!(*a + by, b);
            }
        }
        for (a, b) in walk.iter().zip(walked(&far, cache.path())) {
            assert_eq!((a.eye + by, a.forward, a.up), (b.eye, b.forward, b.up));
        }
    }
}

#[test]
fn a_generated_scene_and_its_walk_are_scaled_together() {
    let cache = tempfile::tempdir().unwrap();
    let (home, large) = (rooms(1.0, [0.0; 3]), rooms(8.0, along(7e3)));
    let by = DVec3::new(6e3, -3e3, 2e3);
    let (a, b) = (load::load(&home).unwrap().bounds(), load::load(&large).unwrap().bounds());
    assert_eq!((a.lo * 8.0 + by, a.hi * 8.0 + by), (b.lo, b.hi));
    for (a, b) in walked(&home, cache.path()).iter().zip(walked(&large, cache.path())) {
        assert_eq!(a.eye * 8.0 + by, b.eye);
        assert_eq!(a.forward, b.forward);
    }
}

#[test]
fn a_file_and_its_path_are_turned_scaled_and_moved_alike() {
    let dir = tempfile::tempdir().unwrap();
    let obj = put(&dir, "a.obj", "v 1 2 3\nv 4 5 7\nv 0 9 1\nf 1 2 3\n");
    let csv = put(&dir, "a.csv", "frame,px,py,pz,fx,fy,fz,ux,uy,uz\n0,1,2,3,1,0,0,0,1,0\n");
    let spec = load::describe("a", SceneSource::File(obj), Winding::Ccw, Some(Up::Y), 0.1, false).unwrap();
    let spec = load::moved(spec, [1e4, 0.0, 1.0]);
    let scene = load::load(&spec).unwrap();
    let corner = scene.corners(0)[0];
    assert_eq!(corner, DVec3::new(0.1f64.mul_add(1.0, 1e4), -3.0 * 0.1, 0.1f64.mul_add(2.0, 1.0)));
    let poses = walkthrough::load(&path(PathSource::File(csv), &spec), &spec, &scene).unwrap();
    assert_eq!(poses[0].eye, corner, "the eye stands on the vertex");
    assert_eq!((poses[0].forward, poses[0].up), (DVec3::X, DVec3::Z));
}

#[test]
fn a_moved_fingerprint_is_checked_like_any_other() {
    let cache = tempfile::tempdir().unwrap();
    let mut spec = rooms(1.0, along(10.0));
    spec.offset_m = along(11.0);
    let e = load::load_cached(&spec, cache.path()).unwrap_err();
    assert!(e.to_string().contains("not what it was"), "{e}");
}
