//! From compressed blocks to planes of floats.
//!
//! The library's own readers either abort the process when a damaged block makes a decompressor
//! panic in a pool thread, or trust the sizes that some compressions repeat inside each block. So
//! blocks are checked one by one here, and decompressed in parallel batches.

use std::io::Cursor;

use ::exr::block::UncompressedBlock;
use ::exr::block::chunk::{Chunk, CompressedBlock};
use ::exr::block::reader::Reader;
use ::exr::error::{Error, Result};
use ::exr::meta::MetaData;
use ::exr::meta::attribute::{SampleType, Text};
use ::exr::meta::header::Header;
use ::exr::prelude::{Compression, Vec2, f16};
use rayon::prelude::*;

use crate::Precision;

/// Blocks that are decompressed at a time.
const BATCH: usize = 64;

/// One channel of one part, in its data window.
pub(super) struct Plane {
    pub(super) name: Text,
    pub(super) precision: Precision,
    pub(super) values: Vec<f32>,
    kind: SampleType,
}

/// The planes of every part, at the finest level.
pub(super) fn read(bytes: &[u8]) -> Result<(MetaData, Vec<Vec<Plane>>)> {
    let reader = Reader::read_from_buffered(Cursor::new(bytes), false)?;
    let meta = reader.meta_data().clone();
    let mut parts: Vec<Vec<Plane>> = meta.headers.iter().map(empty_planes).collect();
    let mut missing: Vec<u64> = meta.headers.iter().map(|h| h.layer_size.area() as u64).collect();

    let finest = Vec2(0, 0);
    let mut chunks = reader.filter_chunks(false, |_, tile, _| tile.level_index == finest)?;
    loop {
        let batch: Vec<Chunk> = chunks.by_ref().take(BATCH).collect::<Result<_>>()?;
        if batch.is_empty() {
            break;
        }
        let blocks: Vec<UncompressedBlock> = batch
            .into_par_iter()
            .map(|chunk| {
                check_chunk(&meta, &chunk)?;
                UncompressedBlock::decompress_chunk(chunk, &meta, false)
            })
            .collect::<Result<_>>()?;
        for block in blocks {
            let part = block.index.layer;
            missing[part] = missing[part].saturating_sub(block.index.pixel_size.area() as u64);
            scatter(&block, &meta.headers[part], &mut parts[part]);
        }
    }
    if missing.iter().any(|&pixels| pixels != 0) {
        return Err(Error::Invalid("some blocks of the file are missing".into()));
    }
    Ok((meta, parts))
}

fn empty_planes(header: &Header) -> Vec<Plane> {
    let pixels = header.layer_size.area();
    let plane = |channel: &::exr::meta::attribute::ChannelDescription| Plane {
        name: channel.name.clone(),
        precision: match channel.sample_type {
            SampleType::F16 => Precision::Half,
            _ => Precision::Float,
        },
        values: vec![0.0; pixels],
        kind: channel.sample_type,
    };
    header.channels.list.iter().map(plane).collect()
}

/// Refuses blocks that are not of the finest level, or that promise absurd sizes.
fn check_chunk(meta: &MetaData, chunk: &Chunk) -> Result<()> {
    let invalid = |what: &'static str| Err(Error::Invalid(what.into()));
    let Some(header) = meta.headers.get(chunk.layer_index) else {
        return invalid("a block belongs to no part");
    };
    let data = match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) if block.coordinates.level_index == Vec2(0, 0) => {
            &block.compressed_pixels_le
        }
        _ => return invalid("a block is of another kind than its place"),
    };
    let tile = header.get_block_data_indices(&chunk.compressed_block)?;
    let pixels = header.get_absolute_block_pixel_coordinates(tile)?.size.area();
    let most = pixels * header.channels.bytes_per_pixel;
    let dwa = matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_));
    // What does not shrink is stored as it is.
    if dwa && data.len() != most {
        // Nine sizes follow the version, all of things no larger than a few times the block.
        let limit = (4 * most + (1 << 16)) as u64;
        let sizes = data.chunks_exact(8).take(10).skip(1);
        let size = |b: &[u8]| b.iter().rev().fold(0u64, |n, &b| n << 8 | u64::from(b));
        if sizes.map(size).any(|size| size > limit) {
            return invalid("a DWA block promises more than it can hold");
        }
    }
    Ok(())
}

/// Copies a block's lines, which alternate between the channels, into the planes.
fn scatter(block: &UncompressedBlock, header: &Header, planes: &mut [Plane]) {
    let width = header.layer_size.width();
    for line in block.lines(&header.channels) {
        let plane = &mut planes[line.location.channel];
        let Vec2(x, y) = line.location.position;
        let row = &mut plane.values[y * width + x..][..line.location.sample_count];
        match plane.kind {
            SampleType::F16 => fill(row, line.value, |b| f16::from_ne_bytes(b).to_f32()),
            SampleType::F32 => fill(row, line.value, f32::from_ne_bytes),
            SampleType::U32 => fill(row, line.value, |b| u32::from_ne_bytes(b) as f32),
        }
    }
}

fn fill<const N: usize>(row: &mut [f32], bytes: &[u8], value: impl Fn([u8; N]) -> f32) {
    for (to, from) in row.iter_mut().zip(bytes.as_chunks::<N>().0) {
        *to = value(*from);
    }
}
