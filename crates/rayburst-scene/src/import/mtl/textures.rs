//! The textures of material libraries: found, decoded in parallel, each once.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use rayburst_image::{MipMap, TexelFormat, Texels, decode_texture};
use rayon::prelude::*;

use super::{MapRef, MtlMaterial};
use crate::{
    AlphaMode, Texture, TextureSlot, WrapMode,
    import::{ImportError, LoadOptions, Resolver, find::FileFinder},
};

/// What an image is read for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum MapUse {
    /// sRGB colour.
    Color,
    /// Numbers: normals, roughness.
    Data,
    /// Coverage, `map_d`: the alpha channel if it says anything, else the luminance.
    Alpha,
}

type ImageKey = (PathBuf, MapUse);

/// Images and textures of a scene while its materials are read.
#[derive(Debug)]
pub(crate) struct TextureStore<'a> {
    resolver: &'a Resolver,
    /// Where each path as written leads; `None` is missing.
    found: HashMap<String, Option<PathBuf>>,
    decoded: HashMap<ImageKey, Arc<MipMap>>,
    /// Indices of the images that are in use.
    used: HashMap<ImageKey, u32>,
    alpha_modes: HashMap<u32, AlphaMode>,
    pub(crate) images: Vec<Arc<MipMap>>,
    pub(crate) textures: Vec<Texture>,
    pub(crate) warnings: Vec<String>,
}

impl<'a> TextureStore<'a> {
    /// Finds and decodes all textures of `materials`, which come from a file in the folder `base`
    /// relative to that of `scene`.
    pub(crate) fn load(
        materials: &[(String, MtlMaterial)],
        resolver: &'a Resolver,
        finder: &mut FileFinder<'_>,
        scene: &Path,
        options: &LoadOptions,
    ) -> Result<Self, ImportError> {
        let mut store = Self {
            resolver,
            found: HashMap::new(),
            decoded: HashMap::new(),
            used: HashMap::new(),
            alpha_modes: HashMap::new(),
            images: Vec::new(),
            textures: Vec::new(),
            warnings: Vec::new(),
        };
        let mut wanted: Vec<ImageKey> = Vec::new();
        for (base, material) in materials {
            for (map, usage) in maps_of(material) {
                let Some(path) = store.locate(finder, base, map) else { continue };
                let key = (path, usage);
                if !wanted.contains(&key) {
                    wanted.push(key);
                }
            }
        }
        store.decode(wanted, scene, options)?;
        Ok(store)
    }

    fn locate(&mut self, finder: &mut FileFinder<'_>, base: &str, map: &MapRef) -> Option<PathBuf> {
        if let Some(known) = self.found.get(&map.file) {
            return known.clone();
        }
        let found = match finder.find(base, &map.file) {
            Ok(path) => Some(path),
            Err(error) => {
                self.warnings.push(format!("texture '{}' is left out: {error}", map.file));
                None
            }
        };
        self.found.insert(map.file.clone(), found.clone());
        found
    }

    fn decode(
        &mut self,
        wanted: Vec<ImageKey>,
        scene: &Path,
        options: &LoadOptions,
    ) -> Result<(), ImportError> {
        let read = |(path, usage): ImageKey| {
            let name = path.display().to_string();
            let image = self.resolver.read(&path).map_err(|e| e.to_string()).and_then(|bytes| {
                let texels = decode_texture(&bytes, &name).map_err(|e| e.to_string())?;
                Ok(Arc::new(match usage {
                    MapUse::Color => MipMap::new(texels, TexelFormat::Srgb),
                    MapUse::Data => MipMap::new(texels, TexelFormat::Linear),
                    MapUse::Alpha => MipMap::new(coverage(texels), TexelFormat::Linear),
                }))
            });
            ((path, usage), image)
        };
        let decoded: Vec<_> = wanted.into_par_iter().map(read).collect();
        let mut bytes = 0;
        for (key, image) in decoded {
            match image {
                Ok(image) => {
                    bytes += image.bytes() as u64;
                    self.decoded.insert(key, image);
                }
                Err(reason) => self.warnings.push(format!("a texture is left out: {reason}")),
            }
        }
        if bytes > options.max_image_bytes {
            return Err(ImportError::TooLarge {
                path: scene.to_path_buf(),
                location: "textures".to_owned(),
                what: format!("{bytes} bytes of images"),
                limit: format!("{} bytes", options.max_image_bytes),
            });
        }
        Ok(())
    }

    fn key(&self, map: &MapRef, usage: MapUse) -> Option<ImageKey> {
        let path = self.found.get(&map.file)?.clone()?;
        Some((path, usage))
    }

    /// A slot for a map; [`TextureSlot::NONE`] if its image could not be read.
    pub(crate) fn slot(&mut self, map: &MapRef, usage: MapUse) -> TextureSlot {
        let Some(key) = self.key(map, usage) else { return TextureSlot::NONE };
        let Some(image) = self.decoded.get(&key) else { return TextureSlot::NONE };
        let image = match self.used.get(&key) {
            Some(&used) => used,
            None => {
                self.images.push(image.clone());
                self.used.insert(key, self.images.len() as u32 - 1);
                self.images.len() as u32 - 1
            }
        };
        self.slot_of(image, map)
    }

