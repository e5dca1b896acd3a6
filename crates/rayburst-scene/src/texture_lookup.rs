//! Texture lookups through a footprint: wrapping, filtering, the mip level.
//!
//! The level follows from the width of the footprint in texels, log₂(width · √(w·h)) for a texture of
//! w×h (Akenine-Möller, Nilsson, Andersson, Barré-Brisebois, Toth, Karras: "Texture Level of Detail
//! Strategies for Real-Time Ray Tracing", Ray Tracing Gems 2019, chapter 20). Wrapping and filters are
//! those of glTF 2.0, section 5.26. (0, 0) is the upper left corner of the image.

use glam::{Vec2, Vec4};
use rayburst_image::MipMap;

use crate::{
    FilterMode, FlatScene, Texture, TextureSlot, WrapMode, texture_ellipse::lookup_ellipse,
};

/// How the mip level of texture lookups is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum TextureLod {
    /// Always the finest level; many samples a pixel are the only filter.
    Mip0,
    /// From the ellipse in which the ray's cone cuts the surface.
    #[default]
    Cones,
    /// From the parallelogram on the surface that the ray's differential spans.
    Differentials,
}

impl TextureLod {
    /// All modes with the names users type.
    pub const ALL: [(&'static str, Self); 3] =
        [("mip0", Self::Mip0), ("cones", Self::Cones), ("differentials", Self::Differentials)];

    /// The name that users type.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, lod)| *lod == self).map_or("", |(name, _)| name)
    }
}

impl FlatScene {
    /// A texture's linear colour and alpha at `uv` (of the slot's set, before its transform) averaged
    /// over about `footprint`, the width of a square in units of `uv`; 0 takes the finest level. White
    /// when the slot has no texture.
    #[inline]
    pub fn texture(&self, slot: &TextureSlot, uv: Vec2, footprint: f32) -> Vec4 {
        let Some((texture, image)) = self.texture_image(slot) else { return Vec4::ONE };
        let width = footprint * slot.area_scale().sqrt();
        let texels = width * (image.width() as f32 * image.height() as f32).sqrt();
        trilinear(texture, image, slot.apply(uv), texels)
    }

    /// The same averaged over the parallelogram of two vectors around `uv`, in units of `uv`, by
    /// several taps if it is long, but no more than `most_taps` (1 to [`crate::texture_ellipse::MAX_TAPS`]).
    #[inline]
    pub fn texture_within(
        &self,
        slot: &TextureSlot,
        uv: Vec2,
        axes: [Vec2; 2],
        most_taps: u32,
    ) -> Vec4 {
        let Some((texture, image)) = self.texture_image(slot) else { return Vec4::ONE };
        let axes = axes.map(|axis| slot.apply_vector(axis));
        lookup_ellipse(texture, image, slot.apply(uv), axes, most_taps)
    }

    /// The mean of a slot's texture; white when it has none.
    pub fn texture_mean(&self, slot: &TextureSlot) -> Vec4 {
        self.texture_image(slot).map_or(Vec4::ONE, |(_, image)| {
            Vec4::from_array(image.texel(image.levels().len() - 1, 0, 0))
        })
    }

