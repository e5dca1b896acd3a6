//! What meshes without a material are made of.

use glam::Vec3;

use crate::Material;

/// A light grey, slightly glossy plastic; white under vertex colours, which multiply it.
pub(crate) fn default_material(is_coloured: bool) -> Material {
    let grey = if is_coloured { 1.0 } else { 0.6 };
    Material::plastic(Vec3::splat(grey), 0.5)
}
