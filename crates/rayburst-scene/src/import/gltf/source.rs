//! The file being read: its JSON, the bytes of its buffers, and what may still be allocated.

use std::{cell::Cell, ops::Range, path::Path};

use super::json::Root;
use crate::import::{ImportError, LoadOptions, Resolver};

/// A parsed file with its buffers.
pub(super) struct Source<'a> {
    pub(super) path: &'a Path,
    pub(super) root: &'a Root,
    pub(super) resolver: &'a Resolver,
    file: &'a [u8],
    buffers: Vec<Bytes>,
    /// Bytes of decoded geometry that may still be made.
    geometry: Cell<u64>,
    /// Bytes that may still be made of accessors without data.
    implied: Cell<u64>,
    options: &'a LoadOptions,
}

enum Bytes {
    /// No URI and not the binary chunk: an error once used.
    Missing,
    /// The binary chunk of the GLB.
    Chunk(Range<usize>),
    Own(Vec<u8>),
}

impl<'a> Source<'a> {
    /// Reads all buffers.
    pub(super) fn open(
        path: &'a Path,
        root: &'a Root,
        file: &'a [u8],
        binary: Option<Range<usize>>,
        resolver: &'a Resolver,
        options: &'a LoadOptions,
    ) -> Result<Self, ImportError> {
        let mut buffers = Vec::with_capacity(root.buffers.len());
        let mut total = 0u64;
        for (index, buffer) in root.buffers.iter().enumerate() {
            let location = || format!("/buffers/{index}");
            let bytes = match (&buffer.uri, &binary) {
                (Some(uri), _) => {
                    let bytes = resolver
                        .read_uri(uri)
                        .map_err(|e| ImportError::unresolved(path, location(), e))?;
                    Bytes::Own(bytes)
                }
                (None, Some(chunk)) if index == 0 => Bytes::Chunk(chunk.clone()),
                (None, _) => Bytes::Missing,
            };
            let length = match &bytes {
                Bytes::Missing => buffer.byte_length,
                Bytes::Chunk(range) => range.len() as u64,
                Bytes::Own(bytes) => bytes.len() as u64,
            };
            if length < buffer.byte_length {
                let promised = buffer.byte_length;
                let reason = format!("{promised} bytes are promised, only {length} are there");
                return Err(ImportError::malformed(path, location(), reason));
            }
            if let Bytes::Own(bytes) = &bytes {
                total = total.saturating_add(bytes.len() as u64);
                if total > options.max_file_bytes {
                    return Err(ImportError::TooLarge {
                        path: path.to_path_buf(),
                        location: location(),
                        what: format!("buffers of {total} bytes"),
                        limit: format!("{} bytes", options.max_file_bytes),
                    });
                }
            }
            buffers.push(bytes);
        }
        Ok(Self {
            path,
            root,
            resolver,
            file,
            buffers,
            geometry: Cell::new(options.max_geometry_bytes),
            implied: Cell::new(options.max_implied_bytes),
            options,
        })
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, index: usize) -> Result<&[u8], ImportError> {
        let location = || format!("/bufferViews/{index}");
        let Some(view) = self.root.buffer_views.get(index) else {
            return Err(self.malformed(location(), "there is no such buffer view"));
        };
        if let Some(name) = view.extensions.keys().find(|name| name.contains("meshopt")) {
            let reason = format!("compressed with {name}, which is not supported");
            return Err(self.malformed(location(), reason));
        }
        let buffer = match self.buffers.get(view.buffer) {
            Some(Bytes::Own(bytes)) => bytes.as_slice(),
            Some(Bytes::Chunk(range)) => self.file.get(range.clone()).unwrap_or_default(),
            Some(Bytes::Missing) => {
                let reason = format!("buffer {} has no data", view.buffer);
                return Err(self.malformed(location(), reason));
            }
            None => {
                let reason = format!("there is no buffer {}", view.buffer);
                return Err(self.malformed(location(), reason));
            }
        };
        let end = view.byte_offset.checked_add(view.byte_length);
        let range = end.and_then(|end| {
            Some(usize::try_from(view.byte_offset).ok()?..usize::try_from(end).ok()?)
        });
        range.and_then(|range| buffer.get(range)).ok_or_else(|| {
            let (offset, length, size) = (view.byte_offset, view.byte_length, buffer.len());
            let reason = format!(
                "{length} bytes from {offset} on go beyond the end of buffer {}, which has {size}",
                view.buffer
            );
            self.malformed(location(), reason)
        })
    }

    /// Takes decoded bytes from what may be allocated.
    pub(super) fn charge(
        &self,
        bytes: u64,
        location: impl Fn() -> String,
    ) -> Result<(), ImportError> {
        take(&self.geometry, bytes).ok_or_else(|| ImportError::TooLarge {
            path: self.path.to_path_buf(),
            location: location(),
            what: format!("{bytes} more bytes of geometry"),
            limit: format!("{} bytes in all", self.options.max_geometry_bytes),
        })
    }

    /// Takes bytes that the file describes but does not hold.
    pub(super) fn charge_implied(
        &self,
        bytes: u64,
        location: impl Fn() -> String,
    ) -> Result<(), ImportError> {
        take(&self.implied, bytes).ok_or_else(|| ImportError::TooLarge {
            path: self.path.to_path_buf(),
            location: location(),
            what: format!("{bytes} more bytes that the file does not hold"),
            limit: format!("{} bytes in all", self.options.max_implied_bytes),
        })
    }

    /// A [`ImportError::Malformed`] of this file.
    pub(super) fn malformed(
        &self,
        location: impl Into<String>,
        reason: impl Into<String>,
    ) -> ImportError {
        ImportError::malformed(self.path, location, reason)
    }
}

fn take(left: &Cell<u64>, bytes: u64) -> Option<()> {
    left.set(left.get().checked_sub(bytes)?);
    Some(())
}
