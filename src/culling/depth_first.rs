//! depth_first
use super::*;
pub const ENTRY: Entry<dyn Walk> =
    Entry { name: "depth_first", about: "", revision: 0, params: &[], make: |_| unimplemented!() };
