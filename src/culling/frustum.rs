//! frustum
use super::*;
pub const ENTRY: Entry<dyn Test> =
    Entry { name: "frustum", about: "", revision: 0, params: &[], make: |_| unimplemented!() };
