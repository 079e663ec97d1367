//! Nearness in 16 bits, rounded down: the upper bits of its f32. 0 knows nothing; the largest
//! code stands for the near plane or nearer.
//!
//! Perspective: five bits of exponent and eleven of mantissa; 32 octaves reach from a near
//! plane at 0.1 m to 4e8 m, in steps of 0.05 %. Parallel rays: what stands for nearness
//! lies between R and 2 R, where R is the range of depths, so that 16 bits are even steps.

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Codes {
    pub shift: u32,
    pub base: i32,
}

impl Codes {
    /// For perspective: no nearness is above `most`.
    pub fn logarithmic(most: f32) -> Codes {
        let top = (most.clamp(0.0, f32::MAX).to_bits() >> 12) as i32;
        Codes { shift: 12, base: (top - 65535).max(0) }
    }

    /// For parallel rays: all values are above `least`, up to twice that.
    pub fn even(least: f32) -> Codes {
        let low = (least.clamp(0.0, f32::MAX).to_bits() >> 7) as i32;
        Codes { shift: 7, base: (low - 1).max(0) }
    }

    /// The code of a nearness that is not negative.
    #[inline]
    pub fn of(self, z: f32) -> u16 {
        ((z.to_bits() >> self.shift) as i32 - self.base).clamp(0, 65535) as u16
    }

    /// What a code stands for.
    #[inline]
    pub fn value(self, code: u16) -> f32 {
        if code == 0 { 0.0 } else { f32::from_bits(((i32::from(code) + self.base) as u32) << self.shift) }
    }
}
