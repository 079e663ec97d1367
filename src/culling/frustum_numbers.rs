//! What the frustum test computes with, by arithmetic, decided once outside the loops.

use super::frustum_double::{DoublePlanes, Level};
use super::frustum_fixed::FixedPlanes;
use super::frustum_world::WorldPlanes;
use crate::hierarchy::BoundsBlock;
use crate::math::Arithmetic;

/// Planes and columns of an arithmetic other than the wide kernels' own.
pub(super) enum Numbers {
    /// Guarded single precision: the kernels.
    Single,
    World {
        planes: WorldPlanes,
        boxes: Vec<BoundsBlock>,
    },
    Double {
        level: Level,
        planes: DoublePlanes,
    },
    Fixed {
        planes: FixedPlanes,
        unfit: u64,
    },
}

impl Numbers {
    pub fn new(arithmetic: Arithmetic) -> Numbers {
        let double = |level| Numbers::Double { level, planes: DoublePlanes::default() };
        match arithmetic {
            Arithmetic::F32Relative => Numbers::Single,
            Arithmetic::F32World => Numbers::World { planes: WorldPlanes::default(), boxes: Vec::new() },
            Arithmetic::F64 => double(Level::F64),
            Arithmetic::Filtered => double(Level::Filtered),
            Arithmetic::Exact => double(Level::Exact),
            Arithmetic::FixedQ16 => Numbers::Fixed { planes: FixedPlanes::default(), unfit: 0 },
        }
    }
}
