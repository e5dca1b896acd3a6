//! The material record: one flat plain-data structure that every back end reads.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

/// How a surface scatters light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum ShadingModel {
    /// glTF's metallic-roughness: a diffuse base under a dielectric GGX coat, blended with a GGX
    /// metal by `metallic`.
    #[default]
    MetallicRoughness = 0,
    /// A smooth dielectric that reflects and refracts, `base_color` tints what passes through.
    Dielectric = 1,
    /// A perfect mirror of reflectance `base_color`.
    Mirror = 2,
    /// No shading: `base_color` is the radiance itself (`KHR_materials_unlit`).
    Unlit = 3,
}

/// What `base_color`'s alpha means (glTF 2.0, section 3.9.4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum AlphaMode {
    /// Ignored.
    #[default]
    Opaque = 0,
    /// Cut out below `alpha_cutoff`.
    Mask = 1,
    /// Coverage, resolved stochastically.
    Blend = 2,
}

/// Where a material takes a texture from.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TextureSlot {
    /// Index in the scene's textures, or [`TextureSlot::NONE`]'s `u32::MAX`.
    pub texture: u32,
    /// Which of the primitive's UV sets.
    pub uv_set: u32,
    /// Rows of the 2×3 matrix applied to UVs (`KHR_texture_transform`).
    pub transform: [[f32; 3]; 2],
}

impl TextureSlot {
    /// No texture.
    pub const NONE: Self =
        Self { texture: u32::MAX, uv_set: 0, transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };

    /// A texture looked up by UV set 0 without a transform.
    pub const fn new(texture: u32) -> Self {
        Self { texture, ..Self::NONE }
    }

    /// The texture's index, if there is one.
    #[inline]
    pub fn index(&self) -> Option<usize> {
        (self.texture != u32::MAX).then_some(self.texture as usize)
    }

    /// UVs after the slot's transform.
    #[inline]
    pub fn apply(&self, uv: Vec2) -> Vec2 {
        let [a, b] = self.transform;
        Vec2::new(a[0] * uv.x + a[1] * uv.y + a[2], b[0] * uv.x + b[1] * uv.y + b[2])
    }

    /// A step in UVs after the slot's transform.
    #[inline]
    pub fn apply_vector(&self, step: Vec2) -> Vec2 {
        let [a, b] = self.transform;
        Vec2::new(a[0] * step.x + a[1] * step.y, b[0] * step.x + b[1] * step.y)
    }

    /// Absolute determinant of the transform: how much it scales UV areas.
    #[inline]
    pub fn area_scale(&self) -> f32 {
        let [a, b] = self.transform;
        (a[0] * b[1] - a[1] * b[0]).abs()
    }
}

impl Default for TextureSlot {
    fn default() -> Self {
        Self::NONE
    }
}

/// A material: factors that multiply textures, as in glTF 2.0, section 3.9.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Material {
    /// Linear base colour and alpha, multiplied by `base_color_texture` and vertex colours.
    pub base_color: [f32; 4],
    /// Emitted radiance, cd/m² (nits) per channel, front side only unless double-sided; multiplied
    /// by `emissive_texture`. Strength extensions are folded in.
    pub emissive: [f32; 3],
    /// 0 dielectric … 1 metal; multiplied by the blue channel of `metallic_roughness_texture`.
    pub metallic: f32,
    /// Perceptual roughness in [0, 1], α = roughness²; multiplied by the green channel.
    pub roughness: f32,
    /// Index of refraction of the dielectric, ≥ 1.
    pub ior: f32,
    /// Scale of the tangent-space normal's x and y.
    pub normal_scale: f32,
    /// How much of `occlusion_texture` applies; used by real-time passes only, paths ignore it.
    pub occlusion_strength: f32,
    /// Threshold of [`AlphaMode::Mask`].
    pub alpha_cutoff: f32,
    /// An [`AlphaMode`], see [`Material::alpha_mode`].
    pub alpha_mode: u32,
    /// A [`ShadingModel`], see [`Material::model`].
    pub model: u32,
    /// Bits of [`Material::DOUBLE_SIDED`] and friends.
    pub flags: u32,
    /// sRGB colour, alpha in the fourth channel.
    pub base_color_texture: TextureSlot,
    /// Linear; roughness in green, metallic in blue.
    pub metallic_roughness_texture: TextureSlot,
    /// Linear tangent-space normal, OpenGL convention (+Y up).
    pub normal_texture: TextureSlot,
    /// Linear; occlusion in red.
    pub occlusion_texture: TextureSlot,
    /// sRGB colour.
    pub emissive_texture: TextureSlot,
    /// Separate alpha (OBJ's `map_d`): last channel if the image has alpha, else luminance.
    pub alpha_texture: TextureSlot,
}

