//! Textures, samplers and images (glTF 2.0, section 3.8) with `KHR_texture_transform`.

use std::{
    collections::BTreeMap,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

use rayburst_image::{MipMap, TexelFormat, decode_texture};
use rayon::prelude::*;

use super::{json, source::Source, warnings::Warnings};
use crate::{
    FilterMode, Material, Texture, TextureSlot, WrapMode,
    import::{ImportError, LoadOptions, ResolveError},
};

/// The textures that materials ask for. An image used as colour and as data counts twice.
pub(super) struct TextureTable<'s> {
    source: &'s Source<'s>,
    /// `image` is an index in `images`.
    textures: Vec<Texture>,
    by_texture: BTreeMap<(usize, bool), u32>,
    images: Vec<(usize, TexelFormat)>,
    by_image: BTreeMap<(usize, bool), u32>,
    without_image: Vec<(usize, String)>,
}

/// Images that are ready, and textures that refer to them.
#[derive(Default)]
pub(super) struct Decoded {
    pub(super) textures: Vec<Texture>,
    pub(super) images: Vec<Arc<MipMap>>,
}

impl<'s> TextureTable<'s> {
    pub(super) fn new(source: &'s Source<'s>) -> Self {
        Self {
            source,
            textures: Vec::new(),
            by_texture: BTreeMap::new(),
            images: Vec::new(),
            by_image: BTreeMap::new(),
            without_image: Vec::new(),
        }
    }

    /// The slot of a material's texture.
    pub(super) fn slot(
        &mut self,
        info: &json::TextureInfo,
        format: TexelFormat,
        location: &str,
    ) -> Result<TextureSlot, ImportError> {
        let Some(texture) = self.texture(info.index, format, location)? else {
            return Ok(TextureSlot::NONE);
        };
        let mut slot = TextureSlot { uv_set: info.tex_coord, ..TextureSlot::new(texture) };
        if let Some(transform) = &info.extensions.transform {
            slot.uv_set = transform.tex_coord.unwrap_or(slot.uv_set);
            let [x, y] = transform.offset.unwrap_or([0.0; 2]);
            let [sx, sy] = transform.scale.unwrap_or([1.0; 2]);
            let (sin, cos) = transform.rotation.unwrap_or(0.0).sin_cos();
            let matrix = [[cos * sx, sin * sy, x], [-sin * sx, cos * sy, y]];
            if matrix.iter().flatten().all(|e| e.is_finite()) {
                slot.transform = matrix;
            }
        }
        Ok(slot)
    }

    fn texture(
        &mut self,
        index: usize,
        format: TexelFormat,
        location: &str,
    ) -> Result<Option<u32>, ImportError> {
        let root = self.source.root;
        let srgb = format == TexelFormat::Srgb;
        if let Some(&texture) = self.by_texture.get(&(index, srgb)) {
            return Ok(Some(texture));
        }
        let Some(json) = root.textures.get(index) else {
            let reason = format!("there is no texture {index}");
            return Err(self.source.malformed(location, reason));
        };
        let Some(image) = json.source else {
            let extensions: Vec<&str> = json.extensions.keys().map(String::as_str).collect();
            let reason = match extensions[..] {
                [] => "the texture has no image".to_owned(),
                _ => format!("the texture has an image only by {}", extensions.join(", ")),
            };
            self.without_image.push((index, reason));
            return Ok(None);
        };
        if image >= root.images.len() {
            let reason = format!("there is no image {image}");
            return Err(self.source.malformed(format!("/textures/{index}"), reason));
        }
        let default = json::Sampler::default();
        let sampler = match json.sampler {
            None => &default,
            Some(sampler) => root.samplers.get(sampler).ok_or_else(|| {
                let reason = format!("there is no sampler {sampler}");
                self.source.malformed(format!("/textures/{index}"), reason)
            })?,
        };
        let images = &mut self.images;
        let image = *self.by_image.entry((image, srgb)).or_insert_with(|| {
            images.push((image, format));
            images.len() as u32 - 1
        });
        let texture = self.textures.len() as u32;
        self.textures.push(convert_sampler(sampler, image));
        self.by_texture.insert((index, srgb), texture);
        Ok(Some(texture))
    }

