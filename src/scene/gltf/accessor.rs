//! Typed reading of accessors with every range checked: a damaged file gives an
//! error, never a slice out of bounds. Sparse values are laid over the base.

use crate::error::{Error, Result};
use gltf::accessor::{DataType, Dimensions, sparse};
use std::borrow::Cow;
use std::cell::Cell;
use std::collections::HashMap;
use std::rc::Rc;

/// Without a buffer view an accessor is all zeros, at any length its author likes.
/// So many are allowed in a file, all accessors together: sparse values over
/// zeros are for small changes, and a few hundred bytes must not ask for gigabytes.
const MAX_IMPLIED: usize = 1 << 20;

pub struct Accessors<'a> {
    buffers: &'a [Cow<'a, [u8]>],
    /// Files share accessors between primitives, so each is decoded once.
    positions: HashMap<usize, Rc<Vec<[f32; 3]>>>,
    indices: HashMap<usize, Rc<Vec<u32>>>,
    implied: Cell<usize>,
}

impl<'a> Accessors<'a> {
    pub fn new(buffers: &'a [Cow<'a, [u8]>]) -> Accessors<'a> {
        Accessors { buffers, positions: HashMap::new(), indices: HashMap::new(), implied: Cell::new(0) }
    }

    pub fn positions(&mut self, accessor: &gltf::Accessor) -> Result<Rc<Vec<[f32; 3]>>> {
        if let Some(done) = self.positions.get(&accessor.index()) {
            return Ok(done.clone());
        }
        if (accessor.data_type(), accessor.dimensions()) != (DataType::F32, Dimensions::Vec3) {
            return Err(wrong(accessor, "positions", "three floats"));
        }
        let real = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        let values = self.read(accessor, 12, |b| [real(b), real(&b[4..]), real(&b[8..])])?;
        Ok(self.positions.entry(accessor.index()).or_insert(Rc::new(values)).clone())
    }

    pub fn indices(&mut self, accessor: &gltf::Accessor) -> Result<Rc<Vec<u32>>> {
        if let Some(done) = self.indices.get(&accessor.index()) {
            return Ok(done.clone());
        }
        if accessor.dimensions() != Dimensions::Scalar {
            return Err(wrong(accessor, "indices", "whole numbers"));
        }
        let values = match accessor.data_type() {
            DataType::U8 => self.read(accessor, 1, |b| u32::from(b[0])),
            DataType::U16 => self.read(accessor, 2, |b| u32::from(u16::from_le_bytes([b[0], b[1]]))),
            DataType::U32 => self.read(accessor, 4, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            _ => Err(wrong(accessor, "indices", "whole numbers")),
        }?;
        Ok(self.indices.entry(accessor.index()).or_insert(Rc::new(values)).clone())
    }

    fn read<T: Copy + Default>(&self, a: &gltf::Accessor, size: usize, item: impl Fn(&[u8]) -> T) -> Result<Vec<T>> {
        let at = |e: Error| e.key(format!("accessor {}", a.index()));
        let mut values = match a.view() {
            Some(view) => self.items(&view, a.offset(), a.count(), size, &item).map_err(at)?,
            None => {
                self.implied.set(self.implied.get().saturating_add(a.count()));
                if self.implied.get() > MAX_IMPLIED {
                    let message = format!("{} values without data", self.implied.get());
                    return Err(at(Error::new(message).help("export the file again")));
                }
                vec![T::default(); a.count()]
            }
        };
        if let Some(sparse) = a.sparse() {
            let (i, v) = (sparse.indices(), sparse.values());
            let count = sparse.count();
            let number = |b: &[u8]| b.iter().rev().fold(0u32, |n, b| n << 8 | u32::from(*b));
            let width = match i.index_type() {
                sparse::IndexType::U8 => 1,
                sparse::IndexType::U16 => 2,
                sparse::IndexType::U32 => 4,
            };
            let indices = self.items(&i.view(), i.offset(), count, width, &number).map_err(at)?;
            let replaced = self.items(&v.view(), v.offset(), count, size, &item).map_err(at)?;
            for (i, value) in indices.into_iter().zip(replaced) {
                *values.get_mut(i as usize).ok_or_else(|| {
                    at(Error::new(format!("sparse index {i} is out of range"))
                        .help("the file is damaged: export it again"))
                })? = value;
            }
        }
        Ok(values)
    }

    /// `count` items of `size` bytes from a view.
    fn items<T>(
        &self,
        view: &gltf::buffer::View,
        offset: usize,
        count: usize,
        size: usize,
        item: &impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>> {
        let stride = view.stride().unwrap_or(size);
        let range = |start: usize, length: usize| Some((start, start.checked_add(length)?));
        let slice = || {
            let (start, end) = range(view.offset(), view.length())?;
            let bytes = self.buffers.get(view.buffer().index())?.get(start..end)?;
            let length = count.checked_sub(1).map_or(Some(0), |n| n.checked_mul(stride)?.checked_add(size))?;
            let (start, end) = range(offset, length)?;
            (stride >= size).then_some(())?;
            bytes.get(start..end)
        };
        let bytes = slice().ok_or_else(|| {
            Error::new(format!("{count} values of {size} bytes reach beyond buffer view {}", view.index()))
                .help("the file is damaged or was cut short: export it again")
        })?;
        // The last item may end before a whole stride does.
        Ok(bytes.chunks(stride).map(|b| item(&b[..size])).collect())
    }
}

fn wrong(a: &gltf::Accessor, what: &str, want: &str) -> Error {
    let have = format!("{:?} {:?}", a.dimensions(), a.data_type());
    Error::new(format!("accessor {} holds {have}, but {what} must be {want}", a.index()))
        .help("export it without quantization, or with gltf-transform dequantize")
}
