//! Meshes (glTF 2.0, section 3.7): triangles of lists, strips and fans with their attributes.

use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};

use super::{
    accessor::Accessor, json, material::Materials, source::Source, vertex_skin, warnings::Warnings,
};
use crate::{Mesh, MorphTarget, Primitive, import::ImportError, tangents};

/// Reads meshes one by one, remembering which materials they use.
pub(super) struct MeshReader<'s> {
    pub(super) source: &'s Source<'s>,
    pub(super) materials: &'s Materials,
    pub(super) material_used: Vec<bool>,
}

/// How vertices make triangles.
#[derive(Clone, Copy, PartialEq)]
enum Topology {
    List,
    Strip,
    Fan,
}

impl MeshReader<'_> {
    /// Reads a mesh; primitives without triangles are left out.
    pub(super) fn read(
        &mut self,
        index: usize,
        warnings: &mut Warnings,
    ) -> Result<Mesh, ImportError> {
        let Some(json) = self.source.root.meshes.get(index) else {
            return Err(self.source.malformed(format!("/meshes/{index}"), "there is no such mesh"));
        };
        let mut primitives = Vec::with_capacity(json.primitives.len());
        let mut target_count = None;
        for (number, primitive) in json.primitives.iter().enumerate() {
            let location = format!("/meshes/{index}/primitives/{number}");
            if let Some(primitive) = self.primitive(primitive, &location, warnings)? {
                if *target_count.get_or_insert(primitive.targets.len()) != primitive.targets.len() {
                    warnings.add("primitives of a mesh differ in morph targets", location, 1);
                }
                primitives.push(Arc::new(primitive));
            }
        }
        let targets = primitives.iter().map(|p| p.targets.len()).max().unwrap_or(0);
        let mut weights: Vec<f32> =
            json.weights.iter().map(|&w| if w.is_finite() { w } else { 0.0 }).collect();
        weights.resize(targets, 0.0);
        Ok(Mesh { name: json.name.clone(), primitives, weights })
    }

    fn primitive(
        &mut self,
        json: &json::Primitive,
        location: &str,
        warnings: &mut Warnings,
    ) -> Result<Option<Primitive>, ImportError> {
        let source = self.source;
        let topology = match json.mode.unwrap_or(4) {
            0 => {
                warnings.add("points are not drawn", location, 1);
                return Ok(None);
            }
            1..=3 => {
                warnings.add("lines are not drawn", location, 1);
                return Ok(None);
            }
            4 => Topology::List,
            5 => Topology::Strip,
            6 => Topology::Fan,
            mode => return Err(source.malformed(location, format!("unknown mode {mode}"))),
        };
        let Some(&position) = json.attributes.get("POSITION") else {
            warnings.add("a primitive without positions", location, 1);
            return Ok(None);
        };
        let position = Accessor::new(source, position, &["VEC3"])?;
        let (mut triangles, leftover) = self.triangles(json, topology, position.count, location)?;
        if leftover > 0 {
            warnings.add("vertices that do not make whole triangles", location, 1);
        }
        if triangles.is_empty() {
            warnings.add("a primitive without triangles", location, 1);
            return Ok(None);
        }
        let material = match json.material {
            None => self.materials.default_index(),
            Some(m) if m < self.materials.default_index() => m,
            Some(m) => return Err(source.malformed(location, format!("there is no material {m}"))),
        };
        self.material_used[material] = true;

        let pick = keep_used_vertices(&mut triangles, position.count);
        let attributes = Attributes { source, json, location, pick, count: position.count };
        let positions = attributes.read::<3>(&position)?;
        let mut primitive = Primitive {
            normals: attributes.vectors("NORMAL", |n| Vec3::from(n).normalize_or_zero())?,
            tangents: attributes.vectors("TANGENT", unit_tangent)?,
            uvs: attributes.uvs(&self.materials.uv_sets[material])?,
            colors: attributes.colors()?,
            skin: vertex_skin::read(&attributes, positions.len(), warnings)?,
            targets: attributes.targets(warnings)?,
            indices: triangles,
            material: material as u32,
            positions: positions.into_iter().map(Vec3::from).collect(),
        };
        let wild = primitive.positions.iter().filter(|p| !p.is_finite()).count();
        if wild > 0 {
            let what = "positions are not finite; their triangles are not drawn";
            warnings.add(what, location, wild as u64);
        }
        if primitive.normals.is_none() {
            // Without normals the surface is flat, and authored tangents have no meaning (3.7.2.1).
            primitive.tangents = None;
        }
        let normal_map = self.materials.records[material].normal_texture;
        if primitive.tangents.is_none() && normal_map.index().is_some() && !primitive.uvs.is_empty()
        {
            // Splitting vertices at seams makes at most one a corner.
            let corners = primitive.indices.len() as u64 * 3;
            source.charge(corners * 64, || location.to_owned())?;
            tangents::generate(&mut primitive, &normal_map);
        }
        Ok(Some(primitive))
    }

    /// Triangles with indices in range, and the number of vertices left over.
    fn triangles(
        &self,
        json: &json::Primitive,
        topology: Topology,
        vertices: usize,
        location: &str,
    ) -> Result<(Vec<[u32; 3]>, usize), ImportError> {
        let source = self.source;
        let Some(index) = json.indices else {
            source.charge(vertices as u64 * 12, || location.to_owned())?;
            return Ok(assemble(topology, vertices, |i| i as u32));
        };
        let accessor = Accessor::new(source, index, &["SCALAR"])?;
        let indices = accessor.integers::<1>(source, None)?;
        if let Some(at) = indices.iter().position(|i| i[0] as usize >= vertices) {
            let reason = format!(
                "index {} at position {at} is out of range, there are {vertices} vertices",
                indices[at][0]
            );
            return Err(source.malformed(format!("/accessors/{index}"), reason));
        }
        source.charge(indices.len() as u64 * 12, || location.to_owned())?;
        Ok(assemble(topology, indices.len(), |i| indices[i][0]))
    }
}

