//! Storage that all launches of a dispatch may write (DXR's unordered access views), in safe Rust.
//!
//! Memory is words of 32 bits, each written as a whole. A value of several words that one launch writes
//! while another reads or writes it may be seen in parts, as on a GPU: give each launch its own elements, or
//! use the atomic operations.

use std::{
    marker::PhantomData,
    sync::atomic::{AtomicU32, Ordering},
};

use bytemuck::{AnyBitPattern, NoUninit};
use glam::UVec2;

/// Elements that shaders read and write by index (DXR's `RWStructuredBuffer`).
#[derive(Debug)]
pub struct RwBuffer<T> {
    words: Vec<AtomicU32>,
    element: PhantomData<T>,
}

impl<T: NoUninit + AnyBitPattern> RwBuffer<T> {
    /// Words of an element. Types whose size is no multiple of four bytes do not compile.
    const WORDS: usize = {
        assert!(size_of::<T>() > 0 && size_of::<T>().is_multiple_of(4));
        size_of::<T>() / 4
    };

    /// So many elements of zero bytes.
    pub fn new(len: usize) -> Self {
        let words = (0..len.saturating_mul(Self::WORDS)).map(|_| AtomicU32::new(0)).collect();
        Self { words, element: PhantomData }
    }

    /// The elements of a slice.
    pub fn from_slice(elements: &[T]) -> Self {
        let buffer = Self::new(elements.len());
        elements.iter().enumerate().for_each(|(index, &element)| buffer.store(index, element));
        buffer
    }

    /// How many elements there are.
    pub fn len(&self) -> usize {
        self.words.len() / Self::WORDS
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    fn words(&self, index: usize) -> Option<&[AtomicU32]> {
        let start = index.checked_mul(Self::WORDS)?;
        self.words.get(start..start.checked_add(Self::WORDS)?)
    }

    /// Reads an element; beyond the end zero, as in DXR.
    pub fn load(&self, index: usize) -> T {
        let mut value = T::zeroed();
        let (bytes, _) = bytemuck::bytes_of_mut(&mut value).as_chunks_mut();
        for (bytes, word) in bytes.iter_mut().zip(self.words(index).into_iter().flatten()) {
            *bytes = word.load(Ordering::Relaxed).to_ne_bytes();
        }
        value
    }

    /// Writes an element; beyond the end nothing happens, as in DXR.
    pub fn store(&self, index: usize, value: T) {
        let (bytes, _) = bytemuck::bytes_of(&value).as_chunks();
        for (&bytes, word) in bytes.iter().zip(self.words(index).into_iter().flatten()) {
            word.store(u32::from_ne_bytes(bytes), Ordering::Relaxed);
        }
    }

    /// All elements.
    pub fn to_vec(&self) -> Vec<T> {
        (0..self.len()).map(|index| self.load(index)).collect()
    }
}

impl RwBuffer<u32> {
    /// Adds to an element and gives what it was (DXR's `InterlockedAdd`); beyond the end zero.
    pub fn atomic_add(&self, index: usize, value: u32) -> u32 {
        self.words.get(index).map_or(0, |word| word.fetch_add(value, Ordering::Relaxed))
    }

    /// Keeps the lesser of an element and a value, and gives what it was (DXR's `InterlockedMin`).
    pub fn atomic_min(&self, index: usize, value: u32) -> u32 {
        self.words.get(index).map_or(0, |word| word.fetch_min(value, Ordering::Relaxed))
    }

    /// Keeps the greater of an element and a value, and gives what it was (DXR's `InterlockedMax`).
    pub fn atomic_max(&self, index: usize, value: u32) -> u32 {
        self.words.get(index).map_or(0, |word| word.fetch_max(value, Ordering::Relaxed))
    }
}

/// Texels that shaders read and write by position (DXR's `RWTexture2D`), row by row from the top.
#[derive(Debug)]
pub struct RwTexture<T> {
    width: u32,
    texels: RwBuffer<T>,
}

impl<T: NoUninit + AnyBitPattern> RwTexture<T> {
    /// Texels of zero bytes.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, texels: RwBuffer::new(width as usize * height as usize) }
    }

    /// The texels of rows of some width, from the top; `None` if they are no whole rows.
    pub fn from_slice(width: u32, texels: &[T]) -> Option<Self> {
        let is_whole = match width {
            0 => texels.is_empty(),
            _ => texels.len().is_multiple_of(width as usize),
        };
        let height = texels.len().checked_div(width as usize).unwrap_or(0);
        (is_whole && u32::try_from(height).is_ok())
            .then(|| Self { width, texels: RwBuffer::from_slice(texels) })
    }

    /// Width and height, in texels.
    pub fn size(&self) -> UVec2 {
        let rows = self.texels.len().checked_div(self.width as usize);
        UVec2::new(self.width, rows.unwrap_or(0) as u32)
    }

    fn index(&self, at: UVec2) -> usize {
        if at.x < self.width {
            at.y as usize * self.width as usize + at.x as usize
        } else {
            usize::MAX
        }
    }

    /// Reads a texel; outside zero.
    pub fn load(&self, at: UVec2) -> T {
        self.texels.load(self.index(at))
    }

    /// Writes a texel; outside nothing happens.
    pub fn store(&self, at: UVec2, value: T) {
        self.texels.store(self.index(at), value);
    }

    /// All texels, row by row: what image files and [`RwTexture::from_slice`] take.
    pub fn to_vec(&self) -> Vec<T> {
        self.texels.to_vec()
    }
}
