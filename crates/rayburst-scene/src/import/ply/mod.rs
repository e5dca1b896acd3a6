//! PLY meshes, ASCII and binary of both byte orders (Turk, "The PLY Polygon File Format", 1994).
//!
//! Elements and properties may come in any order and number; what is not known is passed over.
//! - Integer vertex colours are what a screen shows (sRGB), as scanners and MeshLab write them;
//!   floating-point ones are linear.
//! - Without normals, smooth ones are computed: scans share their vertices.
//! - Counts of the header are checked against the bytes that follow before anything is allocated.

mod body;
mod header;

use std::{path::Path, sync::Arc};

use glam::{Vec2, Vec3, Vec4};
use rayburst_image::colour::srgb_decode;

use super::{
    ImportError, LoadOptions, Resolver, default_material,
    find::FileFinder,
    mtl::{MapRef, MapUse, MtlMaterial, TextureStore},
    read_limited,
    triangulate::Triangulator,
    weld::Welder,
};
use crate::{Material, Mesh, Node, Primitive, Scene, normals};
use body::Reader;
use header::{Element, Header, Scalar};

/// Reads a scene of one mesh.
pub(crate) fn load(path: &Path, options: &LoadOptions) -> Result<Scene, ImportError> {
    let bytes = read_limited(path, options.max_file_bytes)
        .map_err(|e| ImportError::unresolved(path, "the file", e))?;
    let header = header::parse(&bytes)
        .map_err(|(line, reason)| ImportError::malformed(path, format!("line {line}"), reason))?;
    let name = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let mut scene = Scene { name, metres_per_unit: 1.0, ..Scene::default() };

    let header_lines = bytes[..header.body].iter().filter(|&&b| b == b'\n').count() as u32;
    let mut mesh = PlyMesh::default();
    let mut reader = Reader::new(&bytes[header.body..], header.encoding);
    for element in &header.elements {
        mesh.read(element, &header, &mut reader, options).map_err(|problem| {
            let location = reader.place(header_lines, header.body);
            problem.into_error(path, location, options)
        })?;
    }
    drop(bytes);
    let mut primitive = mesh.into_primitive(path, &mut scene.warnings)?;
    let material = material(path, options, &header, &primitive, &mut scene)?;
    primitive.material = scene.add_material("default", material);
    let name = scene.name.clone();
    scene.meshes.push(Mesh {
        name: name.clone(),
        primitives: vec![Arc::new(primitive)],
        weights: Vec::new(),
    });
    scene.nodes.push(Node { name, mesh: Some(0), ..Node::default() });
    Ok(scene)
}

/// The default material, with the texture of a `TextureFile` comment if there are UVs.
fn material(
    path: &Path,
    options: &LoadOptions,
    header: &Header,
    primitive: &Primitive,
    scene: &mut Scene,
) -> Result<Material, ImportError> {
    let mut material = default_material(primitive.colors.is_some());
    let Some(file) = header.texture.clone().filter(|_| !primitive.uvs.is_empty()) else {
        return Ok(material);
    };
    let resolver = Resolver::new(path, options.allow_external, options.max_file_bytes)
        .map_err(|source| ImportError::Io { path: path.to_path_buf(), source })?;
    let map = MapRef::new(file);
    let textured = MtlMaterial { diffuse_map: Some(map.clone()), ..MtlMaterial::default() };
    let mut finder = FileFinder::new(&resolver, path);
    let wanted = [(String::new(), textured)];
    let mut store = TextureStore::load(&wanted, &resolver, &mut finder, path, options)?;
    material.base_color_texture = store.slot(&map, MapUse::Color);
    if material.base_color_texture.index().is_some() {
        material.base_color = [1.0; 4];
        material.alpha_mode = store.alpha_mode(material.base_color_texture) as u32;
    }
    scene.images = store.images;
    scene.textures = store.textures;
    scene.warnings.extend(store.warnings);
    Ok(material)
}

/// Why reading stopped.
enum Problem {
    /// The body ends, or is no number, inside an element.
    Ends(String),
    /// The header promises more than follows.
    Promise(String),
    TooLarge(String),
}

impl Problem {
    fn into_error(self, path: &Path, location: String, options: &LoadOptions) -> ImportError {
        match self {
            Self::Ends(element) => {
                let reason = format!("the body breaks off or is broken in element '{element}'");
                ImportError::malformed(path, location, reason)
            }
            Self::Promise(reason) => ImportError::malformed(path, location, reason),
            Self::TooLarge(what) => ImportError::TooLarge {
                path: path.to_path_buf(),
                location,
                what,
                limit: format!("{} bytes", options.max_geometry_bytes),
            },
        }
    }
}

