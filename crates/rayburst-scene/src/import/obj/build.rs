//! Primitives from the flat arrays of an OBJ file: one for each material of each object.
//!
//! Faces without normals are smooth inside their smoothing group and flat in group 0, as the format
//! defines it. Colours after positions are sRGB, as the tools write them that do.

use std::collections::HashMap;

use glam::{Vec2, Vec3, Vec4};
use rayburst_image::colour::srgb_decode;

use super::parse::{Corner, NONE, ObjFile, Run};
use crate::{
    Primitive,
    import::{triangulate::Triangulator, weld::Welder},
    normals::{corner_angle, unit_or},
};

/// More objects than this become one, so that a mesh a face cannot exhaust the memory.
const MAX_OBJECTS: usize = 4096;

/// The primitives of one object.
#[derive(Debug)]
pub(super) struct ObjObject {
    pub(super) name: String,
    /// With the index in the file's material names, or [`NONE`], in `material`.
    pub(super) primitives: Vec<Primitive>,
}

/// Objects in the order of their first face, and the number of faces left out because they refer to
/// missing or broken vertices.
pub(super) fn build(mut file: ObjFile, name: &str) -> (Vec<ObjObject>, u64) {
    for normal in &mut file.normals {
        *normal = unit_or(*normal, Vec3::ZERO);
    }
    let split = file.object_names.len() <= MAX_OBJECTS;
    let mut groups: Vec<(u32, u32, Vec<usize>)> = Vec::new();
    let mut group_of = HashMap::new();
    for (index, run) in file.runs.iter().enumerate() {
        let object = if split { run.object } else { NONE };
        let group = *group_of.entry((object, run.material)).or_insert_with(|| {
            groups.push((object, run.material, Vec::new()));
            groups.len() - 1
        });
        groups[group].2.push(index);
    }

    let smooth = SmoothNormals::of(&mut file);
    let triangulator = Triangulator::new();
    let mut builder = Builder { file: &mut file, smooth, triangulator, dropped: 0 };
    let mut objects: Vec<(u32, ObjObject)> = Vec::new();
    let mut object_of = HashMap::new();
    for (object, material, runs) in groups {
        let Some(primitive) = builder.primitive(material, &runs) else { continue };
        let at = *object_of.entry(object).or_insert_with(|| {
            let own = builder.file.object_names.get(object as usize).filter(|n| !n.is_empty());
            let name = own.map_or(name, String::as_str).to_owned();
            objects.push((object, ObjObject { name, primitives: Vec::new() }));
            objects.len() - 1
        });
        objects[at].1.primitives.push(primitive);
    }
    let dropped = builder.dropped;
    (objects.into_iter().map(|(_, object)| object).collect(), dropped)
}

/// Normals of faces that have none, by position and smoothing group; appended to the file's.
struct SmoothNormals {
    numbers: Welder,
    /// Number of the first one among the file's normals.
    first: u32,
}

impl SmoothNormals {
    fn of(file: &mut ObjFile) -> Self {
        let mut numbers = Welder::new();
        let mut sums: Vec<Vec3> = Vec::new();
        for run in 0..file.runs.len() {
            let (Run { smoothing, .. }, faces) = faces_of(file, run);
            if smoothing == 0 {
                continue;
            }
            for face in faces {
                let corners = corners_of(file, face);
                let lacks = |c: &Corner| file.normal(c[2]).is_none();
                if !file.is_sound(corners) || !corners.iter().any(lacks) {
                    continue;
                }
                let normal = file.newell_normal(corners);
                let n = corners.len();
                for i in 0..n {
                    let at = |i: usize| file.positions[corners[i % n][0] as usize];
                    let number = numbers.number_of([corners[i][0], smoothing, 0]) as usize;
                    if number == sums.len() {
                        sums.push(Vec3::ZERO);
                    }
                    let angle = corner_angle(at(i + n - 1) - at(i), at(i + 1) - at(i));
                    if angle.is_finite() {
                        sums[number] += normal * angle;
                    }
                }
            }
        }
        let first = file.normals.len() as u32;
        file.normals.extend(sums.into_iter().map(|sum| unit_or(sum, Vec3::Y)));
        Self { numbers, first }
    }

    fn number_of(&mut self, position: u32, smoothing: u32) -> u32 {
        self.first + self.numbers.number_of([position, smoothing, 0])
    }
}

struct Builder<'a> {
    file: &'a mut ObjFile,
    smooth: SmoothNormals,
    triangulator: Triangulator,
    dropped: u64,
}