impl Material {
    /// Both sides are shaded and emit.
    pub const DOUBLE_SIDED: u32 = 1;

    /// glTF's default material: white, metallic 1, roughness 1.
    pub const GLTF_DEFAULT: Self = Self {
        base_color: [1.0; 4],
        emissive: [0.0; 3],
        metallic: 1.0,
        roughness: 1.0,
        ior: 1.5,
        normal_scale: 1.0,
        occlusion_strength: 1.0,
        alpha_cutoff: 0.5,
        alpha_mode: AlphaMode::Opaque as u32,
        model: ShadingModel::MetallicRoughness as u32,
        flags: 0,
        base_color_texture: TextureSlot::NONE,
        metallic_roughness_texture: TextureSlot::NONE,
        normal_texture: TextureSlot::NONE,
        occlusion_texture: TextureSlot::NONE,
        emissive_texture: TextureSlot::NONE,
        alpha_texture: TextureSlot::NONE,
    };

    /// A rough, non-metallic surface of a linear colour without a specular coat (`ior` 1).
    pub fn diffuse(color: Vec3) -> Self {
        Self {
            base_color: color.extend(1.0).to_array(),
            metallic: 0.0,
            ior: 1.0,
            flags: Self::DOUBLE_SIDED,
            ..Self::GLTF_DEFAULT
        }
    }

    /// A black surface that emits `radiance` (cd/m²).
    pub fn emitter(radiance: Vec3) -> Self {
        Self { emissive: radiance.to_array(), ..Self::diffuse(Vec3::ZERO) }
    }

    /// A metal of normal-incidence reflectance `color`.
    pub fn metal(color: Vec3, roughness: f32) -> Self {
        Self { metallic: 1.0, roughness, ..Self::diffuse(color) }
    }

    /// A coated plastic: diffuse base under a dielectric GGX coat of `ior` 1.5.
    pub fn plastic(color: Vec3, roughness: f32) -> Self {
        Self { ior: 1.5, roughness, ..Self::diffuse(color) }
    }

    /// A perfect mirror.
    pub fn mirror(color: Vec3) -> Self {
        Self { model: ShadingModel::Mirror as u32, ..Self::diffuse(color) }
    }

    /// Smooth glass.
    pub fn glass(ior: f32) -> Self {
        Self { model: ShadingModel::Dielectric as u32, ior, ..Self::diffuse(Vec3::ONE) }
    }

    /// The alpha mode; unknown numbers read as opaque.
    #[inline]
    pub fn alpha_mode(&self) -> AlphaMode {
        match self.alpha_mode {
            1 => AlphaMode::Mask,
            2 => AlphaMode::Blend,
            _ => AlphaMode::Opaque,
        }
    }

    /// The shading model; unknown numbers read as metallic-roughness.
    #[inline]
    pub fn model(&self) -> ShadingModel {
        match self.model {
            1 => ShadingModel::Dielectric,
            2 => ShadingModel::Mirror,
            3 => ShadingModel::Unlit,
            _ => ShadingModel::MetallicRoughness,
        }
    }

    /// Whether both sides are shaded and emit.
    #[inline]
    pub fn is_double_sided(&self) -> bool {
        self.flags & Self::DOUBLE_SIDED != 0
    }

    /// Whether the surface can emit light.
    #[inline]
    pub fn is_emissive(&self) -> bool {
        self.emissive.iter().any(|&e| e > 0.0)
    }

    /// All texture slots.
    pub fn slots(&self) -> [&TextureSlot; 6] {
        [
            &self.base_color_texture,
            &self.metallic_roughness_texture,
            &self.normal_texture,
            &self.occlusion_texture,
            &self.emissive_texture,
            &self.alpha_texture,
        ]
    }

    /// All texture slots, to be changed.
    pub fn slots_mut(&mut self) -> [&mut TextureSlot; 6] {
        [
            &mut self.base_color_texture,
            &mut self.metallic_roughness_texture,
            &mut self.normal_texture,
            &mut self.occlusion_texture,
            &mut self.emissive_texture,
            &mut self.alpha_texture,
        ]
    }
}

impl Default for Material {
    fn default() -> Self {
        Self::GLTF_DEFAULT
    }
}
