//! Reading scenes from files.
//!
//! Files come from anywhere: nothing in them is believed before it is checked, memory is asked for
//! only after the file has shown that it holds the data, and what can be mended is mended with a
//! line in [`Scene::warnings`].

mod default_material;
mod environment;
mod error;
mod find;
mod gltf;
mod mtl;
mod obj;
mod ply;
mod resolve;
mod scan;
mod triangulate;
mod view;
mod weld;

use std::{
    fs::File,
    io::Read,
    path::{Path, PathBuf},
};

pub use environment::load_environment;
pub use error::ImportError;
pub use resolve::{ResolveError, Resolver, read_limited};
pub use view::apply_view;

pub(crate) use default_material::default_material;

use crate::Scene;

/// What a file may ask for.
#[derive(Clone, Debug)]
pub struct LoadOptions {
    /// Follow references that leave the scene's folder. Nothing is ever fetched from a network.
    pub allow_external: bool,
    /// A file of views, cameras and lights to use instead of `NAME.view.json` beside the scene.
    pub view: Option<PathBuf>,
    /// Most bytes read from one file.
    pub max_file_bytes: u64,
    /// Most bytes of vertices, indices, keys and instances after decoding, all together.
    pub max_geometry_bytes: u64,
    /// Most bytes that a file may describe without holding them (accessors of zeros).
    pub max_implied_bytes: u64,
    /// Most bytes of decoded images, all together.
    pub max_image_bytes: u64,
    /// Most nodes, meshes, materials or other parts of one kind.
    pub max_items: usize,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            allow_external: false,
            view: None,
            max_file_bytes: 8 << 30,
            max_geometry_bytes: 16 << 30,
            max_implied_bytes: 64 << 20,
            max_image_bytes: 8 << 30,
            max_items: 1 << 22,
        }
    }
}

/// Formats of scene files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Gltf,
    Obj,
    Ply,
}

/// Reads a scene of any supported format, told by its extension and, failing that, its content; then
/// the view file that the options name, or else `NAME.view.json` beside the scene if there is one.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, ImportError> {
    let mut scene = load_without_view(path, options)?;
    if let Some(view) = &options.view {
        apply_view(&mut scene, view)?;
    } else {
        let beside = path.with_extension("view.json");
        if beside.is_file() {
            apply_view(&mut scene, &beside)?;
        }
    }
    Ok(scene)
}

fn load_without_view(path: &Path, options: &LoadOptions) -> Result<Scene, ImportError> {
    match format_of(path)? {
        Format::Gltf => gltf::load(path, options),
        Format::Obj => obj::load(path, options),
        Format::Ply => ply::load(path, options),
    }
}

fn format_of(path: &Path) -> Result<Format, ImportError> {
    let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    match extension.as_deref() {
        Some("gltf" | "glb") => Ok(Format::Gltf),
        Some("obj") => Ok(Format::Obj),
        Some("ply") => Ok(Format::Ply),
        _ => {
            let io = |source| ImportError::Io { path: path.to_path_buf(), source };
            if !std::fs::metadata(path).map_err(io)?.is_file() {
                return Err(io(std::io::Error::other("it is not a regular file")));
            }
            let mut head = Vec::new();
            File::open(path).map_err(io)?.take(1024).read_to_end(&mut head).map_err(io)?;
            sniff(&head).ok_or_else(|| ImportError::UnknownFormat { path: path.to_path_buf() })
        }
    }
}

/// The format that the first bytes of a file speak of.
fn sniff(head: &[u8]) -> Option<Format> {
    if head.starts_with(b"glTF") || head.trim_ascii_start().starts_with(b"{") {
        return Some(Format::Gltf);
    }
    head.starts_with(b"ply").then_some(Format::Ply)
}
