//! Reading: every flat file, scan lines or tiles, half, float or integer samples, many parts.

use std::collections::BTreeMap;
use std::path::Path;

use ::exr::meta::attribute::{AttributeValue, SampleType};
use ::exr::meta::header::Header;
use ::exr::meta::{BlockDescription, MetaData};
use ::exr::prelude::{Compression, Text, Vec2};

use super::blocks;
use crate::file::read_bytes;
use crate::limits::{check_bytes, check_size};
use crate::picture::full_name;
use crate::{Channel, ImageError, Layer, LayeredImage, Result};

/// Reads an EXR file.
pub fn read_exr(path: &Path) -> Result<LayeredImage> {
    decode_exr(&read_bytes(path)?, &path.display().to_string())
}

/// Decodes an EXR file in memory; `name` is what messages call it.
///
/// Data windows are placed into the first part's display window; what lies outside is cut off.
/// Parts with names become layers, names of channels with a dot too. Integers become floats,
/// exactly up to 2^24.
pub fn decode_exr(bytes: &[u8], name: &str) -> Result<LayeredImage> {
    let malformed = |e: ::exr::error::Error| match e {
        ::exr::error::Error::NotSupported(what) => {
            ImageError::unsupported(name, format!("{what}; save it as a flat file with ZIP"))
        }
        e => ImageError::malformed(name, "EXR", e),
    };
    let meta = MetaData::read_from_buffered(bytes, false).map_err(malformed)?;
    let window = check_headers(&meta.headers, bytes.len(), name)?;
    // The headers are known to be harmless: now read everything.
    let (meta, parts) = blocks::read(bytes).map_err(malformed)?;

    let mut layers: BTreeMap<String, Layer> = BTreeMap::new();
    let mut attributes = BTreeMap::new();
    for (header, planes) in meta.headers.iter().zip(parts) {
        let own = &header.own_attributes;
        collect_attributes(own, &mut attributes);
        let display = meta.headers[0].shared_attributes.display_window.position;
        let offset = |axis: fn(Vec2<i32>) -> i32| {
            i64::from(axis(own.layer_position)) - i64::from(axis(display))
        };
        let offset = Vec2(offset(Vec2::x), offset(Vec2::y));
        let part_name = own.layer_name.as_ref().map(text).unwrap_or_default();
        for plane in planes {
            let full = match text(&plane.name) {
                n if part_name.is_empty() || n.starts_with(&format!("{part_name}.")) => n,
                n => full_name(&part_name, &n),
            };
            let (layer, channel) = full.rsplit_once('.').unwrap_or(("", &full));
            layers
                .entry(layer.to_owned())
                .or_insert_with(|| Layer { name: layer.to_owned(), channels: Vec::new() })
                .channels
                .push(Channel {
                    name: channel.to_owned(),
                    values: place(plane.values, header.layer_size, offset, window),
                    precision: plane.precision,
                });
        }
    }
    let mut layers: Vec<Layer> = layers.into_values().collect();
    layers.iter_mut().for_each(|l| l.channels.sort_by_key(|c| colour_order(&c.name)));
    let image =
        LayeredImage { width: window.0 as u32, height: window.1 as u32, layers, attributes };
    image.validate(name)?;
    Ok(image)
}

