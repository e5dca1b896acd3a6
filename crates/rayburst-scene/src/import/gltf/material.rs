//! Materials (glTF 2.0, section 3.9) with `KHR_materials_emissive_strength`, `_ior`, `_unlit`.

use std::collections::BTreeMap;

use rayburst_image::TexelFormat;

use super::{json, source::Source, texture::TextureTable, warnings::Warnings};
use crate::{AlphaMode, Material, ShadingModel, TextureSlot, import::ImportError};

/// The materials of a file.
pub(super) struct Materials {
    pub(super) records: Vec<Material>,
    pub(super) names: Vec<String>,
    /// For each material, the UV sets of the file that its primitives keep, in their new order.
    pub(super) uv_sets: Vec<Vec<u32>>,
}

impl Materials {
    /// Converts all materials; the last one is glTF's default.
    pub(super) fn read(
        source: &Source<'_>,
        textures: &mut TextureTable<'_>,
        warnings: &mut Warnings,
    ) -> Result<Self, ImportError> {
        let count = source.root.materials.len();
        let mut materials = Self {
            records: Vec::with_capacity(count + 1),
            names: Vec::with_capacity(count + 1),
            uv_sets: Vec::with_capacity(count + 1),
        };
        warn_of_extensions(&source.root.materials, warnings);
        for (index, json) in source.root.materials.iter().enumerate() {
            let mut record = convert(index, json, textures, warnings)?;
            let sets = compact_uv_sets(index, &mut record, warnings);
            materials.records.push(record);
            materials.names.push(json.name.clone());
            materials.uv_sets.push(sets);
        }
        materials.records.push(Material::GLTF_DEFAULT);
        materials.names.push("(default)".to_owned());
        materials.uv_sets.push(vec![0]);
        Ok(materials)
    }

    /// Index of glTF's default material.
    pub(super) fn default_index(&self) -> usize {
        self.records.len() - 1
    }
}

/// One warning for each extension that is not read, with the number of its materials.
fn warn_of_extensions(materials: &[json::Material], warnings: &mut Warnings) {
    let mut counts: BTreeMap<&str, u32> = BTreeMap::new();
    for name in materials.iter().flat_map(|m| m.extensions.other.keys()) {
        *counts.entry(name).or_default() += 1;
    }
    for (name, count) in counts {
        let materials =
            if count == 1 { "1 material is" } else { &format!("{count} materials are") };
        let what = format!("{name:.60} is not supported yet: {materials} shown without it");
        warnings.add(what, "/materials", 1);
    }
}

fn convert(
    index: usize,
    json: &json::Material,
    textures: &mut TextureTable<'_>,
    warnings: &mut Warnings,
) -> Result<Material, ImportError> {
    let location = || format!("/materials/{index}");
    let pbr = &json.pbr_metallic_roughness;
    let mut slot = |info: Option<&json::TextureInfo>, format| match info {
        Some(info) => textures.slot(info, format, &location()),
        None => Ok(TextureSlot::NONE),
    };
    let normal = json.normal_texture.as_ref();
    let occlusion = json.occlusion_texture.as_ref();
    let mut material = Material {
        base_color: pbr.base_color_factor.unwrap_or([1.0; 4]).map(unit),
        metallic: unit(pbr.metallic_factor.unwrap_or(1.0)),
        roughness: unit(pbr.roughness_factor.unwrap_or(1.0)),
        normal_scale: finite(normal.and_then(|n| n.scale).unwrap_or(1.0), 1.0),
        occlusion_strength: unit(occlusion.and_then(|o| o.strength).unwrap_or(1.0)),
        alpha_cutoff: finite(json.alpha_cutoff.unwrap_or(0.5), 0.5).max(0.0),
        base_color_texture: slot(pbr.base_color_texture.as_ref(), TexelFormat::Srgb)?,
        metallic_roughness_texture: slot(
            pbr.metallic_roughness_texture.as_ref(),
            TexelFormat::Linear,
        )?,
        normal_texture: slot(normal.map(|n| &n.info), TexelFormat::Linear)?,
        occlusion_texture: slot(occlusion.map(|o| &o.info), TexelFormat::Linear)?,
        emissive_texture: slot(json.emissive_texture.as_ref(), TexelFormat::Srgb)?,
        ..Material::GLTF_DEFAULT
    };
    if json.double_sided {
        material.flags |= Material::DOUBLE_SIDED;
    }
    material.alpha_mode = match json.alpha_mode.as_deref() {
        None | Some("OPAQUE") => AlphaMode::Opaque,
        Some("MASK") => AlphaMode::Mask,
        Some("BLEND") => AlphaMode::Blend,
        Some(other) => {
            let other: String = other.chars().take(20).collect();
            warnings.add(format!("unknown alpha mode '{other}', opaque instead"), location(), 1);
            AlphaMode::Opaque
        }
    } as u32;
    let strength = json.extensions.emissive_strength.as_ref().and_then(|e| e.emissive_strength);
    let strength = finite(strength.unwrap_or(1.0), 1.0).max(0.0);
    material.emissive =
        json.emissive_factor.unwrap_or([0.0; 3]).map(|e| finite(e.max(0.0) * strength, 0.0));
    if let Some(ior) = json.extensions.ior.as_ref().and_then(|e| e.ior) {
        // 0 stands for an endless index, a coat that reflects everything.
        material.ior = if ior == 0.0 { 1e4 } else { finite(ior, 1.5).clamp(1.0, 1e4) };
    }
    if json.emissive_texture.is_some() && material.emissive_texture.index().is_none() {
        // Without its picture all of the surface would glow.
        material.emissive = [0.0; 3];
    }
    if json.extensions.unlit.is_some() {
        material.model = ShadingModel::Unlit as u32;
        material.emissive = [0.0; 3];
    }
    Ok(material)
}

/// Renumbers the UV sets that a material uses so that they are the first two, which is what hits
/// carry; returns the sets in their new order.
fn compact_uv_sets(index: usize, material: &mut Material, warnings: &mut Warnings) -> Vec<u32> {
    let in_use = material.slots().into_iter().filter(|slot| slot.index().is_some());
    let mut sets: Vec<u32> = in_use.map(|slot| slot.uv_set).collect();
    sets.sort_unstable();
    sets.dedup();
    match sets.last() {
        None | Some(0) => return vec![0],
        Some(1) => return vec![0, 1],
        Some(_) => {}
    }
    if sets.len() > 2 {
        let what = "a material with more than two UV sets; the others use the first";
        warnings.add(what, format!("/materials/{index}"), 1);
        sets.truncate(2);
    }
    for slot in material.slots_mut() {
        slot.uv_set = sets.iter().position(|&set| set == slot.uv_set).unwrap_or(0) as u32;
    }
    sets
}

/// Clamped to [0, 1]; what is not a number is 1.
fn unit(x: f32) -> f32 {
    if x.is_nan() { 1.0 } else { x.clamp(0.0, 1.0) }
}

fn finite(x: f32, otherwise: f32) -> f32 {
    if x.is_finite() { x } else { otherwise }
}
