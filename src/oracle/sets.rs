//! The exact sets of a frame: which triangles meet the view volume, and which
//! face the eye. What a method may leave out without losing anything is made of
//! these, never of an algorithm under test.

use super::lanes::Kernel;
use super::volume::Meets;
use crate::culling::Removes;
use crate::math::predicates::{Facing, Predicates};
use crate::math::{DVec3, View};
use crate::scene::Scene;

/// What is known of one triangle in one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Standing {
    pub meets: Meets,
    /// Front-facing, or two-sided.
    pub faces: bool,
}

impl Standing {
    /// May be part of an image: not certainly outside, and not averted.
    pub fn drawable(self) -> bool {
        self.faces && self.meets != Meets::CertainlyNot
    }

    /// Certainly in the set to which `removes` entitles; see [`conditions`].
    pub fn certainly_potential(self, removes: Removes) -> bool {
        let (volume, facing) = conditions(removes);
        (!volume || self.meets == Meets::Certainly) && (!facing || self.faces)
    }

    /// Not certainly outside that set.
    pub fn maybe_potential(self, removes: Removes) -> bool {
        let (volume, facing) = conditions(removes);
        (!volume || self.meets != Meets::CertainlyNot) && (!facing || self.faces)
    }

    pub(super) fn to_byte(self) -> u8 {
        (self.meets as u8) << 1 | u8::from(self.faces)
    }

    pub(super) fn from_byte(byte: u8) -> Option<Standing> {
        let meets = match byte >> 1 {
            0 => Meets::Certainly,
            1 => Meets::CertainlyNot,
            2 => Meets::Uncertain,
            _ => return None,
        };
        Some(Standing { meets, faces: byte & 1 == 1 })
    }
}

/// Which conditions bound the set that a method is entitled to reduce to:
/// (view volume, facing).
///
/// A method that removes back faces may judge them against all rays of the view
/// volume at once (normal masks do). Outside the volume such a judgement says
/// nothing of the eye's own ray, so beyond the volume it owes nothing. A method
/// that removes nothing owes every triangle.
fn conditions(removes: Removes) -> (bool, bool) {
    (removes.outside_frustum || removes.back_facing || removes.occluded, removes.back_facing || removes.occluded)
}

/// Standing of every triangle of the scene, and the predicates that it took.
pub fn standings(scene: &Scene, view: &View) -> (Vec<Standing>, Predicates) {
    super::sets_lanes::standings_on(Kernel::best(), scene, view)
}

/// Facing under the view's own rays: from the eye, or parallel.
pub fn faces_eye(view: &View, corners: &[DVec3; 3], predicates: &mut Predicates) -> Facing {
    let [a, b, c] = *corners;
    match view.is_perspective() {
        true => predicates.facing(a, b, c, view.eye),
        false => predicates.facing_along(a, b, c, view.forward),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_byte_form_reads_back() {
        for meets in [Meets::Certainly, Meets::CertainlyNot, Meets::Uncertain] {
            for faces in [false, true] {
                let s = Standing { meets, faces };
                assert_eq!(Standing::from_byte(s.to_byte()), Some(s));
            }
        }
        assert_eq!(Standing::from_byte(6), None);
    }

    #[test]
    fn a_method_that_removes_nothing_owes_everything() {
        let hidden = Standing { meets: Meets::CertainlyNot, faces: false };
        assert!(hidden.certainly_potential(Removes::default()));
        let frustum = Removes { outside_frustum: true, ..Removes::default() };
        assert!(!hidden.maybe_potential(frustum));
        let averted = Standing { meets: Meets::Certainly, faces: false };
        assert!(averted.certainly_potential(frustum));
        assert!(!averted.maybe_potential(Removes { back_facing: true, ..frustum }));
    }
}