/// What is read of a file.
#[derive(Default)]
struct PlyMesh {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    colors: Vec<Vec4>,
    /// Vertices of all polygons, one after the other.
    corners: Vec<u32>,
    /// UVs of the same, if faces have them.
    corner_uvs: Vec<Vec2>,
    polygon_ends: Vec<u32>,
    /// Triangles of strips, which need no triangulation.
    strips: Vec<[u32; 3]>,
}

/// Bytes that a vertex comes to in memory, with all attributes, and a corner, with its triangle.
const BYTES_PER_VERTEX: u64 = 64;
const BYTES_PER_CORNER: u64 = 48;

impl PlyMesh {
    fn read(
        &mut self,
        element: &Element,
        header: &Header,
        reader: &mut Reader<'_>,
        options: &LoadOptions,
    ) -> Result<(), Problem> {
        let smallest = element.smallest_record(header.encoding);
        if smallest == 0 {
            return Ok(());
        }
        let (name, count, left) = (&element.name, element.count, reader.remaining());
        // The last record of a text needs no blank behind it.
        if count.checked_mul(smallest).is_none_or(|bytes| bytes > left.saturating_add(1)) {
            return Err(Problem::Promise(format!(
                "the header promises {count} records of '{name}', at least {smallest} bytes \
                 each, but {left} bytes follow; the file may be truncated"
            )));
        }
        let is_vertex = name == "vertex";
        let bytes = if is_vertex { count.saturating_mul(BYTES_PER_VERTEX) } else { 0 };
        if bytes > options.max_geometry_bytes || (is_vertex && count > u64::from(u32::MAX - 1)) {
            return Err(Problem::TooLarge(format!("{count} vertices")));
        }
        let ends = || Problem::Ends(name.clone());
        match name.as_str() {
            "vertex" => self.read_vertices(element, reader).ok_or_else(ends),
            "face" | "polygon" => self.read_faces(element, reader).ok_or_else(ends),
            "tristrips" | "trianglestrips" => self.read_strips(element, reader).ok_or_else(ends),
            _ => skip(element, reader).ok_or_else(ends),
        }?;
        if self.corners.len() as u64 * BYTES_PER_CORNER > options.max_geometry_bytes
            || self.corners.len() >= u32::MAX as usize
        {
            return Err(Problem::TooLarge(format!("{} corners of faces", self.corners.len())));
        }
        Ok(())
    }

    fn read_vertices(&mut self, element: &Element, reader: &mut Reader<'_>) -> Option<()> {
        let count = element.count as usize;
        // Where each property goes: the slot of one of the attributes below, or nowhere.
        const SLOTS: [&[&str]; 12] = [
            &["x"],
            &["y"],
            &["z"],
            &["nx", "normal_x"],
            &["ny", "normal_y"],
            &["nz", "normal_z"],
            &["u", "s", "texture_u", "tx", "u1"],
            &["v", "t", "texture_v", "ty", "v1"],
            &["red", "r", "diffuse_red"],
            &["green", "g", "diffuse_green"],
            &["blue", "b", "diffuse_blue"],
            &["alpha", "a", "diffuse_alpha"],
        ];
        let mut slot_of = vec![usize::MAX; element.properties.len()];
        let mut scale = [1.0_f32; 12];
        let mut has = [false; 12];
        let mut is_srgb = false;
        for (slot, names) in SLOTS.iter().enumerate() {
            let Some(at) = element.find(names) else { continue };
            let property = &element.properties[at];
            if property.list.is_some() {
                continue;
            }
            slot_of[at] = slot;
            has[slot] = true;
            if let Some(full) = property.scalar.full_scale().filter(|_| slot >= 8) {
                scale[slot] = 1.0 / full;
                is_srgb |= slot < 11;
            }
        }
        let has_normals = has[3] && has[4] && has[5];
        let has_uvs = has[6] && has[7];
        let has_colors = has[8] && has[9] && has[10];
        self.positions.reserve_exact(count);
        self.normals.reserve_exact(if has_normals { count } else { 0 });
        self.uvs.reserve_exact(if has_uvs { count } else { 0 });
        self.colors.reserve_exact(if has_colors { count } else { 0 });

        let mut values = [0.0_f32; 12];
        values[11] = 1.0 / scale[11];
        for _ in 0..count {
            for (property, &slot) in element.properties.iter().zip(&slot_of) {
                match property.list {
                    None => {
                        let value = reader.number(property.scalar)?;
                        if let Some(place) = values.get_mut(slot) {
                            *place = value as f32;
                        }
                    }
                    Some(length) => skip_list(reader, length, property.scalar)?,
                }
            }
            self.positions.push(Vec3::new(values[0], values[1], values[2]));
            if has_normals {
                self.normals.push(Vec3::new(values[3], values[4], values[5]));
            }
            if has_uvs {
                self.uvs.push(upright(values[6], values[7]));
            }
            if has_colors {
                let channel = |slot: usize| {
                    let value = values[slot] * scale[slot];
                    if value.is_finite() { value.clamp(0.0, 1.0) } else { 1.0 }
                };
                let color = Vec3::new(channel(8), channel(9), channel(10));
                let linear = if is_srgb { color.map(srgb_decode) } else { color };
                self.colors.push(linear.extend(channel(11)));
            }
        }
        Some(())
    }

