//! Phong materials as metallic-roughness ones.
//!
//! MTL describes a look, not a surface, and exporters fill it carelessly. The rules:
//! - `Ns` is a Blinn-Phong exponent: α² = 2 / (Ns + 2) (Walter et al., "Microfacet Models for
//!   Refraction through Rough Surfaces", 2007, eq. after 30), roughness = √α. `Pr` wins over it.
//! - Without `Ks` there is no coat: `ior` 1. With it, F₀ = 0.08 · Ks, so that the usual Ks = 0.5 is
//!   glass-like plastic (Blender's convention). Taking Ks itself for F₀ would make mirrors of the
//!   walls of most files: Phong highlights are not normalised, their energy is about 2 / (Ns + 2).
//! - A metal, of colour Ks, is what has `Pm`, or a Ks that outshines a dark Kd, or a saturated Ks
//!   brighter than Kd.
//! - `illum` 3 or 5 with a sharp, dominant Ks is a perfect mirror.
//! - `illum` 4, 6, 7 or 9 with `Ni` above 1, or `d` up to a half with `Ni` and `Ks`, is smooth
//!   glass. Of `Tf` only the hue counts, shared between entering and leaving: files disagree whether
//!   it is what passes or what is held back.
//! - `d`, else 1 − `Tr`, below 1 is stochastic coverage. `Tr 1` alone would be invisible; it comes
//!   from writers that mean `d 1`.
//! - `map_Kd` replaces `Kd`, as in the programs that write these files; many leave black, their
//!   default grey or the texture's mean in `Kd`.
//! - A `map_Kd` with an alpha channel of its own makes `map_d` void: where both are there they hold
//!   the same, and would count twice.
//! - All surfaces are double-sided, as MTL has no other.

use glam::Vec3;
use rayburst_image::colour::luminance;

use super::{MapRef, MapUse, MtlMaterial, TextureStore};
use crate::{AlphaMode, Material, ShadingModel, TextureSlot};

/// From this exponent on, reflections of `illum` 3 and 5 are taken for perfect.
const MIRROR_EXPONENT: f32 = 500.0;

/// A material, and what of it could not be kept.
#[derive(Debug)]
pub(crate) struct Converted {
    pub(crate) material: Material,
    pub(crate) notes: Vec<&'static str>,
}

/// Converts one material; textures go to `textures`.
pub(crate) fn convert(mtl: &MtlMaterial, textures: &mut TextureStore<'_>) -> Converted {
    let mut notes = Vec::new();
    let mut material = surface(mtl);
    let alpha = opacity(mtl, &mut notes);

    if let Some(emission) = mtl.emission {
        material.emissive = emission.to_array();
        // Lamps shine to the side that their winding faces, as area lights elsewhere do: one that
        // hangs close under a ceiling must not spend half its light in the gap.
        if material.is_emissive() {
            material.flags &= !Material::DOUBLE_SIDED;
        }
    }
    if let Some(map) = &mtl.emission_map {
        material.emissive_texture = textures.slot(map, MapUse::Color);
        if material.emissive_texture.index().is_some() && !material.is_emissive() {
            material.emissive = [1.0; 3];
        }
    }
    let colour_map = match (&mtl.diffuse_map, &mtl.specular_map) {
        // What glass lets through is Tf's.
        _ if material.model() == ShadingModel::Dielectric => None,
        (None, Some(map)) if material.metallic > 0.5 => Some(map),
        (diffuse, specular) => {
            if specular.is_some() {
                notes.push("map_Ks is left out: there is one specular strength a material");
            }
            diffuse.as_ref()
        }
    };
    if let Some(map) = colour_map {
        material.base_color_texture = textures.slot(map, MapUse::Color);
        if material.base_color_texture.index().is_some() {
            material.base_color = [1.0; 4];
        }
    }
    read_surface_maps(mtl, &mut material, textures, &mut notes);
    read_alpha(mtl, alpha, &mut material, textures);
    Converted { material, notes }
}

