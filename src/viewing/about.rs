//! What a viewer must know before it draws anything: sizes, place, camera and poses.

use crate::math::{Camera, DVec3, Projection, View};
use crate::record::cameras::degrees;
use crate::record::{SceneSpec, Up};
use crate::scene::Scene;
use serde::{Deserialize, Serialize};

/// Places are metres from `origin`, z up, right-handed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct About {
    pub triangles: u32,
    pub vertices: u32,
    pub nodes: u32,
    pub frames: u32,
    /// In the world of the run.
    pub origin: [f64; 3],
    pub lo: [f64; 3],
    pub hi: [f64; 3],
    pub camera: CameraAbout,
    /// Eye, forward and up of every frame; the directions are unit and orthogonal.
    pub poses: Vec<[f64; 9]>,
    /// In the order in which nodes are asked; `16 + k` in a frame names test `k`.
    pub tests: Vec<String>,
    /// Frames that the run's judgement looks at.
    pub judged: Vec<u32>,
    /// Whether the walk has a depth buffer to show.
    #[serde(default)]
    pub depth: bool,
    /// How the scene's file is placed in the world (turned, scaled, moved, in this
    /// order), so that a recorded path can be written in the file's own axes and units.
    pub up: Up,
    pub scale: f64,
    pub offset_m: [f64; 3],
}

/// One of `fov_y_deg` and `ortho_height_m` is there; no `far_m` is infinitely far.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CameraAbout {
    pub fov_y_deg: Option<f64>,
    pub ortho_height_m: Option<f64>,
    /// Width over height.
    pub aspect: f64,
    pub near_m: f64,
    pub far_m: Option<f64>,
}

impl About {
    /// Of a scene without frames.
    pub(super) fn of(scene: &Scene, spec: &SceneSpec, camera: &Camera) -> About {
        let bounds = scene.bounds();
        About {
            triangles: scene.len() as u32,
            vertices: scene.positions.len() as u32,
            nodes: 0,
            frames: 0,
            origin: scene.origin.to_array(),
            lo: (bounds.lo - scene.origin).to_array(),
            hi: (bounds.hi - scene.origin).to_array(),
            camera: CameraAbout::of(camera),
            poses: Vec::new(),
            tests: Vec::new(),
            judged: Vec::new(),
            depth: false,
            up: spec.up,
            scale: spec.scale,
            offset_m: spec.offset_m,
        }
    }
}

impl CameraAbout {
    fn of(camera: &Camera) -> CameraAbout {
        let (fov_y_deg, ortho_height_m) = match camera.projection {
            Projection::Perspective { fov_y_rad } => (Some(degrees(fov_y_rad)), None),
            Projection::Orthographic { height_m } => (None, Some(height_m)),
        };
        let Camera { aspect, near_m, far_m, .. } = *camera;
        CameraAbout { fov_y_deg, ortho_height_m, aspect, near_m, far_m }
    }
}

pub(super) fn pose(view: &View, origin: DVec3) -> [f64; 9] {
    let [eye, forward, up] = [view.eye - origin, view.forward, view.up].map(|v| v.to_array());
    std::array::from_fn(|i| [eye, forward, up][i / 3][i % 3])
}
