//! The camera on the command line: projection and clip distances, as options of a verb.

use crate::error::{Error, Result};
use crate::math::{Camera, Projection};

#[derive(clap::Args)]
pub struct CameraOptions {
    /// Full vertical field of view of a perspective camera, degrees
    #[arg(long, value_name = "DEG", default_value_t = 60.0)]
    pub fov_y_deg: f64,
    /// Full height of the view volume, metres; makes the camera orthographic
    #[arg(long, value_name = "M")]
    pub ortho_height_m: Option<f64>,
    /// Width over height, as 16:9 or 1.778
    #[arg(long, default_value = "16:9", value_parser = parse_aspect)]
    pub aspect: f64,
    #[arg(long, value_name = "M", default_value_t = 0.1)]
    pub near_m: f64,
    /// Infinite if absent
    #[arg(long, value_name = "M")]
    pub far_m: Option<f64>,
}

impl CameraOptions {
    /// # Errors
    /// A number out of range, by the name of its option.
    pub fn camera(&self) -> Result<Camera> {
        let bad =
            |key: &str, value: f64, want: &str| Err(Error::new(format!("is {value}, but must be {want}")).key(key));
        if !(0.01..180.0).contains(&self.fov_y_deg) {
            return bad("--fov-y-deg", self.fov_y_deg, "from 0.01 to below 180 degrees");
        }
        if !(self.near_m.is_finite() && self.near_m > 0.0) {
            return bad("--near-m", self.near_m, "above 0");
        }
        if let Some(far_m) = self.far_m.filter(|f| !(f.is_finite() && *f > self.near_m)) {
            return bad(
                "--far-m",
                far_m,
                &format!("beyond the near plane at {} m; leave it out for infinite", self.near_m),
            );
        }
        let projection = match self.ortho_height_m {
            None => Projection::Perspective { fov_y_rad: self.fov_y_deg.to_radians() },
            Some(height_m) if height_m.is_finite() && height_m > 0.0 => Projection::Orthographic { height_m },
            Some(height_m) => return bad("--ortho-height-m", height_m, "above 0"),
        };
        Ok(Camera { projection, aspect: self.aspect, near_m: self.near_m, far_m: self.far_m })
    }
}

fn parse_aspect(text: &str) -> Result<f64, String> {
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|x| x.is_finite() && *x > 0.0);
    let aspect = match text.split_once([':', '/']) {
        Some((w, h)) => number(w).zip(number(h)).map(|(w, h)| w / h),
        None => number(text),
    };
    aspect.filter(|a| (0.01..=100.0).contains(a)).ok_or_else(|| "write 16:9 or a number from 0.01 to 100".to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn aspects_are_ratios_or_numbers() {
        assert_eq!(parse_aspect("16:9"), Ok(16.0 / 9.0));
        assert_eq!(parse_aspect("4/3"), Ok(4.0 / 3.0));
        assert_eq!(parse_aspect("1.5"), Ok(1.5));
        for bad in ["", "16:", "0:9", "-1", "wide", "inf", "1:0", "1e9"] {
            assert!(parse_aspect(bad).is_err(), "{bad}");
        }
    }
}