/// Shading model, colour, metalness, roughness and index of refraction.
fn surface(mtl: &MtlMaterial) -> Material {
    let diffuse = mtl.diffuse.unwrap_or(Vec3::splat(0.8)).min(Vec3::ONE);
    let specular = mtl.specular.unwrap_or(Vec3::ZERO).min(Vec3::ONE);
    let exponent = mtl.exponent.unwrap_or(0.0).max(0.0);
    let illumination = mtl.illumination.unwrap_or(2);
    let (kd, ks) = (luminance(diffuse), luminance(specular));

    if is_glass(mtl, ks) {
        let filter = mtl.filter.unwrap_or(Vec3::ONE).min(Vec3::ONE);
        let brightest = filter.max_element();
        let hue = if brightest > 0.0 { filter / brightest } else { Vec3::ONE };
        let mut glass = Material::glass(mtl.ior.unwrap_or(1.5).clamp(1.0, 4.0));
        glass.base_color = hue.map(f32::sqrt).extend(1.0).to_array();
        return glass;
    }
    if matches!(illumination, 3 | 5) && exponent >= MIRROR_EXPONENT && ks > 2.0 * kd {
        return Material::mirror(specular);
    }
    let roughness = match mtl.roughness {
        Some(roughness) => roughness.clamp(0.0, 1.0),
        None => (2.0 / (exponent + 2.0)).powf(0.25),
    };
    if let Some(metallic) = mtl.metallic {
        let mut material = Material::plastic(diffuse, roughness);
        material.metallic = metallic.clamp(0.0, 1.0);
        return material;
    }
    let saturation = specular.max_element() - specular.min_element();
    let outshines = ks > 0.3 && kd < 0.2 * ks;
    let is_coloured = saturation > 0.15 && ks > kd;
    if outshines || is_coloured {
        return Material::metal(specular, roughness);
    }
    if ks > 0.0 || mtl.roughness.is_some() {
        let mut material = Material::plastic(diffuse, roughness);
        if ks > 0.0 {
            let root = (0.08 * ks).sqrt();
            material.ior = (1.0 + root) / (1.0 - root);
        }
        return material;
    }
    Material::diffuse(diffuse)
}

fn is_glass(mtl: &MtlMaterial, ks: f32) -> bool {
    let refracts = mtl.ior.is_some_and(|ior| ior > 1.0);
    if matches!(mtl.illumination, Some(4 | 6 | 7 | 9)) {
        return refracts && mtl.alpha_map.is_none();
    }
    let is_clear = mtl.dissolve.or(mtl.transparency.map(|t| 1.0 - t)).is_some_and(|d| d <= 0.5);
    let is_solid = mtl.alpha_map.is_none() && mtl.diffuse_map.is_none();
    let is_invisible = mtl.dissolve.is_none() && mtl.transparency == Some(1.0);
    refracts && is_clear && is_solid && ks > 0.0 && !is_invisible
}

fn opacity(mtl: &MtlMaterial, notes: &mut Vec<&'static str>) -> f32 {
    let alpha = match (mtl.dissolve, mtl.transparency) {
        (Some(dissolve), _) => dissolve,
        (None, Some(1.0)) => {
            notes.push("Tr 1 is read as opaque, as it would be invisible");
            1.0
        }
        (None, Some(transparency)) => 1.0 - transparency,
        (None, None) => 1.0,
    };
    alpha.clamp(0.0, 1.0)
}

fn read_surface_maps(
    mtl: &MtlMaterial,
    material: &mut Material,
    textures: &mut TextureStore<'_>,
    notes: &mut Vec<&'static str>,
) {
    let rough = mtl.roughness_map.as_ref();
    let metal = mtl.metallic_map.as_ref();
    if rough.is_some() || metal.is_some() {
        material.metallic_roughness_texture = textures.metallic_roughness(rough, metal);
        if material.metallic_roughness_texture.index().is_some() {
            if rough.is_some() {
                material.roughness = 1.0;
            }
            if metal.is_some() {
                material.metallic = 1.0;
            }
        }
    }
    let normal: Option<&MapRef> = mtl.normal_map.as_ref();
    if let Some(map) = normal {
        material.normal_texture = textures.slot(map, MapUse::Data);
    } else if let Some(map) = &mtl.bump_map {
        // Many files name a normal map so; a height map has no blue of its own.
        if textures.is_normal_map(map) {
            material.normal_texture = textures.slot(map, MapUse::Data);
            material.normal_scale = map.bump;
        } else {
            notes.push("its height map (map_Bump) is left out; convert it to a normal map (norm)");
        }
    }
}

fn read_alpha(
    mtl: &MtlMaterial,
    alpha: f32,
    material: &mut Material,
    textures: &mut TextureStore<'_>,
) {
    if matches!(material.model(), ShadingModel::Dielectric | ShadingModel::Mirror) {
        return;
    }
    let of_color = textures.alpha_mode(material.base_color_texture);
    let by_image = match &mtl.alpha_map {
        Some(map) if of_color == AlphaMode::Opaque => {
            material.alpha_texture = textures.slot(map, MapUse::Alpha);
            textures.alpha_mode(material.alpha_texture)
        }
        _ => of_color,
    };
    material.base_color[3] = alpha;
    // Water and panes share their atlas with leaves; `illum` tells them apart.
    let is_glassy = matches!(mtl.illumination, Some(4 | 6 | 7 | 9));
    let mode = match by_image {
        _ if alpha < 1.0 => AlphaMode::Blend,
        AlphaMode::Mask if is_glassy => AlphaMode::Blend,
        mode => mode,
    };
    material.alpha_mode = mode as u32;
    if mode == AlphaMode::Opaque {
        material.alpha_texture = TextureSlot::NONE;
    }
}
