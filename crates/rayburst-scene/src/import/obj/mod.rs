//! Wavefront OBJ with its MTL libraries.

mod build;
mod parse;

use std::{
    collections::{HashMap, HashSet},
    path::Path,
    sync::Arc,
};

use super::{
    ImportError, LoadOptions, ResolveError, Resolver,
    find::FileFinder,
    mtl::{self, MtlMaterial, TextureStore},
    read_limited,
};
use crate::{Mesh, Node, Primitive, Scene};
use parse::{Count, MAX_LIBRARIES, ObjFile};

/// Most bytes that a face's corner can come to in memory: its own record, and a vertex with its
/// attributes, its key and its part of a triangle.
const BYTES_PER_CORNER: u64 = 110;

/// Most missing materials that a warning names.
const MAX_NAMED: usize = 8;

/// Reads a scene. Materials of missing libraries are replaced by a neutral one, with a warning.
pub(crate) fn load(path: &Path, options: &LoadOptions) -> Result<Scene, ImportError> {
    let bytes = read_limited(path, options.max_file_bytes)
        .map_err(|e| ImportError::unresolved(path, "the file", e))?;
    let file = parse::parse(&bytes);
    drop(bytes);
    check(path, options, &file)?;

    let name = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let mut scene = Scene { name, metres_per_unit: 1.0, ..Scene::default() };
    warn_of_problems(&file, &mut scene.warnings);
    let resolver = Resolver::new(path, options.allow_external, options.max_file_bytes)
        .map_err(|source| ImportError::Io { path: path.to_path_buf(), source })?;
    let mut finder = FileFinder::new(&resolver, path);
    let names = file.material_names.clone();
    let library = read_libraries(&file.libraries, &names, &resolver, &mut finder, &mut scene);
    let textures = TextureStore::load(&library, &resolver, &mut finder, path, options)?;

    let (objects, dropped) = build::build(file, &scene.name);
    if dropped > 0 {
        let what = "refer to vertices that are missing or not finite";
        scene.warnings.push(format!("{dropped} faces are left out: they {what}"));
    }
    if objects.is_empty() {
        let reason = match dropped {
            0 => "there are no faces in it; only polygon meshes can be read".to_owned(),
            _ => format!("none of its {dropped} faces has vertices that exist and are finite"),
        };
        return Err(ImportError::malformed(path, "the file", reason));
    }
    let mut materials = MaterialTable::new(&names, &library, textures);
    for object in objects {
        let primitives = object.primitives.into_iter();
        let primitives: Vec<Arc<Primitive>> = primitives
            .map(|mut primitive| {
                let is_coloured = primitive.colors.is_some();
                primitive.material = materials.index(primitive.material, is_coloured, &mut scene);
                Arc::new(primitive)
            })
            .collect();
        let mesh = scene.meshes.len() as u32;
        scene.meshes.push(Mesh { name: object.name.clone(), primitives, weights: Vec::new() });
        scene.nodes.push(Node { name: object.name, mesh: Some(mesh), ..Node::default() });
    }
    materials.finish(&mut scene);
    Ok(scene)
}

fn check(path: &Path, options: &LoadOptions, file: &ObjFile) -> Result<(), ImportError> {
    let bytes = file.corners.len() as u64 * BYTES_PER_CORNER;
    let too_large = |what: String, limit: String| ImportError::TooLarge {
        path: path.to_path_buf(),
        location: "faces".to_owned(),
        what,
        limit,
    };
    if file.problems.overflow {
        let what = "the number of corners of all faces".to_owned();
        return Err(too_large(what, (u32::MAX - 1).to_string()));
    }
    if bytes > options.max_geometry_bytes {
        let what = format!("up to {bytes} bytes of geometry");
        return Err(too_large(what, format!("{} bytes", options.max_geometry_bytes)));
    }
    Ok(())
}

fn warn_of_problems(file: &ObjFile, warnings: &mut Vec<String>) {
    let mut warn = |count: Count, what: &str| {
        if count.times > 0 {
            warnings.push(format!("{} {what}; the first is in line {}", count.times, count.line));
        }
    };
    let problems = &file.problems;
    warn(problems.broken_faces, "faces are left out, they have no three valid corners");
    warn(problems.broken_vertices, "vertices have no three coordinates");
    warn(problems.points_and_lines, "points or lines are left out, they have no surface");
    warn(problems.free_form, "free-form curves or surfaces are left out; convert them to polygons");
}