impl Builder<'_> {
    fn primitive(&mut self, material: u32, runs: &[usize]) -> Option<Primitive> {
        let has_normals = runs.iter().any(|&run| self.has_normals(run));
        let mut welder = Welder::new();
        let mut indices = Vec::new();
        let (mut polygon, mut numbers) = (Vec::new(), Vec::new());
        for &run in runs {
            let (state, faces) = faces_of(self.file, run);
            for face in faces {
                if !self.file.is_sound(corners_of(self.file, face)) {
                    self.dropped += 1;
                    continue;
                }
                polygon.clear();
                numbers.clear();
                let mut flat_normal = NONE;
                let corners = corner_range(self.file, face);
                for at in corners.clone() {
                    let [position, uv, normal] = self.file.corners[at];
                    let uv = if (uv as usize) < self.file.uvs.len() { uv } else { NONE };
                    let normal = if !has_normals {
                        NONE
                    } else if self.file.normal(normal).is_some() {
                        normal
                    } else if state.smoothing != 0 {
                        self.smooth.number_of(position, state.smoothing)
                    } else {
                        if flat_normal == NONE {
                            let corners = &self.file.corners[corners.clone()];
                            let normal = unit_or(self.file.newell_normal(corners), Vec3::Y);
                            flat_normal = self.file.normals.len() as u32;
                            self.file.normals.push(normal);
                        }
                        flat_normal
                    };
                    polygon.push(self.file.positions[position as usize]);
                    numbers.push(welder.number_of([position, uv, normal]));
                }
                self.triangulator.triangulate(&polygon, |triangle| {
                    indices.push(triangle.map(|i| numbers[i as usize]));
                });
            }
        }
        if indices.is_empty() {
            return None;
        }
        Some(self.gather(&welder, indices, material))
    }

    /// Whether any face of a run has normals or a smoothing group that gives it some.
    fn has_normals(&self, run: usize) -> bool {
        let (state, mut faces) = faces_of(self.file, run);
        state.smoothing != 0
            || faces.any(|face| {
                corners_of(self.file, face).iter().any(|c| self.file.normal(c[2]).is_some())
            })
    }

    fn gather(&self, welder: &Welder, indices: Vec<[u32; 3]>, material: u32) -> Primitive {
        let file = &*self.file;
        let keys = welder.keys();
        let uvs = keys.iter().any(|k| k[1] != NONE).then(|| {
            let uv = |number: u32| file.uvs.get(number as usize).filter(|uv| uv.is_finite());
            let flipped = |uv: Vec2| Vec2::new(uv.x, 1.0 - uv.y);
            keys.iter().map(|k| uv(k[1]).map_or(Vec2::ZERO, |&uv| flipped(uv))).collect()
        });
        let normals = keys
            .iter()
            .any(|k| k[2] != NONE)
            .then(|| keys.iter().map(|k| file.normals[k[2] as usize]).collect());
        let linear = |c: Vec3| -> Vec4 {
            let channel = |x: f32| if x.is_finite() { srgb_decode(x.clamp(0.0, 1.0)) } else { 1.0 };
            Vec4::new(channel(c.x), channel(c.y), channel(c.z), 1.0)
        };
        let colors = (!file.colors.is_empty())
            .then(|| keys.iter().map(|k| linear(file.colors[k[0] as usize])).collect());
        Primitive {
            positions: keys.iter().map(|k| file.positions[k[0] as usize]).collect(),
            indices,
            normals,
            uvs: uvs.into_iter().collect(),
            colors,
            material,
            ..Primitive::default()
        }
    }
}

impl ObjFile {
    /// A normal that exists and has a direction.
    fn normal(&self, number: u32) -> Option<Vec3> {
        self.normals.get(number as usize).copied().filter(|&n| n != Vec3::ZERO)
    }

    /// Whether all positions exist and are finite.
    fn is_sound(&self, corners: &[Corner]) -> bool {
        corners.iter().all(|c| self.positions.get(c[0] as usize).is_some_and(|p| p.is_finite()))
    }

    /// Newell's normal of a face: its length is twice the area.
    fn newell_normal(&self, corners: &[Corner]) -> Vec3 {
        let at = |i: usize| self.positions[corners[i % corners.len()][0] as usize];
        let origin = at(0);
        let mut sum = Vec3::ZERO;
        for i in 1..corners.len() - 1 {
            sum += (at(i) - origin).cross(at(i + 1) - origin);
        }
        if sum.is_finite() { sum } else { Vec3::ZERO }
    }
}

fn faces_of(file: &ObjFile, run: usize) -> (Run, std::ops::Range<usize>) {
    let end = file.runs.get(run + 1).map_or(file.face_ends.len(), |r| r.first_face as usize);
    (file.runs[run], file.runs[run].first_face as usize..end)
}

fn corner_range(file: &ObjFile, face: usize) -> std::ops::Range<usize> {
    let start = if face == 0 { 0 } else { file.face_ends[face - 1] as usize };
    start..file.face_ends[face] as usize
}

fn corners_of(file: &ObjFile, face: usize) -> &[Corner] {
    &file.corners[corner_range(file, face)]
}
