//! In which numbers a predicate is evaluated: the arithmetic axis of a study.
//!
//! The levels are those between which an engine chooses, from what most do (`f32`
//! in world coordinates) to Shewchuk's exact predicates (1997), and the fixed
//! point that Silva (2009) proposes for processors without a floating-point unit.
//! A test that knows them declares a parameter `arithmetic` ([`NAME`]); where it
//! is not given, the axis of the same name decides.

use crate::error::{Error, Result, did_you_mean};
use serde::{Deserialize, Serialize};
use std::fmt;

/// From the least to the most careful; fixed point stands apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Arithmetic {
    /// Single precision in world coordinates, no guard: as engines write it. It may lose anything.
    F32World,
    /// Single precision relative to the camera, with a proved guard.
    #[default]
    F32Relative,
    /// Double precision relative to the camera, with a proved guard.
    F64,
    /// Single precision with an error bound; what that leaves open falls back to
    /// double precision, and what that leaves open to exact arithmetic.
    Filtered,
    /// Exact signs.
    Exact,
    /// Camera-relative Q15.16 fixed point in whole numbers: the same bits
    /// everywhere; an overflow is an error.
    FixedQ16,
}

/// Name of the parameter by which a test takes its arithmetic, and of the axis.
pub const NAME: &str = "arithmetic";

impl Arithmetic {
    pub const ALL: [Arithmetic; 6] = [
        Arithmetic::F32World,
        Arithmetic::F32Relative,
        Arithmetic::F64,
        Arithmetic::Filtered,
        Arithmetic::Exact,
        Arithmetic::FixedQ16,
    ];
    /// Spellings, in the order of [`Arithmetic::ALL`].
    pub const NAMES: &[&str] = &["f32_world", "f32_relative", "f64", "filtered", "exact", "fixed_q16"];

    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    pub fn named(name: &str) -> Option<Arithmetic> {
        Self::ALL.into_iter().find(|a| a.name() == name)
    }

    /// # Errors
    /// With the nearest name there is, or all of them.
    pub fn parse(name: &str) -> Result<Arithmetic> {
        Self::named(name).ok_or_else(|| {
            let near = did_you_mean(name, Self::NAMES.iter().copied()).map(|n| format!("did you mean `{n}`?"));
            Error::new(format!("unknown arithmetic `{name}`"))
                .help(near.unwrap_or_else(|| format!("known: {}", Self::NAMES.join(", "))))
        })
    }

    /// Revision of the predicates: raised when an answer changes.
    pub fn revision(self) -> u32 {
        1
    }

    pub fn about(self) -> &'static str {
        match self {
            Arithmetic::F32World => "single precision in world coordinates without a guard (may lose triangles)",
            Arithmetic::F32Relative => "single precision relative to the camera, guarded",
            Arithmetic::F64 => "double precision relative to the camera, guarded",
            Arithmetic::Filtered => "guarded single, then double, then exact where needed",
            Arithmetic::Exact => "exact signs",
            Arithmetic::FixedQ16 => "camera-relative Q15.16 whole numbers",
        }
    }
}

impl fmt::Display for Arithmetic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_reads_back() {
        for (a, name) in Arithmetic::ALL.into_iter().zip(Arithmetic::NAMES) {
            assert_eq!((a.name(), Arithmetic::named(name)), (*name, Some(a)));
            assert_eq!(serde_json::to_string(&a).unwrap(), format!("\"{name}\""));
        }
        assert_eq!(Arithmetic::named("f16"), None);
    }
}