/// Triangles of `count` vertices (section 3.7.2.1), and the number of vertices left over.
fn assemble(
    topology: Topology,
    count: usize,
    index: impl Fn(usize) -> u32,
) -> (Vec<[u32; 3]>, usize) {
    let corners = |[a, b, c]: [usize; 3]| [index(a), index(b), index(c)];
    match topology {
        Topology::List => {
            ((0..count / 3).map(|t| corners([3 * t, 3 * t + 1, 3 * t + 2])).collect(), count % 3)
        }
        Topology::Strip | Topology::Fan => {
            let number = count.saturating_sub(2);
            let triangles = (0..number).map(|t| match topology {
                Topology::Fan => corners([t + 1, t + 2, 0]),
                _ if t % 2 == 0 => corners([t, t + 1, t + 2]),
                _ => corners([t, t + 2, t + 1]),
            });
            (triangles.collect(), if number == 0 { count } else { 0 })
        }
    }
}

/// Many primitives may share one large vertex buffer: where a primitive uses a part of it, the
/// vertices it uses, with `triangles` renumbered.
fn keep_used_vertices(triangles: &mut [[u32; 3]], vertices: usize) -> Option<Vec<u32>> {
    if triangles.len() * 3 >= vertices.saturating_mul(2) {
        return None;
    }
    let mut used: Vec<u32> = triangles.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    if used.len() * 4 > vertices * 3 {
        return None;
    }
    for corner in triangles.as_flattened_mut() {
        // Every corner is in the list that was made of them.
        *corner = used.partition_point(|&vertex| vertex < *corner) as u32;
    }
    Some(used)
}

/// The attributes of one primitive.
pub(super) struct Attributes<'s> {
    pub(super) source: &'s Source<'s>,
    json: &'s json::Primitive,
    location: &'s str,
    pick: Option<Vec<u32>>,
    /// Vertices in the file.
    count: usize,
}