    fn slot_of(&mut self, image: u32, map: &MapRef) -> TextureSlot {
        let wrap = if map.clamp { WrapMode::ClampToEdge } else { WrapMode::Repeat };
        let texture = Texture { wrap: [wrap; 2], ..Texture::new(image) };
        let known = self.textures.iter().position(|t| *t == texture);
        let index = known.unwrap_or_else(|| {
            self.textures.push(texture);
            self.textures.len() - 1
        });
        let (s, o) = (map.scale, map.offset);
        // The options scale and shift MTL's v, which points up; ours is 1 − v.
        let transform = [[s.x, 0.0, o.x], [0.0, s.y, 1.0 - s.y - o.y]];
        TextureSlot { transform, ..TextureSlot::new(index as u32) }
    }

    /// One texture, roughness in green and metalness in blue, from two grey ones; a missing one is
    /// white.
    pub(crate) fn metallic_roughness(
        &mut self,
        roughness: Option<&MapRef>,
        metalness: Option<&MapRef>,
    ) -> TextureSlot {
        let image =
            |map: Option<&MapRef>| self.decoded.get(&self.key(map?, MapUse::Data)?).cloned();
        let (rough, metal) = (image(roughness), image(metalness));
        let (Some(map), Some(size)) = (roughness.or(metalness), rough.as_ref().or(metal.as_ref()))
        else {
            return TextureSlot::NONE;
        };
        let (width, height) = (size.width(), size.height());
        // The nearest texel, should the sizes differ.
        let byte = |image: Option<&Arc<MipMap>>, x: u32, y: u32| {
            image.map_or(255, |image| {
                let at = |i: u32, from: u32, to: u32| {
                    (u64::from(i) * u64::from(to) / u64::from(from)) as u32
                };
                let texel =
                    image.texel(0, at(x, width, image.width()), at(y, height, image.height()));
                (texel[0] * 255.0).round() as u8
            })
        };
        let mut data = Vec::with_capacity(width as usize * height as usize * 3);
        for y in 0..height {
            for x in 0..width {
                data.extend([0, byte(rough.as_ref(), x, y), byte(metal.as_ref(), x, y)]);
            }
        }
        let texels = Texels { width, height, channels: 3, data };
        self.images.push(Arc::new(MipMap::new(texels, TexelFormat::Linear)));
        self.slot_of(self.images.len() as u32 - 1, map)
    }

    /// Whether a map looks like tangent-space normals: on the whole it points up.
    pub(crate) fn is_normal_map(&self, map: &MapRef) -> bool {
        let key = self.key(map, MapUse::Data);
        key.and_then(|key| self.decoded.get(&key)).is_some_and(|image| {
            let [r, g, b, _] = image.texel(image.levels().len() - 1, 0, 0);
            image.channels() >= 3 && b > 0.7 && b > r + 0.15 && b > g + 0.15
        })
    }

    /// How the alpha of a slot's image should be used: opaque where all of it is, cut out where
    /// nearly all transparent texels are fully so, else blended.
    pub(crate) fn alpha_mode(&mut self, slot: TextureSlot) -> AlphaMode {
        let Some(texture) = slot.index() else { return AlphaMode::Opaque };
        let index = self.textures[texture].image;
        let image = &self.images[index as usize];
        *self.alpha_modes.entry(index).or_insert_with(|| alpha_mode(image))
    }
}

fn alpha_mode(image: &MipMap) -> AlphaMode {
    let alpha: fn(&MipMap, u32, u32) -> f32 = match image.channels() {
        2 | 4 => |image, x, y| image.alpha(0, x, y),
        1 => |image, x, y| image.texel(0, x, y)[0],
        _ => return AlphaMode::Opaque,
    };
    let (mut partial, mut clear) = (0_u64, 0_u64);
    for y in 0..image.height() {
        for x in 0..image.width() {
            let alpha = alpha(image, x, y);
            partial += u64::from((0.1..0.98).contains(&alpha));
            clear += u64::from(alpha < 0.1);
        }
    }
    match (partial, clear) {
        (0, 0) => AlphaMode::Opaque,
        _ if partial > clear => AlphaMode::Blend,
        _ => AlphaMode::Mask,
    }
}

/// The one channel that a `map_d` means. Some writers fill an alpha channel with 255 and put
/// coverage into the colour.
fn coverage(texels: Texels) -> Texels {
    let channels = usize::from(texels.channels);
    let has_alpha = channels.is_multiple_of(2)
        && texels.data.iter().skip(channels - 1).step_by(channels).any(|&alpha| alpha != 255);
    let of_texel = |texel: &[u8]| match *texel {
        [.., alpha] if has_alpha => alpha,
        [r, g, b, ..] => ((2 * u32::from(r) + 5 * u32::from(g) + u32::from(b) + 4) / 8) as u8,
        [grey, ..] => grey,
        [] => 255,
    };
    Texels {
        data: texels.data.chunks_exact(channels).map(of_texel).collect(),
        channels: 1,
        ..texels
    }
}

/// The maps of a material that are used, with what their texels mean.
fn maps_of(material: &MtlMaterial) -> impl Iterator<Item = (&MapRef, MapUse)> {
    let has_diffuse = material.diffuse_map.is_some();
    let specular = material.specular_map.as_ref().filter(|_| !has_diffuse);
    let bump = material.bump_map.as_ref().filter(|_| material.normal_map.is_none());
    let color = [material.diffuse_map.as_ref(), material.emission_map.as_ref(), specular];
    let data = [
        material.normal_map.as_ref(),
        bump,
        material.roughness_map.as_ref(),
        material.metallic_map.as_ref(),
    ];
    let color = color.into_iter().flatten().map(|m| (m, MapUse::Color));
    let data = data.into_iter().flatten().map(|m| (m, MapUse::Data));
    color.chain(data).chain(material.alpha_map.iter().map(|m| (m, MapUse::Alpha)))
}
