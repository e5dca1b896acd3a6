//! Reading scenes from files.
//!
//! Files come from anywhere: nothing in them is believed before it is checked, memory is asked for
//! only after the file has shown that it holds the data, and what can be mended is mended with a
//! line in [`Scene::warnings`].

mod error;
mod resolve;

use std::path::{Path, PathBuf};

pub use error::ImportError;
pub use resolve::{ResolveError, Resolver, read_limited};

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
    /// Most texels of one image.
    pub max_image_texels: u64,
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
            max_image_texels: 1 << 28,
            max_image_bytes: 8 << 30,
            max_items: 1 << 22,
        }
    }
}

/// Reads a scene of any supported format, told by its extension and, failing that, its content.
pub fn load(path: &Path, _options: &LoadOptions) -> Result<Scene, ImportError> {
    Err(ImportError::UnknownFormat { path: path.to_path_buf() })
}