    #[inline]
    pub(crate) fn texture_image(&self, slot: &TextureSlot) -> Option<(&Texture, &MipMap)> {
        let texture = self.textures.get(slot.index()?)?;
        Some((texture, self.images.get(texture.image as usize)?))
    }
}

/// A texture at `uv`, after any transform, for a square footprint that is `texels` of the finest level
/// wide.
pub(crate) fn trilinear(texture: &Texture, image: &MipMap, uv: Vec2, texels: f32) -> Vec4 {
    if texels <= 1.0 || texels.is_nan() {
        return filtered(texture, image, 0, uv, texture.magnify);
    }
    minified(texture, image, uv, texels.log2())
}

/// A texture at `uv` on the mip level `lod`, which is at least 0, between levels as the texture says.
#[inline]
pub(crate) fn minified(texture: &Texture, image: &MipMap, uv: Vec2, lod: f32) -> Vec4 {
    let last = image.levels().len() - 1;
    let lod = lod.min(last as f32);
    match texture.mip {
        None => filtered(texture, image, 0, uv, texture.minify),
        Some(FilterMode::Nearest) => {
            filtered(texture, image, (lod + 0.5) as usize, uv, texture.minify)
        }
        Some(FilterMode::Linear) => {
            let level = lod as usize;
            let fine = filtered(texture, image, level, uv, texture.minify);
            let t = lod - level as f32;
            if t <= 0.0 || level >= last {
                return fine;
            }
            fine.lerp(filtered(texture, image, level + 1, uv, texture.minify), t)
        }
    }
}

/// One level, at most of the last one's index.
#[inline]
fn filtered(texture: &Texture, image: &MipMap, level: usize, uv: Vec2, filter: FilterMode) -> Vec4 {
    let level = level.min(image.levels().len() - 1);
    let (width, height) = (image.levels()[level].width, image.levels()[level].height);
    match filter {
        FilterMode::Nearest => Vec4::from_array(image.texel(
            level,
            nearest(uv.x, width, texture.wrap[0]),
            nearest(uv.y, height, texture.wrap[1]),
        )),
        FilterMode::Linear => {
            let (x0, x1, fx) = neighbours(uv.x, width, texture.wrap[0]);
            let (y0, y1, fy) = neighbours(uv.y, height, texture.wrap[1]);
            let (gx, gy) = (1.0 - fx, 1.0 - fy);
            image.blend(level, [x0, x1], [y0, y1], [gx * gy, fx * gy, gx * fy, fx * fy])
        }
    }
}

/// The largest whole number that is not above `t`; by way of integers, which without SSE 4.1 is much
/// faster than the library's.
#[inline]
fn floor(t: f32) -> f32 {
    /// From here on all numbers are whole.
    const WHOLE: f32 = 8_388_608.0;
    if t.abs() < WHOLE {
        let truncated = (t as i32) as f32;
        if truncated > t { truncated - 1.0 } else { truncated }
    } else {
        t
    }
}

/// A coordinate folded into [0, 1].
#[inline]
fn fold(t: f32, wrap: WrapMode) -> f32 {
    match wrap {
        WrapMode::Repeat => t - floor(t),
        WrapMode::MirroredRepeat => {
            let period = t - 2.0 * floor(0.5 * t);
            if period > 1.0 { 2.0 - period } else { period }
        }
        WrapMode::ClampToEdge => t.clamp(0.0, 1.0),
    }
}

/// The texel that a coordinate falls into. Not-a-numbers and infinities fall into the first.
#[inline]
fn nearest(t: f32, size: u32, wrap: WrapMode) -> u32 {
    ((fold(t, wrap) * size as f32) as u32).min(size - 1)
}

/// The two texels around a coordinate and how far it is from the first to the second.
#[inline]
fn neighbours(t: f32, size: u32, wrap: WrapMode) -> (u32, u32, f32) {
    let x = fold(t, wrap) * size as f32 - 0.5;
    if !x.is_finite() {
        return (0, 0, 0.0);
    }
    let floor = floor(x);
    let low = floor as i32;
    let last = size as i32 - 1;
    let (first, second) = if wrap == WrapMode::Repeat {
        // x lies in [−0.5, size − 0.5].
        (if low < 0 { last } else { low.min(last) }, if low >= last { 0 } else { low + 1 })
    } else {
        (low.clamp(0, last), (low + 1).clamp(0, last))
    };
    (first as u32, second as u32, x - floor)
}

#[cfg(test)]
mod tests {
    use rayburst_image::{TexelFormat, Texels};

    use super::*;

    fn lookup(texture: &Texture, image: &MipMap, uv: Vec2, footprint: f32) -> Vec4 {
        let texels = footprint * (image.width() as f32 * image.height() as f32).sqrt();
        trilinear(texture, image, uv, texels)
    }

    fn image(width: u32, height: u32, channels: u8, data: Vec<u8>) -> MipMap {
        MipMap::new(Texels { width, height, channels, data }, TexelFormat::Linear)
    }

    fn texture(wrap: WrapMode, filter: FilterMode) -> Texture {
        Texture { wrap: [wrap; 2], magnify: filter, minify: filter, ..Texture::new(0) }
    }

