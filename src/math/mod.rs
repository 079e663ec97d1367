//! Geometry shared by every other room: boxes, planes, cameras, exact predicates.

pub mod aabb;
pub mod arithmetic;
pub mod camera;
pub mod exact;
pub mod expansion;
pub mod fixed;
pub mod predicates;

pub use aabb::{Aabb, Box32};
pub use arithmetic::Arithmetic;
pub use camera::{Camera, Plane, Pose, Projection, View};
pub use glam::{DVec2, DVec3, Vec3};
