//! Handles of one table are noticed by another.
//!
//! The numbers of a table's handles start at a number of its own, so that a handle of another table is out
//! of range: this costs a subtraction where an index would be looked up anyway. Tables draw their numbers at
//! random from 32 bits; of a million wrong handles, less than one passes unnoticed, and does no harm but to
//! run another shader.

use std::{
    collections::hash_map::RandomState,
    hash::{BuildHasher, Hasher},
};

/// The number of a table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Identity(u32);

impl Identity {
    /// A number that no other table has, most likely.
    pub(crate) fn new() -> Self {
        Self(RandomState::new().build_hasher().finish() as u32)
    }

    /// The key of the handle to the last of some entries.
    pub(crate) fn last<T>(self, entries: &[T]) -> u32 {
        self.0.wrapping_add(entries.len() as u32).wrapping_sub(1)
    }

    /// The index that a key stands for; out of range if it is of another table.
    #[inline(always)]
    pub(crate) fn index(self, key: u32) -> usize {
        key.wrapping_sub(self.0) as usize
    }
}

impl Default for Identity {
    fn default() -> Self {
        Self::new()
    }
}
