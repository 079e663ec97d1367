//! Per-frame series as compressed bytes, without loss.
//!
//! Values are written in the narrowest type that keeps every bit (u32, f32 or
//! f64), whole numbers as differences of neighbours; then bytes of the same
//! significance are laid side by side (byte shuffle, as in Blosc: Alted, 2010)
//! so that zstd finds the runs in exponents and high bytes.

use crate::error::{Error, Result};
use std::cell::RefCell;
use zstd::bulk::{Compressor, Decompressor};

const LEVEL: i32 = 3;

thread_local! {
    // Series are short: making the tables anew for each costs more than using them.
    static COMPRESSOR: RefCell<Compressor<'static>> =
        RefCell::new(Compressor::new(LEVEL).expect("memory for compressing"));
    static DECOMPRESSOR: RefCell<Decompressor<'static>> =
        RefCell::new(Decompressor::new().expect("memory for decompressing"));
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Kind {
    F64 = 0,
    F32 = 1,
    /// Whole numbers below 2^32.
    U32 = 2,
    /// The same as zigzag differences (wrapping).
    U32Delta = 3,
}

/// `[kind, count as u32 LE, zstd frame]`.
///
/// # Panics
/// If there are 2^32 values or more: frames are counted in `u32`.
pub fn encode(values: &[f64]) -> Vec<u8> {
    let whole: Option<Vec<u32>> = values.iter().map(|v| whole(*v)).collect();
    if let Some(whole) = whole {
        // Counts drift from frame to frame, times do not: the shorter one is kept.
        let plain = pack(Kind::U32, values.len(), &shuffle(whole.iter().map(|v| v.to_le_bytes())));
        let delta = pack(Kind::U32Delta, values.len(), &shuffle(deltas(&whole).into_iter().map(u32::to_le_bytes)));
        return if delta.len() < plain.len() { delta } else { plain };
    }
    if values.iter().all(|v| f64::from(*v as f32).to_bits() == v.to_bits()) {
        return pack(Kind::F32, values.len(), &shuffle(values.iter().map(|v| (*v as f32).to_le_bytes())));
    }
    pack(Kind::F64, values.len(), &shuffle(values.iter().map(|v| v.to_le_bytes())))
}

/// # Errors
/// When the bytes are not what [`encode`] wrote.
pub fn decode(bytes: &[u8]) -> Result<Vec<f64>> {
    let damaged = || Error::new("a stored series is damaged").help("restore the database from a copy or an export");
    let ([kind, a, b, c, d], frame) = bytes.split_first_chunk::<5>().ok_or_else(damaged)?;
    let count = u32::from_le_bytes([*a, *b, *c, *d]) as usize;
    let width = if *kind == Kind::F64 as u8 { 8 } else { 4 };
    let raw = DECOMPRESSOR.with_borrow_mut(|z| z.decompress(frame, count * width)).map_err(|_| damaged())?;
    if raw.len() != count * width {
        return Err(damaged());
    }
    let words = || (0..count).map(|i| u32::from_le_bytes(gather(&raw, count, i)));
    Ok(match *kind {
        k if k == Kind::F64 as u8 => (0..count).map(|i| f64::from_le_bytes(gather(&raw, count, i))).collect(),
        k if k == Kind::F32 as u8 => words().map(|w| f64::from(f32::from_bits(w))).collect(),
        k if k == Kind::U32 as u8 => words().map(f64::from).collect(),
        k if k == Kind::U32Delta as u8 => words()
            .scan(0u32, |last, z| {
                *last = last.wrapping_add((z >> 1) ^ (z & 1).wrapping_neg());
                Some(f64::from(*last))
            })
            .collect(),
        _ => return Err(damaged()),
    })
}

/// `v` as u32 if that keeps every bit (-0.0 does not).
fn whole(v: f64) -> Option<u32> {
    let w = v as u32;
    (f64::from(w).to_bits() == v.to_bits()).then_some(w)
}

/// Zigzag: small differences of either sign become small numbers.
fn deltas(values: &[u32]) -> Vec<u32> {
    let before = std::iter::once(0).chain(values.iter().copied());
    let zigzag = |d: i32| ((d << 1) ^ (d >> 31)) as u32;
    values.iter().zip(before).map(|(v, p)| zigzag(v.wrapping_sub(p) as i32)).collect()
}

/// All first bytes, then all second bytes, and so on.
fn shuffle<const W: usize>(values: impl ExactSizeIterator<Item = [u8; W]>) -> Vec<u8> {
    let count = values.len();
    let mut out = vec![0; count * W];
    for (i, bytes) in values.enumerate() {
        for (lane, byte) in bytes.into_iter().enumerate() {
            out[lane * count + i] = byte;
        }
    }
    out
}

fn gather<const W: usize>(raw: &[u8], count: usize, i: usize) -> [u8; W] {
    std::array::from_fn(|lane| raw[lane * count + i])
}

fn pack(kind: Kind, count: usize, raw: &[u8]) -> Vec<u8> {
    let count = u32::try_from(count).expect("frames are counted in u32");
    let mut out = vec![kind as u8];
    out.extend_from_slice(&count.to_le_bytes());
    out.extend(COMPRESSOR.with_borrow_mut(|z| z.compress(raw)).expect("compressing memory to memory"));
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::{RngCore, SeedableRng};

    fn bits(v: &[f64]) -> Vec<u64> {
        v.iter().map(|x| x.to_bits()).collect()
    }

    #[test]
    fn every_bit_comes_back_whatever_the_values() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut random = |n: usize, f: fn(u64) -> f64| (0..n).map(|_| f(rng.next_u64())).collect::<Vec<_>>();
        let cases: [(Vec<f64>, Kind); 9] = [
            (vec![], Kind::U32),
            (vec![0.0, 1.0, 4294967295.0, 0.0], Kind::U32),
            (vec![-0.0], Kind::F32),
            (vec![f64::NAN, f64::INFINITY], Kind::F64),
            (vec![4294967296.0], Kind::F32),
            (vec![0.1, 0.2], Kind::F64),
            (random(999, f64::from_bits), Kind::F64),
            (random(999, |b| f64::from(b as f32)), Kind::F32),
            (random(999, |b| (b >> 40) as f64), Kind::U32),
        ];
        for (values, kind) in cases {
            let blob = encode(&values);
            assert_eq!(bits(&decode(&blob).unwrap()), bits(&values), "{values:?}");
            if !values.iter().any(|v| v.is_nan()) && values.len() != 4 && !values.is_empty() {
                assert_eq!(blob[0], kind as u8, "{:?}", &values[..1]);
            }
        }
    }

    #[test]
    fn a_smooth_count_shrinks_a_lot_and_damage_is_noticed() {
        let values: Vec<f64> =
            (0..2000).map(|i| 50_000.0 + (f64::from(i) * 0.01).sin().mul_add(9e3, 0.0).round()).collect();
        let blob = encode(&values);
        assert!(blob.len() * 5 < values.len() * 8, "{} bytes", blob.len());
        assert_eq!(decode(&blob).unwrap(), values);
        assert!(decode(&blob[..blob.len() - 3]).is_err());
        assert!(decode(&blob[..3]).is_err());
        let mut wrong = blob.clone();
        wrong[1] ^= 1;
        assert!(decode(&wrong).is_err());
    }
}