    #[test]
    fn wrap_modes_repeat_mirror_and_clamp() {
        let image = image(4, 1, 1, vec![0, 51, 102, 255]);
        let at = |wrap, u: f32| {
            (lookup(&texture(wrap, FilterMode::Nearest), &image, Vec2::new(u, 0.5), 0.0).x * 255.0)
                .round() as u32
        };
        for (u, repeat, mirror, clamp) in [
            (0.1, 0, 0, 0),
            (0.9, 255, 255, 255),
            (1.1, 0, 255, 255),
            (-0.1, 255, 0, 0),
            (-1.1, 255, 255, 0),
            (2.3, 51, 51, 255),
            (1.0, 0, 255, 255),
        ] {
            assert_eq!(at(WrapMode::Repeat, u), repeat, "{u}");
            assert_eq!(at(WrapMode::MirroredRepeat, u), mirror, "{u}");
            assert_eq!(at(WrapMode::ClampToEdge, u), clamp, "{u}");
        }
    }

    #[test]
    fn linear_filtering_blends_over_the_wrapped_edge() {
        let image = image(2, 1, 1, vec![0, 255]);
        let at = |wrap, u: f32| {
            lookup(&texture(wrap, FilterMode::Linear), &image, Vec2::new(u, 0.5), 0.0).x
        };
        assert!((at(WrapMode::Repeat, 0.25)).abs() < 1e-6);
        assert!((at(WrapMode::Repeat, 0.5) - 0.5).abs() < 1e-6);
        assert!((at(WrapMode::Repeat, 0.0) - 0.5).abs() < 1e-6);
        assert!((at(WrapMode::Repeat, 0.9375) - 0.625).abs() < 1e-6);
        assert_eq!(at(WrapMode::ClampToEdge, 0.0), 0.0);
        assert_eq!(at(WrapMode::ClampToEdge, 1.0), 1.0);
        assert_eq!(at(WrapMode::MirroredRepeat, 1.0), 1.0);
    }

    #[test]
    fn footprints_choose_levels() {
        // A board of black and white: every coarser level is grey.
        let board = (0..64).map(|i| if (i % 8 + i / 8) % 2 == 0 { 255 } else { 0 }).collect();
        let image = image(8, 8, 1, board);
        let trilinear = texture(WrapMode::Repeat, FilterMode::Linear);
        let uv = Vec2::splat(1.5 / 8.0);
        let at = |t: &Texture, footprint: f32| lookup(t, &image, uv, footprint).x;
        assert_eq!(at(&trilinear, 0.0), 1.0);
        assert_eq!(at(&trilinear, 1.0 / 8.0), 1.0);
        assert!((at(&trilinear, 0.25) - 0.5).abs() < 0.01);
        // Half way between the levels, in the logarithm.
        let between = at(&trilinear, 0.125 * 2.0f32.sqrt());
        assert!((between - 0.75).abs() < 0.01, "{between}");
        assert!((at(&trilinear, 1e9) - 0.5).abs() < 0.01);
        assert_eq!(at(&Texture { mip: None, ..trilinear }, 1e9), 1.0);
        let stepped = Texture { mip: Some(FilterMode::Nearest), ..trilinear };
        assert_eq!(at(&stepped, 0.125 * 1.3), 1.0);
        assert!((at(&stepped, 0.125 * 1.6) - 0.5).abs() < 0.01);
    }

    #[test]
    fn broken_coordinates_find_a_texel() {
        let image = image(3, 5, 4, vec![7; 60]);
        for wrap in [WrapMode::Repeat, WrapMode::MirroredRepeat, WrapMode::ClampToEdge] {
            for filter in [FilterMode::Nearest, FilterMode::Linear] {
                for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, -1e-30] {
                    for footprint in [0.0, 0.3, f32::NAN, f32::INFINITY] {
                        let c = lookup(&texture(wrap, filter), &image, Vec2::splat(bad), footprint);
                        assert!((c.x - 7.0 / 255.0).abs() < 1e-3, "{wrap:?} {bad} {footprint}");
                    }
                }
            }
        }
    }
}
