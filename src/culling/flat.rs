//! flat
use super::*;
pub const ENTRY: Entry<dyn Walk> =
    Entry { name: "flat", about: "", revision: 0, params: &[], make: |_| unimplemented!() };
