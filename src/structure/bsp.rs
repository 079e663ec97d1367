//! bsp
use crate::{hierarchy::Hierarchy, registry::Entry, scene::Scene};
pub const ENTRY: Entry<dyn super::Structure> =
    Entry { name: "bsp", about: "", revision: 0, params: &[], make: |_| Box::new(Pending) };
struct Pending;
impl super::Structure for Pending {
    fn build(&self, _: &Scene) -> crate::Result<Hierarchy> {
        unimplemented!()
    }
}