    fn read_faces(&mut self, element: &Element, reader: &mut Reader<'_>) -> Option<()> {
        let is_list = |p: &header::Property| p.list.is_some();
        let indices = element.find(&["vertex_indices", "vertex_index"]);
        let texcoords = element.find(&["texcoord"]);
        let indices = indices.filter(|&at| is_list(&element.properties[at]));
        let texcoords = texcoords.filter(|&at| is_list(&element.properties[at]));
        self.polygon_ends.reserve_exact(element.count as usize);
        let mut coordinates: Vec<f32> = Vec::new();
        for _ in 0..element.count {
            let first = self.corners.len();
            coordinates.clear();
            for (at, property) in element.properties.iter().enumerate() {
                let Some(length) = property.list else {
                    reader.skip(property.scalar, 1)?;
                    continue;
                };
                if Some(at) == indices {
                    for _ in 0..reader.length(length, property.scalar)? {
                        self.corners.push(index(reader.number(property.scalar)?));
                    }
                } else if Some(at) == texcoords {
                    for _ in 0..reader.length(length, property.scalar)? {
                        coordinates.push(reader.number(property.scalar)? as f32);
                    }
                } else {
                    skip_list(reader, length, property.scalar)?;
                }
            }
            self.polygon_ends.push(self.corners.len() as u32);
            if texcoords.is_some() {
                let pairs = coordinates.chunks_exact(2).map(|uv| upright(uv[0], uv[1]));
                self.corner_uvs.extend(
                    pairs.chain(std::iter::repeat(Vec2::ZERO)).take(self.corners.len() - first),
                );
            }
        }
        Some(())
    }

    /// Strips end with −1; every other triangle is turned, so that all face the same way.
    fn read_strips(&mut self, element: &Element, reader: &mut Reader<'_>) -> Option<()> {
        let indices = element.find(&["vertex_indices", "vertex_index"]);
        for _ in 0..element.count {
            for (at, property) in element.properties.iter().enumerate() {
                match property.list {
                    None => reader.skip(property.scalar, 1)?,
                    Some(length) if Some(at) == indices => {
                        let (mut strip, mut held) = ([0_u32; 2], 0_usize);
                        for _ in 0..reader.length(length, property.scalar)? {
                            let next = reader.number(property.scalar)?;
                            if next < 0.0 {
                                held = 0;
                                continue;
                            }
                            let next = index(next);
                            if held >= 2 {
                                let [a, b] = strip;
                                let is_even = held.is_multiple_of(2);
                                self.strips.push(if is_even { [a, b, next] } else { [b, a, next] });
                            }
                            strip = [strip[1], next];
                            held += 1;
                        }
                    }
                    Some(length) => skip_list(reader, length, property.scalar)?,
                }
            }
        }
        Some(())
    }