    /// Reads and decodes, in parallel, the images of the materials that are used, and renumbers
    /// the slots of all materials. A texture without an image that can be read is left out.
    pub(super) fn decode(
        self,
        materials: &mut [Material],
        used: &[bool],
        options: &LoadOptions,
        warnings: &mut Warnings,
    ) -> Result<Decoded, ImportError> {
        let source = self.source;
        for (index, reason) in self.without_image {
            warnings.add(reason, format!("/textures/{index}"), 1);
        }
        let mut wanted = vec![false; self.images.len()];
        for (material, _) in materials.iter().zip(used).filter(|(_, used)| **used) {
            for texture in material.slots().into_iter().filter_map(TextureSlot::index) {
                wanted[self.textures[texture].image as usize] = true;
            }
        }
        let mut jobs = Vec::new();
        for (slot, &(image, format)) in self.images.iter().enumerate() {
            if wanted[slot] {
                jobs.push((slot, format, Encoded::of(source, image)?));
            }
        }
        let total = AtomicU64::new(0);
        let resolver = source.resolver;
        let results: Vec<Result<MipMap, String>> = jobs
            .par_iter()
            .map(|(_, format, encoded)| {
                let texels = match &encoded.bytes {
                    Bytes::View(bytes) => decode_texture(bytes, &encoded.name),
                    Bytes::Uri(uri) => {
                        let bytes =
                            resolver.read_uri(uri).map_err(|e: ResolveError| e.to_string())?;
                        decode_texture(&bytes, &encoded.name)
                    }
                };
                let texels = texels.map_err(|e| e.to_string())?;
                let bytes = texels.data.len() as u64;
                if total.fetch_add(bytes, Ordering::Relaxed) + bytes > options.max_image_bytes {
                    return Err("too many bytes of images".to_owned());
                }
                Ok(MipMap::new(texels, *format))
            })
            .collect();
        if total.into_inner() > options.max_image_bytes {
            return Err(ImportError::TooLarge {
                path: source.path.to_path_buf(),
                location: "/images".to_owned(),
                what: "their decoded size".to_owned(),
                limit: format!("{} bytes", options.max_image_bytes),
            });
        }
        let mut decoded = Decoded::default();
        let mut image_at = vec![None; self.images.len()];
        for ((slot, ..), result) in jobs.iter().zip(results) {
            match result {
                Ok(image) => {
                    image_at[*slot] = Some(decoded.images.len() as u32);
                    decoded.images.push(Arc::new(image));
                }
                Err(reason) => {
                    let location = format!("/images/{}", self.images[*slot].0);
                    warnings.add(format!("texture left out: {reason}"), location, 1);
                }
            }
        }
        let mut texture_at = vec![None; self.textures.len()];
        for (at, texture) in texture_at.iter_mut().zip(&self.textures) {
            if let Some(image) = image_at[texture.image as usize] {
                *at = Some(decoded.textures.len() as u32);
                decoded.textures.push(Texture { image, ..*texture });
            }
        }
        for material in materials {
            let glows_by_texture = material.emissive_texture.index().is_some();
            for slot in material.slots_mut() {
                if let Some(texture) = slot.index() {
                    match texture_at[texture] {
                        Some(at) => slot.texture = at,
                        None => *slot = TextureSlot::NONE,
                    }
                }
            }
            if glows_by_texture && material.emissive_texture.index().is_none() {
                // Without its picture all of the surface would glow.
                material.emissive = [0.0; 3];
            }
        }
        Ok(decoded)
    }
}

/// An image as the file has it.
struct Encoded<'s> {
    name: String,
    bytes: Bytes<'s>,
}

enum Bytes<'s> {
    View(&'s [u8]),
    Uri(&'s str),
}

impl<'s> Encoded<'s> {
    fn of(source: &'s Source<'_>, index: usize) -> Result<Self, ImportError> {
        let json: &json::Image = &source.root.images[index];
        let mut name = format!("image {index}");
        let short = |text: &str| text.chars().take(80).collect::<String>();
        let bytes = match (&json.uri, json.buffer_view) {
            (_, Some(view)) => {
                if !json.name.is_empty() {
                    name = format!("{name} '{}'", short(&json.name));
                }
                Bytes::View(source.view(view)?)
            }
            (Some(uri), None) => {
                if !uri.starts_with("data:") {
                    name = format!("{name} '{}'", short(uri));
                }
                Bytes::Uri(uri)
            }
            (None, None) => {
                let reason = "the image has neither a URI nor a buffer view";
                return Err(source.malformed(format!("/images/{index}"), reason));
            }
        };
        Ok(Self { name, bytes })
    }
}

fn convert_sampler(sampler: &json::Sampler, image: u32) -> Texture {
    let wrap = |code: Option<u32>| match code {
        Some(33_071) => WrapMode::ClampToEdge,
        Some(33_648) => WrapMode::MirroredRepeat,
        _ => WrapMode::Repeat,
    };
    let (nearest, linear) = (FilterMode::Nearest, FilterMode::Linear);
    let (minify, mip) = match sampler.min_filter {
        Some(9728) => (nearest, None),
        Some(9729) => (linear, None),
        Some(9984) => (nearest, Some(nearest)),
        Some(9985) => (linear, Some(nearest)),
        Some(9986) => (nearest, Some(linear)),
        _ => (linear, Some(linear)),
    };
    Texture {
        wrap: [wrap(sampler.wrap_s), wrap(sampler.wrap_t)],
        magnify: if sampler.mag_filter == Some(9728) { nearest } else { linear },
        minify,
        mip,
        ..Texture::new(image)
    }
}
