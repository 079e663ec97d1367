//! Cameras and occluders for the depth buffer's tests.

use cullmark::math::{Camera, DVec3, Pose, Projection, View};
use cullmark::raster::project::Screen;
use cullmark::raster::{Coverage, DepthBuffer, Kernel, Kind, Occluders, Settings, plain::Plain};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

pub struct Random(ChaCha8Rng);

impl Random {
    pub fn new(seed: u64) -> Random {
        Random(ChaCha8Rng::seed_from_u64(seed))
    }

    /// From -1 to 1.
    pub fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    }

    pub fn vector(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit())
    }

    pub fn below(&mut self, n: u64) -> u64 {
        self.0.next_u64() % n
    }
}

pub struct Triangle {
    pub corners: [DVec3; 3],
    pub kind: Kind,
}

pub const ORIGIN: DVec3 = DVec3::new(100.0, -200.0, 30.0);

/// Triangles of many kinds about `ORIGIN`: small, large, slivers, degenerate, far, through
/// the eye's plane, with coordinates that are no numbers.
pub fn triangles(seed: u64, count: usize) -> Vec<Triangle> {
    let mut r = Random::new(seed);
    let one = |r: &mut Random| {
        let size = [0.02, 0.1, 0.5, 2.0, 10.0, 60.0][r.below(6) as usize];
        let centre = r.vector() * 40.0;
        let mut corners: [DVec3; 3] = std::array::from_fn(|_| centre + r.vector() * size);
        match r.below(40) {
            0 => corners[2] = corners[0].lerp(corners[1], r.unit()) + r.vector() * 1e-6,
            1 => corners[2] = corners[1],
            // Coarsens its whole batch.
            2 if seed.is_multiple_of(5) => corners[r.below(3) as usize] *= 1e9,
            2 => corners[r.below(3) as usize] *= 100.0,
            3 => corners[r.below(3) as usize].y = [f64::NAN, f64::INFINITY, 1e300][r.below(3) as usize],
            4 => corners = corners.map(|c| (c * 4.0).round() * 0.25),
            5 => corners = corners.map(|c| DVec3::new(c.x, 12.0, c.z)),
            _ => {}
        }
        let kind = [Kind::Clear, Kind::OneSided, Kind::OneSided, Kind::TwoSided][r.below(4) as usize];
        Triangle { corners: corners.map(|c| c + ORIGIN), kind }
    };
    (0..count).map(|_| one(&mut r)).collect()
}

pub fn occluders(t: &[Triangle]) -> Occluders {
    let starts: Vec<u32> = (0..t.len() as u32).step_by(23).collect();
    Occluders::new(t.len() as u32, ORIGIN, |p| t[p as usize].corners, |p| t[p as usize].kind, &starts)
}

pub fn view(seed: u64, perspective: bool, aspect: f64) -> View {
    let mut r = Random::new(seed ^ 0x5eed);
    let projection = if perspective {
        Projection::Perspective { fov_y_rad: 0.6 + 0.5 * r.unit() }
    } else {
        Projection::Orthographic { height_m: 30.0 + 20.0 * r.unit() }
    };
    let camera = Camera { projection, aspect, near_m: [0.1, 0.5, 3.0][r.below(3) as usize], ..Default::default() };
    let eye = ORIGIN + r.vector() * 60.0;
    let forward = (ORIGIN + r.vector() * 10.0 - eye).normalize();
    View::new(&camera, &Pose { eye, forward, up: DVec3::Z })
}

pub fn kernels() -> impl Iterator<Item = Kernel> {
    Kernel::ALL.into_iter().filter(|k| k.present())
}

pub fn settings(width_px: u32, height_px: u32, coverage: Coverage) -> Settings {
    Settings { width_px, height_px, coverage }
}

/// The buffer with all occluders drawn.
pub fn drawn(settings: Settings, kernel: Kernel, view: &View, occluders: &Occluders) -> DepthBuffer {
    let mut buffer = DepthBuffer::with_kernel(settings, kernel);
    buffer.begin(view, ORIGIN);
    buffer.draw(occluders, 0, occluders.len() as u32);
    buffer
}

/// Nearness pixel by pixel of a plain z-buffer over the sources.
pub fn plain(settings: Settings, view: &View, t: &[Triangle]) -> Plain {
    let screen = Screen::new(view, ORIGIN, settings);
    let mut plain = Plain::new(settings);
    for t in t.iter().filter(|t| t.kind != Kind::Clear && t.corners.iter().all(|c| c.is_finite() && c.length() < 1e15))
    {
        plain.triangle(&screen, t.corners.map(|c| c - ORIGIN), t.kind == Kind::TwoSided);
    }
    plain
}