    fn into_primitive(
        mut self,
        path: &Path,
        warnings: &mut Vec<String>,
    ) -> Result<Primitive, ImportError> {
        let mut indices = Vec::with_capacity(self.corners.len() / 3 + self.strips.len());
        let mut dropped = 0_u64;
        let is_sound =
            |corner: &u32| self.positions.get(*corner as usize).is_some_and(|p| p.is_finite());
        let mut triangulator = Triangulator::new();
        let mut welder = (!self.corner_uvs.is_empty()).then(Welder::new);
        let (mut polygon, mut numbers) = (Vec::new(), Vec::new());
        let mut first = 0;
        for &end in &self.polygon_ends {
            let range = first..end as usize;
            first = range.end;
            let corners = &self.corners[range.clone()];
            if corners.len() < 3 || !corners.iter().all(is_sound) {
                dropped += 1;
                continue;
            }
            numbers.clear();
            match &mut welder {
                None => numbers.extend_from_slice(corners),
                Some(welder) => numbers.extend(range.map(|at| {
                    let uv = self.corner_uvs[at];
                    welder.number_of([self.corners[at], uv.x.to_bits(), uv.y.to_bits()])
                })),
            }
            if let [a, b, c] = numbers[..] {
                indices.push([a, b, c]);
                continue;
            }
            polygon.clear();
            polygon.extend(corners.iter().map(|&c| self.positions[c as usize]));
            triangulator.triangulate(&polygon, |t| indices.push(t.map(|i| numbers[i as usize])));
        }
        for strip in &self.strips {
            // Strips turn corners by triangles without area; they are no loss.
            if !strip.iter().all(is_sound) {
                dropped += 1;
            } else if strip[0] != strip[1] && strip[1] != strip[2] && strip[0] != strip[2] {
                indices.push(match &mut welder {
                    None => *strip,
                    Some(welder) => strip.map(|i| welder.number_of([i, 0, 0])),
                });
            }
        }
        if indices.is_empty() {
            let reason = if dropped > 0 {
                format!("none of its {dropped} faces has vertices that exist and are finite")
            } else if self.positions.is_empty() {
                "it holds no vertices and faces".to_owned()
            } else {
                format!("it is a cloud of {} points; only meshes can be read", self.positions.len())
            };
            return Err(ImportError::malformed(path, "the file", reason));
        }
        if dropped > 0 {
            let what = "refer to vertices that are missing or not finite";
            warnings.push(format!("{dropped} faces are left out: they {what}"));
        }
        if let Some(welder) = welder {
            self.split_vertices(&welder);
        }
        // Vertices that no face uses may be anything; they must not spoil bounds.
        let stand_in = self.positions[indices[0][0] as usize];
        for position in self.positions.iter_mut().filter(|p| !p.is_finite()) {
            *position = stand_in;
        }
        self.uvs.iter_mut().filter(|uv| !uv.is_finite()).for_each(|uv| *uv = Vec2::ZERO);
        let has_directions = self.normals.iter().all(|n| n.is_finite() && *n != Vec3::ZERO);
        if self.normals.is_empty() || !has_directions {
            let smooth = normals::smooth_normals(&self.positions, &indices);
            self.normals.resize(smooth.len(), Vec3::ZERO);
            for (normal, smooth) in self.normals.iter_mut().zip(smooth) {
                *normal = normals::unit_or(*normal, smooth);
            }
        } else {
            self.normals.iter_mut().for_each(|n| *n = normals::unit_or(*n, Vec3::Y));
        }
        Ok(Primitive {
            positions: self.positions,
            indices,
            normals: Some(self.normals),
            uvs: if self.uvs.is_empty() { Vec::new() } else { vec![self.uvs] },
            colors: (!self.colors.is_empty()).then_some(self.colors),
            ..Primitive::default()
        })
    }

    /// One vertex for each combination of a vertex and a face's UV.
    fn split_vertices(&mut self, welder: &Welder) {
        let keys = welder.keys();
        let at = |key: &[u32; 3]| key[0] as usize;
        self.positions = keys.iter().map(|k| self.positions[at(k)]).collect();
        if !self.normals.is_empty() {
            self.normals = keys.iter().map(|k| self.normals[at(k)]).collect();
        }
        if !self.colors.is_empty() {
            self.colors = keys.iter().map(|k| self.colors[at(k)]).collect();
        }
        let uv = |k: &[u32; 3]| Vec2::new(f32::from_bits(k[1]), f32::from_bits(k[2]));
        self.uvs = keys.iter().map(uv).collect();
    }
}

/// A vertex number; what is none becomes one that no file can have.
#[inline]
fn index(value: f64) -> u32 {
    let is_index = value >= 0.0 && value < f64::from(u32::MAX) && value.fract() == 0.0;
    if is_index { value as u32 } else { u32::MAX }
}

/// UVs with v downwards, as images are stored; PLY's points up.
fn upright(u: f32, v: f32) -> Vec2 {
    Vec2::new(u, 1.0 - v)
}

fn skip(element: &Element, reader: &mut Reader<'_>) -> Option<()> {
    for _ in 0..element.count {
        for property in &element.properties {
            match property.list {
                None => reader.skip(property.scalar, 1)?,
                Some(length) => skip_list(reader, length, property.scalar)?,
            }
        }
    }
    Some(())
}

fn skip_list(reader: &mut Reader<'_>, length: Scalar, item: Scalar) -> Option<()> {
    let count = reader.length(length, item)?;
    reader.skip(item, count)
}
