//! Verdicts: is an answer right for the class that its method declares?

use crate::culling::Class;
use crate::record::FrameErrors;

/// Why a method is wrong for its declared class, if it is.
///
/// Conservative methods may lose nothing that is proved to be owed, seen or not;
/// sample-conservative ones nothing that a sample sees; exact ones, moreover, may
/// not submit more than the set. Errors of the others are data.
pub fn verdict(class: Class, frames: &[FrameErrors]) -> Option<String> {
    let wrong: Vec<String> = frames.iter().filter_map(|f| reason(class, f)).collect();
    let more = match wrong.len() {
        0 => return None,
        1 => String::new(),
        n => format!("; {} more of {} judged frames are wrong", n - 1, frames.len()),
    };
    Some(format!("{}{more}", wrong[0]))
}

fn reason(class: Class, f: &FrameErrors) -> Option<String> {
    let (seen, owed) = match class {
        Class::Exact | Class::Conservative => (f.false_culls, f.potential_lost),
        // What only a ray sees, no sample sees.
        Class::SampleConservative => (f.false_culls - f.false_culls_by_ray, 0),
        Class::Aggressive | Class::Approximate => return None,
    };
    let lost = seen.max(owed);
    if lost > 0 {
        let ids = f.lost_ids.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
        let triangles = if lost == 1 { "1 triangle, id".into() } else { format!("{lost} triangles, first ids") };
        let place = match (seen, f.false_cull_pixels) {
            (0, _) => "in the view volume, though hidden from every sample".to_string(),
            (_, 0) => "seen by a ray between the samples".to_string(),
            (_, 1) => "seen in 1 pixel".to_string(),
            (_, n) => format!("seen in {n} pixels"),
        };
        return Some(format!("frame {}: lost {triangles} {ids} ({place})", f.frame));
    }
    (class == Class::Exact && f.submitted > f.potential).then(|| {
        format!("frame {}: submitted {} triangles, but the exact set holds {}", f.frame, f.submitted, f.potential)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_verdict_names_frame_ids_and_pixels() {
        let lost = FrameErrors {
            frame: 12,
            false_culls: 3,
            potential_lost: 3,
            false_cull_pixels: 240,
            lost_ids: vec![17, 20, 33],
            ..Default::default()
        };
        let fine = FrameErrors { frame: 3, submitted: 5, potential: 4, ..Default::default() };
        let frames = [fine.clone(), lost.clone()];
        assert_eq!(
            verdict(Class::Conservative, &frames).unwrap(),
            "frame 12: lost 3 triangles, first ids 17, 20, 33 (seen in 240 pixels)"
        );
        assert_eq!(verdict(Class::Aggressive, &frames), None);
        let hidden = FrameErrors { false_culls: 0, false_cull_pixels: 0, ..lost };
        assert!(
            verdict(Class::Conservative, std::slice::from_ref(&hidden)).unwrap().contains("hidden from every sample")
        );
        assert_eq!(verdict(Class::SampleConservative, &[hidden]), None);
        assert!(verdict(Class::Exact, std::slice::from_ref(&fine)).unwrap().contains("the exact set holds 4"));
        assert_eq!(verdict(Class::Conservative, &[fine]), None);
    }

    #[test]
    fn a_loss_that_only_a_ray_sees_is_wrong_for_a_conservative_method_alone() {
        let by_ray = FrameErrors { false_culls: 2, false_culls_by_ray: 2, lost_ids: vec![5, 9], ..Default::default() };
        let frames = [by_ray];
        assert!(verdict(Class::Conservative, &frames).unwrap().contains("by a ray between the samples"));
        assert_eq!(verdict(Class::SampleConservative, &frames), None);
    }
}
