//! The triangles that hide, by position in the order of a hierarchy's entries.

use crate::math::DVec3;

/// What a position hides with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Seen through: hides nothing.
    Clear,
    /// Its front hides; seen from behind it is not drawn.
    OneSided,
    TwoSided,
}

/// Occluders about a common origin.
#[derive(Debug, Clone, Default)]
pub struct Occluders {
    corners: Vec<[DVec3; 3]>,
    kinds: Vec<u8>,
}

impl Occluders {
    /// Of `count` positions with world-space `corners` and `kind`. `starts` are positions,
    /// ascending, at which ranges that are drawn usually begin (the leaves); it has no
    /// influence on what is drawn.
    pub fn new(
        count: u32,
        origin: DVec3,
        corners: impl Fn(u32) -> [DVec3; 3],
        kind: impl Fn(u32) -> Kind,
        starts: &[u32],
    ) -> Occluders {
        let _ = starts;
        Occluders {
            corners: (0..count).map(|p| corners(p).map(|c| c - origin)).collect(),
            kinds: (0..count).map(|p| kind(p) as u8).collect(),
        }
    }

    pub fn len(&self) -> usize {
        self.corners.len()
    }

    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&self.corners[..]) + self.kinds.len()
    }

    /// Corners relative to the origin.
    pub fn corners(&self, position: u32) -> [DVec3; 3] {
        self.corners[position as usize]
    }

    pub fn kind(&self, position: u32) -> Kind {
        match self.kinds[position as usize] {
            0 => Kind::Clear,
            1 => Kind::OneSided,
            _ => Kind::TwoSided,
        }
    }
}
