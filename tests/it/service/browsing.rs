//! Frames to look at: the binary forms agree with what is told of them and with the
//! series that the trials left.

use super::server::shared;
use serde_json::Value;

fn words(body: &[u8]) -> Vec<u32> {
    body.chunks_exact(4).map(|w| u32::from_le_bytes(w.try_into().unwrap())).collect()
}

fn binary(path: &str, magic: &[u8]) -> Vec<u8> {
    let reply = shared().get(path).with(200);
    assert_eq!((reply.kind(), &reply.body[..4]), ("application/octet-stream", magic));
    reply.body
}

#[test]
fn a_mesh_and_its_nodes_have_the_sizes_that_are_told() {
    let about = shared().json("/studies/town@0/runs/3/view");
    let [triangles, vertices, nodes] = ["triangles", "vertices", "nodes"].map(|n| about[n].as_u64().unwrap() as usize);
    assert_eq!((triangles, about["poses"].as_array().unwrap().len()), (16 * 12, 20));
    let mesh = binary("/studies/town@0/runs/3/view/mesh", b"CMSH");
    assert_eq!(&words(&mesh)[1..4], &[1, vertices as u32, triangles as u32]);
    assert_eq!(mesh.len(), 16 + 12 * vertices + 12 * triangles + 4 * triangles);
    let indices = &words(&mesh)[4 + 3 * vertices..][..3 * triangles];
    assert!(indices.iter().all(|i| (*i as usize) < vertices));
    let tree = binary("/studies/town@0/runs/3/view/nodes", b"CMND");
    assert_eq!((words(&tree)[2] as usize, tree.len()), (nodes, 16 + 28 * nodes));
    let upload = binary(&format!("/uploads/{}/view/mesh", shared().scene), b"CMSH");
    assert_eq!(words(&upload)[3] as usize, triangles);
}

#[test]
fn a_frame_submits_what_the_trials_counted_and_loses_nothing() {
    let series = shared().json("/studies/town@0/runs/3/series?names=triangles");
    for frame in [0, 7, 19] {
        let body = binary(&format!("/studies/town@0/runs/3/view/frames/{frame}?truth=true"), b"CMFR");
        let head = words(&body[..32]);
        let (triangles, nodes, submitted, visible, lost, flags) =
            (head[2] as usize, head[3] as usize, head[4], head[5], head[6], head[7]);
        assert_eq!(Value::from(f64::from(submitted)), series["series"][0]["values"][frame], "frame {frame}");
        assert_eq!((lost, flags & 1), (0, 1), "a conservative method, and truth was asked for");
        let marks = &body[32..32 + triangles];
        let count = |what: &[u8]| marks.iter().filter(|m| what.contains(m)).count() as u32;
        assert_eq!((count(&[1, 2]), count(&[2, 3]), count(&[3])), (submitted, visible, lost));
        assert_eq!(body.len(), 32 + triangles.next_multiple_of(4) + nodes);
    }
    let plain = binary("/studies/town@0/runs/3/view/frames/7", b"CMFR");
    assert_eq!(words(&plain[..32])[7] & 1, 0);
}