impl<'s> Attributes<'s> {
    /// An attribute's accessor, if the primitive has the attribute.
    pub(super) fn accessor(
        &self,
        name: &str,
        kinds: &[&str],
    ) -> Result<Option<Accessor<'s>>, ImportError> {
        self.json.attributes.get(name).map(|&index| self.check(name, index, kinds)).transpose()
    }

    fn check(&self, name: &str, index: usize, kinds: &[&str]) -> Result<Accessor<'s>, ImportError> {
        let accessor = Accessor::new(self.source, index, kinds)?;
        if accessor.count < self.count {
            let (found, needed) = (accessor.count, self.count);
            let reason = format!("{name:.40} has {found} elements for {needed} vertices");
            return Err(self.source.malformed(self.location, reason));
        }
        Ok(accessor)
    }

    fn read<const N: usize>(&self, accessor: &Accessor<'_>) -> Result<Vec<[f32; N]>, ImportError> {
        let mut elements = accessor.floats(self.source, self.pick.as_deref())?;
        elements.truncate(self.len());
        Ok(elements)
    }

    /// Elements of a four-component attribute.
    pub(super) fn read4(&self, accessor: &Accessor<'_>) -> Result<Vec<[f32; 4]>, ImportError> {
        self.read(accessor)
    }

    /// Elements of a four-component attribute of integers.
    pub(super) fn integers4(&self, accessor: &Accessor<'_>) -> Result<Vec<[u32; 4]>, ImportError> {
        let mut elements = accessor.integers(self.source, self.pick.as_deref())?;
        elements.truncate(self.len());
        Ok(elements)
    }

    /// Whether the primitive has an attribute.
    pub(super) fn has(&self, name: &str) -> bool {
        self.json.attributes.contains_key(name)
    }

    /// Where the primitive is in the file.
    pub(super) fn location(&self) -> &str {
        self.location
    }

    /// Vertices that are kept.
    fn len(&self) -> usize {
        self.pick.as_ref().map_or(self.count, Vec::len)
    }

    fn vectors<const N: usize, T>(
        &self,
        name: &str,
        convert: impl Fn([f32; N]) -> T,
    ) -> Result<Option<Vec<T>>, ImportError> {
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let Some(accessor) = self.accessor(name, &[kind])? else { return Ok(None) };
        Ok(Some(self.read::<N>(&accessor)?.into_iter().map(convert).collect()))
    }

    fn uvs(&self, sets: &[u32]) -> Result<Vec<Vec<Vec2>>, ImportError> {
        let name = |set: &u32| format!("TEXCOORD_{set}");
        let last = sets.iter().rposition(|set| self.has(&name(set)));
        let mut uvs = Vec::new();
        for set in &sets[..last.map_or(0, |last| last + 1)] {
            let read = self.vectors(&name(set), |uv| finite2(Vec2::from(uv)))?;
            uvs.push(read.unwrap_or_else(|| vec![Vec2::ZERO; self.len()]));
        }
        Ok(uvs)
    }

    fn colors(&self) -> Result<Option<Vec<Vec4>>, ImportError> {
        let clean = |c: Vec4| if c.is_finite() { c.max(Vec4::ZERO) } else { Vec4::ONE };
        let Some(accessor) = self.accessor("COLOR_0", &["VEC3", "VEC4"])? else {
            return Ok(None);
        };
        Ok(Some(if accessor.width() == 3 {
            let colors = self.read::<3>(&accessor)?;
            colors.into_iter().map(|c| clean(Vec3::from(c).extend(1.0))).collect()
        } else {
            self.read::<4>(&accessor)?.into_iter().map(|c| clean(Vec4::from(c))).collect()
        }))
    }

    fn targets(&self, warnings: &mut Warnings) -> Result<Vec<MorphTarget>, ImportError> {
        let mut targets = Vec::with_capacity(self.json.targets.len());
        for json in &self.json.targets {
            let read = |name: &str| -> Result<Option<Vec<Vec3>>, ImportError> {
                let Some(&index) = json.get(name) else { return Ok(None) };
                let accessor = self.check(name, index, &["VEC3"])?;
                let elements = self.read::<3>(&accessor)?;
                Ok(Some(elements.into_iter().map(|d| finite3(Vec3::from(d))).collect()))
            };
            targets.push(MorphTarget {
                positions: read("POSITION")?,
                normals: read("NORMAL")?,
                tangents: read("TANGENT")?,
            });
            if json.keys().any(|name| name.starts_with("TEXCOORD") || name.starts_with("COLOR")) {
                warnings.add("morph targets of UVs and colours are ignored", self.location, 1);
            }
        }
        Ok(targets)
    }
}

fn unit_tangent(t: [f32; 4]) -> Vec4 {
    let handedness = if t[3] < 0.0 { -1.0 } else { 1.0 };
    Vec3::new(t[0], t[1], t[2]).normalize_or_zero().extend(handedness)
}

fn finite2(v: Vec2) -> Vec2 {
    if v.is_finite() { v } else { Vec2::ZERO }
}

fn finite3(v: Vec3) -> Vec3 {
    if v.is_finite() { v } else { Vec3::ZERO }
}
