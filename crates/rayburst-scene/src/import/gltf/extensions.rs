//! Extensions: which are read, and what to do about a file that needs another.

use std::path::Path;

use super::json::Root;
use crate::import::ImportError;

const SUPPORTED: [&str; 7] = [
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Fails if the file cannot be read without an extension that is not supported.
pub(super) fn check_required(path: &Path, root: &Root) -> Result<(), ImportError> {
    match root.extensions_required.iter().find(|name| !SUPPORTED.contains(&name.as_str())) {
        None => Ok(()),
        Some(name) => Err(ImportError::UnsupportedExtension {
            path: path.to_path_buf(),
            name: name.chars().take(80).collect(),
            way_out: way_out(name),
        }),
    }
}

/// How to get a file that can be read (commands of glTF Transform, `@gltf-transform/cli` on npm).
fn way_out(name: &str) -> String {
    let (command, options) = match name {
        "KHR_draco_mesh_compression" | "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            ("copy", "")
        }
        "KHR_texture_basisu" => ("ktxdecompress", " (needs KTX-Software)"),
        "EXT_texture_webp" | "EXT_texture_avif" => ("png", " --formats \"*\""),
        "KHR_materials_pbrSpecularGlossiness" => ("metalrough", ""),
        _ => {
            return "export the scene without it, or take its name out of \"extensionsRequired\" to \
                    see the scene without what it adds"
                .to_owned();
        }
    };
    format!("convert the file: npx @gltf-transform/cli {command} input.glb output.glb{options}")
}
