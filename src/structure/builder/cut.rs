use crate::error::Result;
use crate::hierarchy::Hierarchy;
use crate::math::Aabb;
use crate::scene::Scene;
pub fn build_replicated(_: &Scene, _: &Aabb, _: u32, _: u32) -> Result<Hierarchy> {
    Err(crate::Error::new("this policy is not built yet").help("use policy L or E"))
}
pub fn build_split(_: &Scene, _: &Aabb, _: u32, _: u32) -> Result<Hierarchy> {
    Err(crate::Error::new("this policy is not built yet").help("use policy L or E"))
}
