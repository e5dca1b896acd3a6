//! glTF 2.0 (Khronos Group, "glTF 2.0 Specification", 2021), as `.gltf` and `.glb`.
//!
//! The file is parsed to plain structures ([`json`]), its buffers are read ([`source`]), and every
//! access to them goes through accessors that are checked once ([`accessor`]).

mod accessor;
mod animation;
mod container;
mod extensions;
mod hierarchy;
mod json;
mod material;
mod mesh;
mod source;
mod texture;
mod vertex_skin;
mod warnings;

use std::path::Path;

use self::{
    material::Materials, mesh::MeshReader, source::Source, texture::TextureTable,
    warnings::Warnings,
};
use super::{ImportError, LoadOptions, Resolver, read_limited};
use crate::{Mesh, Scene};

/// Reads a `.gltf` or `.glb` file.
pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Scene, ImportError> {
    let io = |source| ImportError::Io { path: path.to_path_buf(), source };
    let bytes = read_limited(path, options.max_file_bytes)
        .map_err(|e| ImportError::unresolved(path, "the file", e))?;
    let resolver =
        Resolver::new(path, options.allow_external, options.max_file_bytes).map_err(io)?;
    read(path, &bytes, &resolver, options)
}

fn read(
    path: &Path,
    bytes: &[u8],
    resolver: &Resolver,
    options: &LoadOptions,
) -> Result<Scene, ImportError> {
    let (root, binary) = container::parse(path, bytes)?;
    extensions::check_required(path, &root)?;
    check_counts(path, &root, options)?;
    let source = Source::open(path, &root, bytes, binary, resolver, options)?;
    let mut warnings = Warnings::default();

    let mut hierarchy = hierarchy::read(&source, &mut warnings)?;
    let skins = hierarchy::skins(&source, &hierarchy.new_index)?;
    let cameras = hierarchy::cameras(&source)?;
    let lights = hierarchy::lights(&source, &mut warnings)?;

    let mut textures = TextureTable::new(&source);
    let mut materials = Materials::read(&source, &mut textures, &mut warnings)?;
    let material_used = vec![false; materials.records.len()];
    let mut reader = MeshReader { source: &source, materials: &materials, material_used };
    let meshes = place_meshes(&mut hierarchy.nodes, &mut reader, &mut warnings)?;
    let material_used = reader.material_used;
    check_joints(&source, &hierarchy.nodes, &meshes, &skins)?;
    let animations = animation::read(
        &source,
        &hierarchy.new_index,
        &mut hierarchy.nodes,
        &meshes,
        &mut warnings,
    )?;
    let decoded =
        textures.decode(&mut materials.records, &material_used, options, &mut warnings)?;
    if !material_used[materials.default_index()] && materials.records.len() > 1 {
        materials.records.pop();
        materials.names.pop();
    }
    let scene = &root.scenes.get(root.scene.unwrap_or(0));
    let name = scene.map(|s| s.name.clone()).filter(|name| !name.is_empty());
    let stem = || path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Scene {
        name: name.unwrap_or_else(stem),
        nodes: hierarchy.nodes,
        meshes,
        skins,
        animations,
        materials: materials.records,
        material_names: materials.names,
        textures: decoded.textures,
        images: decoded.images,
        cameras,
        lights,
        metres_per_unit: 1.0,
        warnings: warnings.into_lines(),
        ..Scene::default()
    })
}

/// Reads the meshes that nodes place, once each, and renumbers the nodes' references. Nodes whose
/// mesh has no triangles place nothing.
fn place_meshes(
    nodes: &mut [crate::Node],
    reader: &mut MeshReader<'_>,
    warnings: &mut Warnings,
) -> Result<Vec<Mesh>, ImportError> {
    let mut meshes: Vec<Mesh> = Vec::new();
    let mut new_index: Vec<Option<u32>> = vec![None; reader.source.root.meshes.len()];
    for node in nodes {
        let Some(old) = node.mesh else { continue };
        let new = match new_index[old as usize] {
            Some(new) => new,
            None => {
                meshes.push(reader.read(old as usize, warnings)?);
                *new_index[old as usize].insert(meshes.len() as u32 - 1)
            }
        };
        let mesh = &meshes[new as usize];
        node.mesh = (!mesh.primitives.is_empty()).then_some(new);
        if !node.weights.is_empty() {
            node.weights.resize(mesh.weights.len(), 0.0);
        }
        if mesh.primitives.iter().all(|p| p.skin.is_none()) {
            node.skin = None;
        }
    }
    Ok(meshes)
}

/// Vertices may only name joints that the skin has.
fn check_joints(
    source: &Source<'_>,
    nodes: &[crate::Node],
    meshes: &[Mesh],
    skins: &[crate::Skin],
) -> Result<(), ImportError> {
    let mut needed: Vec<Option<usize>> = vec![None; meshes.len()];
    for node in nodes {
        let (Some(mesh), Some(skin)) = (node.mesh, node.skin) else { continue };
        let needed = *needed[mesh as usize].get_or_insert_with(|| {
            let skins = meshes[mesh as usize].primitives.iter().filter_map(|p| p.skin.as_ref());
            let joints = skins.flatten().flat_map(|v| v.joints);
            joints.max().map_or(0, |joint| usize::from(joint) + 1)
        });
        let found = skins[skin as usize].joints.len();
        if needed > found {
            let reason = format!(
                "vertices of mesh '{:.40}' name joint {}, the skin has {found}",
                meshes[mesh as usize].name,
                needed - 1
            );
            return Err(source.malformed(format!("/skins/{skin}"), reason));
        }
    }
    Ok(())
}

fn check_counts(path: &Path, root: &json::Root, options: &LoadOptions) -> Result<(), ImportError> {
    let counts = [
        ("nodes", root.nodes.len()),
        ("meshes", root.meshes.len()),
        ("accessors", root.accessors.len()),
        ("bufferViews", root.buffer_views.len()),
        ("materials", root.materials.len()),
        ("textures", root.textures.len()),
        ("images", root.images.len()),
        ("animations", root.animations.len()),
    ];
    match counts.iter().find(|(_, count)| *count > options.max_items) {
        None => Ok(()),
        Some((what, count)) => Err(ImportError::TooLarge {
            path: path.to_path_buf(),
            location: format!("/{what}"),
            what: format!("{count} of them"),
            limit: options.max_items.to_string(),
        }),
    }
}
