//! normal_mask
use super::*;
pub const ENTRY: Entry<dyn Test> =
    Entry { name: "normal_mask", about: "", revision: 0, params: &[], make: |_| unimplemented!() };
