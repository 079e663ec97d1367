//! `look_at`: the back-face test of Silva (2009) by the look-at vector alone. A
//! triangle is discarded iff `n.f >= 0`, for its normal `n` and the view axis `f`.
//!
//! **Aggressive** under perspective: what decides facing is the ray to the triangle,
//! which is off the axis by an angle `t`, so of isotropic normals a share `t / pi` is
//! judged wrongly, half of it front faces lost. Under parallel rays the axis *is* the
//! ray, and the test is right.
//!
//! Two-sided triangles, and those without area, are kept. What we changed: sixteen
//! triangles at once, in the kernel of the plane form with the eye at minus `f` and
//! no offset.

use super::facing_columns::{Eye32, PlaneBlock, normals};
use super::facing_kernels::{Kernels, kernels};
use super::*;

pub const ENTRY: Entry<dyn Test> = Entry {
    name: "look_at",
    about: "triangles whose normals point along the view axis (Silva 2009; aggressive)",
    revision: 1,
    params: &[],
    make: |_| Box::new(LookAt::new(kernels()[0])),
};

/// The test. Column: a unit normal a position.
pub struct LookAt {
    blocks: Vec<PlaneBlock>,
    axis: Eye32,
    kernels: Kernels,
}

impl LookAt {
    pub fn new(kernels: Kernels) -> LookAt {
        LookAt { blocks: Vec::new(), axis: Eye32::default(), kernels }
    }
}

impl Test for LookAt {
    fn class(&self) -> Class {
        Class::Aggressive
    }

    fn removes(&self) -> Removes {
        Removes { back_facing: true, ..Default::default() }
    }

    fn prepare(&mut self, scene: &Scene, hierarchy: &Hierarchy) -> usize {
        self.blocks = normals(scene, hierarchy);
        size_of_val(&self.blocks[..])
    }

    fn begin(&mut self, view: &View, _: &Hierarchy) {
        self.axis = Eye32 { eye: (-view.forward).as_vec3().to_array(), ..Eye32::default() };
    }

    fn initial_carry(&self) -> u8 {
        0
    }

    fn judge(&mut self, _: &Hierarchy, _: u32, _: u8, _: u8, _: &mut Tally) -> Verdict {
        Verdict { outside: 0, carry: [0; 8] }
    }

    fn filter(&mut self, _: &Hierarchy, list: &mut DrawList, tally: &mut Tally) {
        tally.triangle_tests +=
            list.retain_words(|w, keep| (self.kernels.plane)(&self.axis, &self.blocks[4 * w..], keep));
    }
}
