//! Textures of cut-out materials, with mip levels that cover as much as the finest one.

use std::{collections::HashMap, sync::Arc};

use rayburst_image::MipMap;

use crate::{AlphaMode, Material, Texture, TextureSlot};

/// What materials look up, to be changed.
pub(crate) struct Shading {
    pub(crate) materials: Vec<Material>,
    pub(crate) textures: Vec<Texture>,
    pub(crate) images: Vec<Arc<MipMap>>,
}

/// Gives each cut-out material textures whose coarser levels cover, at its own cutoff, as much as the
/// finest. They are added behind the scene's textures and images, whose numbers stay.
pub(crate) fn keep_coverage(shading: &mut Shading) {
    let mut made = HashMap::new();
    for material in 0..shading.materials.len() {
        let source = shading.materials[material];
        if source.alpha_mode() != AlphaMode::Mask {
            continue;
        }
        // Where the texture itself is cut: the factor multiplies it.
        let cutoff = source.alpha_cutoff / source.base_color[3];
        let base = covering(shading, &source.base_color_texture, true, cutoff, &mut made);
        let alpha = covering(shading, &source.alpha_texture, false, cutoff, &mut made);
        let target = &mut shading.materials[material];
        target.base_color_texture.texture = base;
        target.alpha_texture.texture = alpha;
    }
}

/// The texture for a slot, made if need be. Base colours count only with an alpha channel.
fn covering(
    shading: &mut Shading,
    slot: &TextureSlot,
    needs_alpha: bool,
    cutoff: f32,
    made: &mut HashMap<(u32, u32), u32>,
) -> u32 {
    let texture = slot.index().and_then(|index| shading.textures.get(index).copied());
    let Some(texture) = texture.filter(|t| t.mip.is_some()) else { return slot.texture };
    let Some(image) = shading.images.get(texture.image as usize).cloned() else {
        return slot.texture;
    };
    let share = image.coverage(0, cutoff);
    if (needs_alpha && image.channels() % 2 == 1) || share == 0.0 || share == 1.0 {
        return slot.texture;
    }
    *made.entry((slot.texture, cutoff.to_bits())).or_insert_with(|| {
        shading.images.push(Arc::new(image.with_coverage(cutoff)));
        let image = shading.images.len() as u32 - 1;
        shading.textures.push(Texture { image, ..texture });
        shading.textures.len() as u32 - 1
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use rayburst_image::{TexelFormat, Texels};

    use super::*;

    #[test]
    fn only_cut_outs_get_textures_of_their_own() {
        // Every third texel is there.
        let data = (0..32 * 32).flat_map(|i| [9, 99, 9, if i % 3 == 0 { 255 } else { 0 }]);
        let texels = Texels { width: 32, height: 32, channels: 4, data: data.collect() };
        let image = Arc::new(MipMap::new(texels, TexelFormat::Srgb));
        let textured =
            Material { base_color_texture: TextureSlot::new(0), ..Material::diffuse(Vec3::ONE) };
        let mask = Material { alpha_mode: AlphaMode::Mask as u32, ..textured };
        let mut thin = mask;
        thin.base_color[3] = 0.6;
        let mut shading = Shading {
            materials: vec![textured, mask, mask, thin],
            textures: vec![Texture::new(0)],
            images: vec![image.clone()],
        };
        keep_coverage(&mut shading);
        let used: Vec<u32> =
            shading.materials.iter().map(|m| m.base_color_texture.texture).collect();
        assert_eq!(used, [0, 1, 1, 2]);
        assert_eq!((shading.textures[0].image, shading.images.len()), (0, 3));
        let share = image.coverage(0, 0.5);
        for (image, cutoff) in [(1, 0.5), (2, 0.5 / 0.6)] {
            let levels = shading.images[image].levels();
            for (i, level) in levels.iter().enumerate() {
                let texel = 1.0 / f64::from(level.width * level.height);
                let error = (shading.images[image].coverage(i, cutoff) - share).abs();
                assert!(error <= 0.5 * texel + 1e-9, "level {i}");
            }
        }
        // An average would have let everything through.
        assert_eq!(image.coverage(4, 0.5), 0.0);
    }
}
