//! Nearness in 16 bits: sign-less floats with five bits of exponent and eleven of mantissa,
//! rounded down. 0 knows nothing; the largest code stands for the near plane or nearer.
//! 32 octaves reach from a near plane at 0.1 m to 4e8 m, in steps of 0.05 %.

/// What the upper 20 bits of an f32 are less its code, if no nearness is above `most`.
pub fn base(most: f32) -> i32 {
    let top = (most.max(0.0).min(f32::MAX).to_bits() >> 12) as i32;
    (top - 65535).max(0)
}

/// The code of a nearness that is not negative: rounded down.
#[inline]
pub fn of(z: f32, base: i32) -> u16 {
    ((z.to_bits() >> 12) as i32 - base).clamp(0, 65535) as u16
}

/// What a code stands for.
#[inline]
pub fn value(code: u16, base: i32) -> f32 {
    if code == 0 { 0.0 } else { f32::from_bits(((i32::from(code) + base) as u32) << 12) }
}
