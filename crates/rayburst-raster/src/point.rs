//! What a pixel shows, in full.

use glam::{DAffine3, DVec3, Vec3};
use rayburst_math::{Hit, HitKind};

use crate::{Mesh, View, Visibility};

/// The point of a surface that a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisiblePoint {
    /// Depth along the view.
    pub depth: f32,
    /// What a ray through the pixel's centre meets; its direction is a unit vector.
    pub hit: Hit,
}

impl Visibility {
    /// What a pixel shows, given what was drawn; `None` if that is nothing, or the pixel is not of the picture.
    /// Computed when asked for, in `f64`, from the triangle's corners.
    pub fn point(&self, view: &View, meshes: &[Mesh<'_>], x: u32, y: u32) -> Option<VisiblePoint> {
        let (width, height) = self.depth.size();
        if x >= width || y >= height {
            return None;
        }
        let (number, primitive) = self.identify(self.triangles.get(x, y))?;
        let mesh = meshes.get(number)?;
        let corners = mesh.clusters.triangle(primitive)?;
        let m = &mesh.transform;
        let to_world = DAffine3::from_cols(
            Vec3::from(m.matrix3.x_axis).as_dvec3(),
            Vec3::from(m.matrix3.y_axis).as_dvec3(),
            Vec3::from(m.matrix3.z_axis).as_dvec3(),
            Vec3::from(m.translation).as_dvec3(),
        );
        let (mut eye, mut direction) = (view.eye.as_dvec3(), view.through(x, y));
        if !view.is_perspective() {
            (eye, direction) = (eye + direction, view.frame[2].as_dvec3());
        }
        let [a, b, c] = corners.map(|p| to_world.transform_point3(p.as_dvec3()) - eye);
        // Signed volumes: barycentric coordinates times the direction's share.
        let weights = [b.cross(c), c.cross(a), a.cross(b)].map(|n| n.dot(direction));
        let sum: f64 = weights.iter().sum();
        let det = a.dot(b.cross(c));
        let normal: DVec3 = (b - a).cross(c - a);
        let steps = if sum != 0.0 { det / sum } else { f64::INFINITY };
        let facing = normal.dot(direction) < 0.0;
        let front = facing != (to_world.matrix3.determinant() < 0.0);
        let kind = if front { HitKind::TRIANGLE_FRONT } else { HitKind::TRIANGLE_BACK };
        let hit = Hit {
            t: (steps * direction.length()) as f32,
            u: (weights[1] / sum) as f32,
            v: (weights[2] / sum) as f32,
            primitive,
            geometry: mesh.geometry,
            instance: mesh.instance,
            kind,
            reserved: 0,
        };
        Some(VisiblePoint { depth: self.depth.get(x, y), hit })
    }
}
