//! Writing: one part, increasing lines, ZIP; the same picture always gives the same bytes.

use std::io::{Cursor, Write};
use std::path::Path;

use ::exr::image::FlatSamples;
use ::exr::meta::attribute::{AttributeValue, LineOrder};
use ::exr::meta::header::{LayerAttributes, standard_names};
use ::exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, Image, Layer, Text, WritableImage, f16,
};

use crate::file::atomic_write;
use crate::limits::check_bytes;
use crate::picture::full_name;
use crate::{ImageError, LayeredImage, Precision, Result};

/// Writes an EXR file, whole or not at all.
pub fn write_exr(path: &Path, image: &LayeredImage) -> Result<()> {
    let bytes = encode_exr(image, &path.display().to_string())?;
    atomic_write(path, |w| w.write_all(&bytes))
}

/// Encodes an EXR file in memory; `name` is what messages call it.
pub fn encode_exr(image: &LayeredImage, name: &str) -> Result<Vec<u8>> {
    image.validate(name)?;
    let pixels = u128::from(image.width) * u128::from(image.height);
    let channels: usize = image.layers.iter().map(|l| l.channels.len()).sum();
    check_bytes(name, pixels * channels as u128, 4)?;

    let list = image.layers.iter().flat_map(|layer| {
        layer.channels.iter().map(|channel| {
            let samples = match channel.precision {
                Precision::Float => FlatSamples::F32(channel.values.clone()),
                Precision::Half => {
                    FlatSamples::F16(channel.values.iter().map(|v| to_half(*v)).collect())
                }
            };
            AnyChannel::new(to_text(&full_name(&layer.name, &channel.name)), samples)
        })
    });
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let size = (image.width as usize, image.height as usize);
    let attributes = attributes(image, name)?;
    let layer = Layer::new(size, attributes, encoding, AnyChannels::sort(list.collect()));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .to_buffered(&mut bytes)
        .map_err(|e| ImageError::unsupported(name, format!("cannot be an EXR file: {e}")))?;
    let mut bytes = bytes.into_inner();
    sort_attributes(&mut bytes);
    Ok(bytes)
}

fn attributes(image: &LayeredImage, name: &str) -> Result<LayerAttributes> {
    let mut attributes = LayerAttributes::default();
    for (key, value) in &image.attributes {
        let value = to_text(value);
        match key.as_str() {
            "comments" => attributes.comments = Some(value),
            "owner" => attributes.owner = Some(value),
            "software" => attributes.software_name = Some(value),
            "capDate" => attributes.capture_date = Some(value),
            _ => {
                if !(1..256).contains(&key.len()) || key.contains('\0') {
                    let reason = format!("attribute '{key}': a name has 1 to 255 bytes, none zero");
                    return Err(ImageError::unsupported(name, reason));
                }
                if standard_names::ALL.contains(&key.as_bytes()) {
                    let reason = format!("the attribute name '{key}' belongs to the EXR format");
                    return Err(ImageError::unsupported(name, reason));
                }
                attributes.other.insert(to_text(key), AttributeValue::Text(value));
            }
        }
    }
    Ok(attributes)
}

/// A bright but finite value must not become infinite.
fn to_half(value: f32) -> f16 {
    let limit = f16::MAX.to_f32();
    f16::from_f32(if value.is_finite() { value.clamp(-limit, limit) } else { value })
}

/// UTF-8, as the format's newer versions have it.
fn to_text(text: &str) -> Text {
    Text::from_slice_unchecked(text.as_bytes())
}

/// Sorts the header's attributes by name. The library keeps them in a hash map of random order;
/// sorting changes no length, so that every offset in the file stays right.
fn sort_attributes(file: &mut [u8]) {
    const HEADER: usize = 8;
    let mut entries: Vec<&[u8]> = Vec::new();
    let mut rest = &file[HEADER..];
    while rest.first().is_some_and(|&b| b != 0) {
        let Some(length) = entry_length(rest) else { return };
        let (entry, tail) = rest.split_at(length);
        entries.push(entry);
        rest = tail;
    }
    entries.sort_unstable();
    let sorted = entries.concat();
    file[HEADER..HEADER + sorted.len()].copy_from_slice(&sorted);
}

/// The bytes of `name\0 type\0 size value`.
fn entry_length(bytes: &[u8]) -> Option<usize> {
    let name = bytes.iter().position(|&b| b == 0)? + 1;
    let kind = bytes[name..].iter().position(|&b| b == 0)? + 1;
    let size = bytes.get(name + kind..name + kind + 4)?;
    let size = u32::from_le_bytes([size[0], size[1], size[2], size[3]]) as usize;
    let length = name + kind + 4 + size;
    (length <= bytes.len()).then_some(length)
}
