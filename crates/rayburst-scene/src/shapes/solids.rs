//! Smooth solids: spheres, hemispheres and surfaces of revolution, with exact normals.

use std::collections::HashMap;

use glam::{Vec2, Vec3};

use super::{Shape, trig};

/// A sphere: an icosahedron whose triangles are split in four `levels` times, 20·4ᴸ triangles of
/// nearly equal size, the vertices on the sphere.
pub fn sphere(center: Vec3, radius: f32, levels: u32) -> Shape {
    let golden = f32::midpoint(1.0, 5.0f32.sqrt());
    let mut normals = Vec::new();
    // The corners of three golden rectangles.
    for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        normals.push(Vec3::new(a, b, 0.0).normalize());
        normals.push(Vec3::new(0.0, a, b).normalize());
        normals.push(Vec3::new(b, 0.0, a).normalize());
    }
    let mut indices = icosahedron_faces(&normals);
    for _ in 0..levels {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::with_capacity(indices.len() * 3 / 2);
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                normals.push((normals[a as usize] + normals[b as usize]).normalize());
                normals.len() as u32 - 1
            })
        };
        let mut finer = Vec::with_capacity(indices.len() * 4);
        for [a, b, c] in indices {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        indices = finer;
    }
    let positions = normals.iter().map(|&n| center + n * radius).collect();
    Shape { positions, normals, uvs: Vec::new(), indices }
}

/// The faces of an icosahedron: triples of vertices at the edge's distance, wound outwards.
fn icosahedron_faces(corners: &[Vec3]) -> Vec<[u32; 3]> {
    let near = |a: usize, b: usize| corners[a].dot(corners[b]) > 0.4;
    let mut faces = Vec::with_capacity(20);
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let outward =
                        (corners[b] - corners[a]).cross(corners[c] - corners[a]).dot(corners[a])
                            > 0.0;
                    let [b, c] = if outward { [b, c] } else { [c, b] };
                    faces.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    faces
}

/// The upper half of a sphere, closed by a disk at its base.
pub fn hemisphere(center: Vec3, radius: f32, segments: u32) -> Shape {
    let rings = (segments / 4).max(2);
    let mut profile = vec![ProfilePoint::new(0.0, 1.0, Vec2::new(0.0, 1.0))];
    for i in 1..=rings {
        let (sin, cos) = trig::turn(i, 4 * rings);
        profile.push(ProfilePoint::new(sin, cos, Vec2::new(sin, cos)));
    }
    profile.push(ProfilePoint::new(1.0, 0.0, Vec2::new(0.0, -1.0)));
    profile.push(ProfilePoint::new(0.0, 0.0, Vec2::new(0.0, -1.0)));
    for p in &mut profile {
        // The equator lies exactly in the base's plane.
        if p.radius == 1.0 {
            p.height = 0.0;
        }
        p.radius *= radius;
        p.height *= radius;
    }
    lathe(&profile, segments).moved(center)
}

/// A point of the profile of a surface of revolution around +Y.
#[derive(Clone, Copy, Debug)]
pub struct ProfilePoint {
    /// Distance from the axis.
    pub radius: f32,
    /// Height.
    pub height: f32,
    /// The normal in the plane of the profile: away from the axis, up.
    pub normal: Vec2,
}

impl ProfilePoint {
    /// A point with its normal, which need not be of unit length.
    pub fn new(radius: f32, height: f32, normal: Vec2) -> Self {
        Self { radius, height, normal: normal.normalize() }
    }
}

/// The surface that a profile sweeps around +Y. The profile runs from the top to the bottom with
/// the outside on its outer side; a repeated point with another normal makes a crease, a radius of
/// zero a pole.
pub fn lathe(profile: &[ProfilePoint], segments: u32) -> Shape {
    let mut shape = Shape::default();
    let mut previous: Option<(u32, ProfilePoint)> = None;
    for &point in profile {
        let first = shape.positions.len() as u32;
        for i in 0..segments {
            let (sin, cos) = trig::turn(i, segments);
            let around = Vec3::new(cos, 0.0, -sin);
            shape.positions.push(around * point.radius + Vec3::Y * point.height);
            shape.normals.push((around * point.normal.x + Vec3::Y * point.normal.y).normalize());
        }
        if let Some((above, last)) = previous
            && (last.radius, last.height) != (point.radius, point.height)
        {
            for i in 0..segments {
                let j = (i + 1) % segments;
                if point.radius > 0.0 {
                    shape.indices.push([above + i, first + i, first + j]);
                }
                if last.radius > 0.0 {
                    shape.indices.push([above + i, first + j, above + j]);
                }
            }
        }
        previous = Some((first, point));
    }
    shape
}
