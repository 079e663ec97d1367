//! `[[sweep]]`: what it reads to.

use super::whole;
use cullmark::sweep::Sweep;

#[test]
fn a_sweep_reads_whole_and_its_defaults_are_log_log_by_arithmetic() {
    let (manifest, _) = whole(
        r#"[matrix]
structure = [{ kind = "octree", depth = [2, 3] }]
culling = ["frustum"]
arithmetic = ["f32_world", "f64"]
camera = ["perspective", "perspective:fov_y_deg=1"]
[[sweep]]
id = "angle"
x = "camera.fov_y_deg"
y = "over_submission"
[[sweep]]
id = "depth"
title = "Depth"
x = "structure.depth"
x_unit = "levels"
y = "mean_nodes_visited"
by = "camera"
x_scale = "linear"
y_scale = "linear"
expected = { slope = 0.5, of = "perspective", why = "a tree of branching eight" }
[[sweep]]
id = "knob"
x = "structure.depth"
y = "total_cull_ms"
against = "over_submission"
"#,
        &[],
    );
    let [angle, depth, knob] = &manifest.sweeps()[..] else { panic!("three sweeps") };
    assert_eq!(knob.against.as_deref(), Some("over_submission"));
    assert_eq!(knob.title, "total_cull_ms against over_submission");
    let expected = Sweep {
        id: "angle".into(),
        title: "over_submission against camera.fov_y_deg".into(),
        x: "camera.fov_y_deg".into(),
        x_unit: "°".into(),
        y: "over_submission".into(),
        against: None,
        by: "arithmetic".into(),
        x_log: true,
        y_log: true,
        expected_slope: None,
        expected_for: None,
        expected_why: String::new(),
    };
    assert_eq!(*angle, expected);
    assert_eq!(
        (depth.x_log, depth.y_log, depth.x_unit.as_str(), depth.title.as_str()),
        (false, false, "levels", "Depth")
    );
    assert_eq!((depth.expected_slope, depth.expected_for.as_deref()), (Some(0.5), Some("perspective")));
    assert_eq!(depth.expected_why, "a tree of branching eight");
}
