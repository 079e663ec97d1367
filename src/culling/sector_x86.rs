//! Looking up 64 sectors at once (AVX-512) or 32 (AVX2): a byte shuffle of the table
//! of discarded sectors by the sectors of the triangles. A sector byte with its high
//! bit set gives 0: kept. Explicit intrinsics; the twin is `sector::look_up`.

use super::sector::Table;
use std::arch::x86_64::*;

pub fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
}

pub fn has_avx512() -> bool {
    is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bw")
}

/// See `sector::look_up`.
///
/// # Panics
/// If the processor lacks AVX-512 F and BW.
pub fn look_up_avx512(table: &Table, sectors: &[u8], keep: &mut [u64]) {
    assert!(has_avx512());
    // SAFETY: the processor has the features, as just asserted.
    unsafe { look_up_512(table, sectors, keep) }
}

/// See `sector::look_up`.
///
/// # Panics
/// If the processor lacks AVX2.
pub fn look_up_avx2(table: &Table, sectors: &[u8], keep: &mut [u64]) {
    assert!(has_avx2());
    // SAFETY: the processor has the features, as just asserted.
    unsafe { look_up_256(table, sectors, keep) }
}

#[target_feature(enable = "avx512f,avx512bw")]
fn look_up_512(table: &Table, sectors: &[u8], keep: &mut [u64]) {
    // SAFETY: a table is 16 bytes.
    let table = _mm512_broadcast_i32x4(unsafe { _mm_loadu_si128(table.as_ptr().cast()) });
    for (sectors, word) in sectors.chunks_exact(64).zip(keep) {
        // SAFETY: the chunk has 64 bytes.
        let sectors = unsafe { _mm512_loadu_si512(sectors.as_ptr().cast()) };
        *word &= !_mm512_movepi8_mask(_mm512_shuffle_epi8(table, sectors));
    }
}

#[target_feature(enable = "avx2")]
fn look_up_256(table: &Table, sectors: &[u8], keep: &mut [u64]) {
    // SAFETY: a table is 16 bytes.
    let table = _mm256_broadcastsi128_si256(unsafe { _mm_loadu_si128(table.as_ptr().cast()) });
    for (sectors, word) in sectors.chunks_exact(64).zip(keep) {
        // SAFETY: the chunk has 64 bytes, two registers.
        let (lo, hi) = unsafe {
            let at = sectors.as_ptr().cast::<__m256i>();
            (_mm256_loadu_si256(at), _mm256_loadu_si256(at.add(1)))
        };
        let gone = |s| _mm256_movemask_epi8(_mm256_shuffle_epi8(table, s)) as u32;
        *word &= !(u64::from(gone(lo)) | u64::from(gone(hi)) << 32);
    }
}