/// The materials of all libraries that faces use, each with its library's folder. Of several with
/// the same name the first counts.
fn read_libraries(
    libraries: &[String],
    used: &[String],
    resolver: &Resolver,
    finder: &mut FileFinder<'_>,
    scene: &mut Scene,
) -> Vec<(String, MtlMaterial)> {
    let mut materials: Vec<(String, MtlMaterial)> = Vec::new();
    let mut known = HashSet::new();
    let used: HashSet<String> = used.iter().map(|name| name.to_lowercase()).collect();
    let mut read = |file: &str, materials: &mut Vec<(String, MtlMaterial)>| {
        let path = finder.find("", file)?;
        let bytes = resolver.read(&path)?;
        let base = file.replace('\\', "/");
        let base = base.rsplit_once('/').map_or("", |(folder, _)| folder);
        let usable = |m: &MtlMaterial| used.contains(&m.name.to_lowercase());
        for material in mtl::parse(&bytes) {
            if usable(&material) && known.insert(material.name.clone()) {
                materials.push((base.to_owned(), material));
            }
        }
        Ok::<(), ResolveError>(())
    };
    for line in libraries {
        // A line is one name with blanks, or several names.
        let Err(error) = read(line, &mut materials) else { continue };
        let names: Vec<&str> = line.split_whitespace().take(MAX_LIBRARIES).collect();
        let mut missing = |error: &ResolveError| {
            scene.warnings.push(format!("material library '{line}' is left out: {error}"));
        };
        if names.len() == 1 {
            missing(&error);
            continue;
        }
        names.iter().filter_map(|name| read(name, &mut materials).err()).for_each(|e| missing(&e));
    }
    materials
}

/// Materials of the scene, converted when first used.
struct MaterialTable<'a> {
    /// As the file's faces name them.
    names: &'a [String],
    library: &'a [(String, MtlMaterial)],
    by_name: HashMap<&'a str, usize>,
    by_folded_name: HashMap<String, usize>,
    textures: TextureStore<'a>,
    /// Index in the scene of a name's material.
    of_name: HashMap<u32, u32>,
    /// Indices of the materials for faces without one: plain, and under vertex colours.
    neutral: [Option<u32>; 2],
    missing: Vec<&'a str>,
}

impl<'a> MaterialTable<'a> {
    fn new(
        names: &'a [String],
        library: &'a [(String, MtlMaterial)],
        textures: TextureStore<'a>,
    ) -> Self {
        let entries = || library.iter().enumerate().rev();
        Self {
            names,
            library,
            by_name: entries().map(|(i, (_, m))| (m.name.as_str(), i)).collect(),
            by_folded_name: entries().map(|(i, (_, m))| (m.name.to_lowercase(), i)).collect(),
            textures,
            of_name: HashMap::new(),
            neutral: [None; 2],
            missing: Vec::new(),
        }
    }

    /// Index in the scene of the material that a face's name stands for.
    fn index(&mut self, name: u32, is_coloured: bool, scene: &mut Scene) -> u32 {
        if let Some(&index) = self.of_name.get(&name) {
            return index;
        }
        let Some(text) = self.names.get(name as usize) else {
            return self.neutral(is_coloured, scene);
        };
        let exact = self.by_name.get(text.as_str());
        let Some(&entry) = exact.or_else(|| self.by_folded_name.get(&text.to_lowercase())) else {
            if !self.missing.contains(&text.as_str()) && self.missing.len() < MAX_NAMED {
                self.missing.push(text);
            }
            return self.neutral(is_coloured, scene);
        };
        let converted = mtl::convert(&self.library[entry].1, &mut self.textures);
        let notes = converted.notes.into_iter().map(|note| format!("material '{text}': {note}"));
        scene.warnings.extend(notes);
        let index = scene.add_material(text, converted.material);
        self.of_name.insert(name, index);
        index
    }

    fn neutral(&mut self, is_coloured: bool, scene: &mut Scene) -> u32 {
        *self.neutral[usize::from(is_coloured)].get_or_insert_with(|| {
            scene.add_material("default", crate::import::default_material(is_coloured))
        })
    }

    fn finish(self, scene: &mut Scene) {
        scene.images = self.textures.images;
        scene.textures = self.textures.textures;
        scene.warnings.extend(self.textures.warnings);
        if !self.missing.is_empty() {
            let more = if self.missing.len() < MAX_NAMED { "" } else { " and perhaps more" };
            let names = self.missing.join("', '");
            scene.warnings.push(format!(
                "no library defines the materials '{names}'{more}; a neutral grey stands in"
            ));
        }
    }
}
