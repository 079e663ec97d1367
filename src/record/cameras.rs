//! Cameras as values of an axis: `perspective:fov_y_deg=40`, `orthographic:height_m=20`.
//!
//! A value states what it changes; the rest is that of the section `[camera]`.
//! A spec holds degrees and 0 for an infinite far plane, a [`Camera`] radians and `None`.

use super::numbers::{short, tidy};
use crate::error::{Error, Result};
use crate::math::{Camera, Projection};
use crate::registry::{Default as Allowed, Entry, Param, Spec, Value, find};
use std::ops::RangeInclusive;

/// Name of the axis.
pub const AXIS: &str = "camera";

/// Narrowest and widest field of view, degrees. At 0.01 a metre fills the picture
/// from 6 km; at 179 the tangent of half the angle is 115.
pub const FOV_Y_DEG: RangeInclusive<f64> = 0.01..=179.0;

const ASPECT: Param = Param {
    name: "aspect",
    default: Allowed::Float { value: 16.0 / 9.0, min: 0.01, max: 100.0 },
    about: "width over height",
};
const FAR_M: Param = Param {
    name: "far_m",
    default: Allowed::Float { value: 0.0, min: 0.0, max: 1e12 },
    about: "distance of the far plane; 0 is infinite",
};
const NEAR_M: Param = Param {
    name: "near_m",
    default: Allowed::Float { value: 0.1, min: 1e-9, max: 1e12 },
    about: "distance of the near plane",
};

/// Sorted by name, parameters too.
pub static CAMERAS: &[Entry<Camera>] = &[
    Entry {
        name: "orthographic",
        about: "parallel rays",
        revision: 1,
        params: &[
            ASPECT,
            FAR_M,
            Param {
                name: "height_m",
                default: Allowed::Float { value: 20.0, min: 1e-9, max: 1e12 },
                about: "full height of the view volume",
            },
            NEAR_M,
        ],
        make: |spec| Box::new(made(spec, Projection::Orthographic { height_m: spec.float("height_m") })),
    },
    Entry {
        name: "perspective",
        about: "rays through the eye",
        revision: 1,
        params: &[
            ASPECT,
            FAR_M,
            Param {
                name: "fov_y_deg",
                default: Allowed::Float { value: 60.0, min: *FOV_Y_DEG.start(), max: *FOV_Y_DEG.end() },
                about: "full vertical field of view",
            },
            NEAR_M,
        ],
        make: |spec| {
            let fov_y_rad = spec.float("fov_y_deg").to_radians();
            Box::new(made(spec, Projection::Perspective { fov_y_rad }))
        },
    },
];

fn made(spec: &Spec, projection: Projection) -> Camera {
    let far_m = spec.float("far_m");
    Camera {
        projection,
        aspect: spec.float("aspect"),
        near_m: spec.float("near_m"),
        far_m: (far_m > 0.0).then_some(far_m),
    }
}

/// Checks `spec` and leaves out what it does not state.
///
/// # Errors
/// An unknown kind or parameter, or a value out of range.
pub fn check(spec: &Spec) -> Result<Spec> {
    let (_, mut resolved) = find(AXIS, CAMERAS, spec)?;
    resolved.params.retain(|name, _| spec.params.contains_key(name));
    for value in resolved.params.values_mut() {
        // Ends of a logarithmic range come back from `exp` not quite as written.
        if let Value::Float(x) = value {
            *x = tidy(*x);
        }
    }
    Ok(resolved)
}

/// The camera of a spec in which every parameter is stated.
///
/// # Errors
/// As [`check`], and a far plane that is not beyond the near one.
pub fn camera_of(spec: &Spec) -> Result<Camera> {
    let (entry, resolved) = find(AXIS, CAMERAS, spec)?;
    let camera = *entry.build(&resolved);
    match camera.far_m {
        Some(far_m) if far_m <= camera.near_m => Err(Error::new(format!(
            "`{spec}` has its far plane at {far_m} m, not beyond the near plane at {} m",
            camera.near_m
        ))
        .help("raise far_m, lower near_m, or give far_m = 0 for infinite")),
        _ => Ok(camera),
    }
}

