use super::builder::Builder;
use super::{Entry, Generator};
use crate::registry::{Default, Param};
use crate::scene::Scene;
pub(super) const TRIANGLES_MIN: i64 = 16_000;
pub const ENTRY: Entry<dyn Generator> = Entry {
    name: "arena",
    about: "",
    revision: 1,
    params: &[Param { name: "seed", default: Default::Int { value: 1, min: 0, max: i64::MAX }, about: "" }],
    make: |_| Box::new(X),
};
struct X;
impl Generator for X {
    fn generate(&self) -> Scene {
        Builder::new("x").finish()
    }
}