/// Refuses what would not fit, before memory is taken for it; returns the display window's size.
fn check_headers(headers: &[Header], file_bytes: usize, name: &str) -> Result<Vec2<usize>> {
    let first = headers
        .first()
        .ok_or_else(|| ImageError::malformed(name, "EXR", "the file has no parts"))?;
    let display = first.shared_attributes.display_window.size;
    let pixels = check_size(name, display.0 as u64, display.1 as u64)?;
    let (mut samples, mut stored) = (0u128, 0u128);
    for header in headers {
        if header.deep {
            return Err(ImageError::unsupported(name, "deep EXR files are not read; flatten it"));
        }
        let size = header.layer_size;
        let part_pixels = check_size(name, size.0 as u64, size.1 as u64)?;
        if let BlockDescription::Tiles(tiles) = header.blocks {
            check_size(name, tiles.tile_size.0 as u64, tiles.tile_size.1 as u64)?;
        }
        if header.channels.list.iter().any(|c| c.sampling != Vec2(1, 1)) {
            let reason = "subsampled channels are not read; save it as RGB";
            return Err(ImageError::unsupported(name, reason));
        }
        if header.chunk_count > file_bytes / 8 {
            let reason = format!("{} blocks do not fit into the file", header.chunk_count);
            return Err(ImageError::malformed(name, "EXR", reason));
        }
        let channels = header.channels.list.len() as u128;
        samples += channels * (part_pixels + pixels) as u128;
        // These compressions cannot shrink further than this; the others reach any ratio.
        let ratio = match header.compression {
            Compression::Uncompressed => 1,
            Compression::RLE => 64,
            Compression::ZIP1 | Compression::ZIP16 | Compression::PXR24 => 1040,
            Compression::B44 | Compression::B44A => {
                let reason = "B44 compression is not read; save it with ZIP or PIZ";
                return Err(ImageError::unsupported(name, reason));
            }
            _ => 1 << 16,
        };
        let sample_bytes = |t| if t == SampleType::F16 { 2 } else { 4u128 };
        let bytes: u128 = header.channels.list.iter().map(|c| sample_bytes(c.sample_type)).sum();
        stored += part_pixels as u128 * bytes / ratio;
    }
    if stored > file_bytes as u128 + 4096 {
        let reason = format!(
            "the header promises more pixels than the {file_bytes} bytes of the file can hold"
        );
        return Err(ImageError::malformed(name, "EXR", reason));
    }
    check_bytes(name, samples, 4)?;
    Ok(display)
}

/// Copies a data window into the display window, zero where it has no data.
fn place(values: Vec<f32>, size: Vec2<usize>, offset: Vec2<i64>, window: Vec2<usize>) -> Vec<f32> {
    if size == window && offset == Vec2(0i64, 0) {
        return values;
    }
    let mut placed = vec![0.0; window.0 * window.1];
    for (y, row) in values.chunks_exact(size.0).enumerate() {
        let target_y = offset.1 + y as i64;
        if !(0..window.1 as i64).contains(&target_y) {
            continue;
        }
        let x0 = offset.0;
        let (begin, end) = (x0.max(0), (x0 + size.0 as i64).min(window.0 as i64));
        if begin < end {
            let target = target_y as usize * window.0;
            placed[target + begin as usize..target + end as usize]
                .copy_from_slice(&row[(begin - x0) as usize..(end - x0) as usize]);
        }
    }
    placed
}

fn collect_attributes(
    from: &::exr::meta::header::LayerAttributes,
    to: &mut BTreeMap<String, String>,
) {
    let standard = [&from.comments, &from.owner, &from.software_name, &from.capture_date];
    for (name, value) in super::STANDARD_TEXT.iter().zip(standard) {
        if let Some(value) = value {
            to.insert((*name).to_owned(), text(value));
        }
    }
    for (name, value) in &from.other {
        let value = match value {
            AttributeValue::Text(value) => text(value),
            AttributeValue::F32(value) => value.to_string(),
            AttributeValue::F64(value) => value.to_string(),
            AttributeValue::I32(value) => value.to_string(),
            _ => continue,
        };
        to.insert(text(name), value);
    }
}

fn text(text: &Text) -> String {
    String::from_utf8_lossy(text.as_slice()).into_owned()
}

/// Files hold channels by alphabet; people expect R G B A.
fn colour_order(name: &str) -> (usize, String) {
    let rank = ["R", "G", "B", "A"].iter().position(|c| *c == name).unwrap_or(4);
    (rank, name.to_owned())
}