/// The spec of a camera, every parameter stated: the inverse of [`camera_of`].
pub fn spec_of(camera: &Camera) -> Spec {
    let spec = match camera.projection {
        Projection::Perspective { fov_y_rad } => {
            Spec::new("perspective").with("fov_y_deg", Value::Float(degrees(fov_y_rad)))
        }
        Projection::Orthographic { height_m } => Spec::new("orthographic").with("height_m", Value::Float(height_m)),
    };
    spec.with("aspect", Value::Float(camera.aspect))
        .with("near_m", Value::Float(camera.near_m))
        .with("far_m", Value::Float(camera.far_m.unwrap_or(0.0)))
}

/// `given` with all that it does not state taken from `section`.
pub fn complete(given: &Spec, section: &Camera) -> Spec {
    let mut out = given.clone();
    for (name, value) in spec_of(section).params {
        let known = CAMERAS.iter().filter(|e| e.name == given.kind).flat_map(|e| e.params).any(|p| p.name == name);
        if known {
            out.params.entry(name).or_insert(value);
        }
    }
    // The other projection states no angle or height to take over.
    find(AXIS, CAMERAS, &out).map_or(out, |(_, resolved)| resolved)
}

/// A camera without what is usual, its numbers short.
pub fn label(spec: &Spec) -> String {
    let params = CAMERAS.iter().find(|e| e.name == spec.kind).map_or(&[][..], |e| e.params);
    let rounded = spec.params.iter().filter(|(name, value)| {
        params.iter().find(|p| p.name == name.as_str()).is_none_or(|p| p.default.value() != **value)
    });
    let words: Vec<String> = rounded
        .map(|(name, value)| match value {
            Value::Float(x) => format!("{name}={}", short(*x, 6)),
            other => format!("{name}={other}"),
        })
        .collect();
    if words.is_empty() { spec.kind.clone() } else { format!("{}:{}", spec.kind, words.join(",")) }
}

/// Degrees as somebody wrote them: converting back gives the same radians.
pub fn degrees(rad: f64) -> f64 {
    let short = tidy(rad.to_degrees());
    if short.to_radians() == rad { short } else { rad.to_degrees() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_and_its_spec_are_the_same() {
        for text in [
            "perspective:fov_y_deg=60,aspect=1.5,near_m=0.1,far_m=0",
            "perspective:fov_y_deg=0.01,aspect=1.5,near_m=0.5,far_m=70",
            "perspective:fov_y_deg=179,aspect=0.01,near_m=1e-9,far_m=1e12",
            "orthographic:height_m=3,aspect=1,near_m=0.1,far_m=2",
        ] {
            let camera = camera_of(&Spec::parse(text).unwrap()).unwrap();
            assert_eq!(camera_of(&spec_of(&camera)).unwrap(), camera, "{text}");
        }
        assert_eq!(spec_of(&Camera::default()).params["fov_y_deg"], Value::Float(60.0));
        for i in 1..17_900 {
            let written = f64::from(i) / 100.0;
            assert_eq!(degrees(written.to_radians()), written);
        }
    }

    #[test]
    fn a_value_takes_over_what_it_does_not_state() {
        let section = Camera { near_m: 0.5, far_m: Some(9.0), ..Camera::default() };
        let given = check(&Spec::parse("perspective:fov_y_deg=1").unwrap()).unwrap();
        assert_eq!(given.to_string(), "perspective:fov_y_deg=1.0");
        let whole = camera_of(&complete(&given, &section)).unwrap();
        assert_eq!(whole, Camera { projection: Projection::Perspective { fov_y_rad: 1f64.to_radians() }, ..section });
        let other = camera_of(&complete(&Spec::new("orthographic"), &section)).unwrap();
        assert_eq!(other, Camera { projection: Projection::Orthographic { height_m: 20.0 }, ..section });
        let e = camera_of(&complete(&Spec::parse("perspective:near_m=9").unwrap(), &section)).unwrap_err();
        assert!(e.to_string().contains("not beyond the near plane"), "{e}");
    }
}
