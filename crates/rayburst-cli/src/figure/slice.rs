//! A two-dimensional world, traced as three-dimensional geometry.
//!
//! Outlines in the plane z = 0 are extruded along z to prisms and go through the same scene,
//! structure and surface code as any picture; rays that start in the plane with a direction in the
//! plane stay in it. What a diagram draws is what the tracer answered.

use std::f32::consts::TAU;

use rayburst::accel::{AcceptAll, BuildOptions, Tlas, TraceOptions};
use rayburst::glam::{Vec2, Vec3};
use rayburst::math::{Hit, Ray};
use rayburst::scene::{FlatScene, Flattener, Material, Pose, Primitive, Scene};

use super::canvas::{Canvas, Ink, Pen};
use crate::error::{CliError, Result};

/// Where the plane stands on the page: so many points a unit, and the page's place of the origin.
const UNIT: f32 = 72.0;

/// How a thing of the slice answers rays.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Substance {
    /// Lit by lights: sends shadow rays.
    pub(crate) diffuse: bool,
    /// Reflects: sends a reflection ray.
    pub(crate) mirror: bool,
    /// Transparent with this index of refraction: sends both.
    pub(crate) ior: Option<f32>,
    /// Shines with this radiance.
    pub(crate) emission: f32,
}

/// A thing: its outline counter-clockwise, and how it looks on the page.
struct Thing {
    outline: Vec<Vec2>,
    fill: Ink,
    edge: Ink,
    substance: Substance,
}

/// Things to trace and draw.
#[derive(Default)]
pub(crate) struct SliceBuilder {
    things: Vec<Thing>,
    scene: Scene,
}

/// What a ray of the plane met.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SliceHit {
    pub(crate) position: Vec2,
    /// Unit normal of the surface, out of the thing.
    pub(crate) normal: Vec2,
    pub(crate) substance: Substance,
    surface: rayburst::scene::Surface,
    pub(crate) raw: Hit,
}

/// The traced world.
pub(crate) struct Slice {
    things: Vec<Thing>,
    flat: FlatScene,
    page_height: f32,
}

impl SliceBuilder {
    /// A disk, smooth to rays.
    pub(crate) fn disk(&mut self, centre: Vec2, radius: f32, look: (Ink, Ink), is: Substance) {
        let corners = 720;
        let direction = |i: u32| Vec2::from_angle(TAU * i as f32 / corners as f32);
        let outline: Vec<Vec2> = (0..corners).map(|i| centre + radius * direction(i)).collect();
        let normals = (0..corners).map(direction).collect();
        self.thing(outline, Some(normals), look, is);
    }

    /// A polygon, corners counter-clockwise.
    pub(crate) fn polygon(&mut self, outline: &[Vec2], look: (Ink, Ink), is: Substance) {
        self.thing(outline.to_vec(), None, look, is);
    }

    /// An upright rectangle.
    pub(crate) fn rectangle(&mut self, low: Vec2, high: Vec2, look: (Ink, Ink), is: Substance) {
        let corners = [low, Vec2::new(high.x, low.y), high, Vec2::new(low.x, high.y)];
        self.polygon(&corners, look, is);
    }

    fn thing(
        &mut self,
        outline: Vec<Vec2>,
        normals: Option<Vec<Vec2>>,
        (fill, edge): (Ink, Ink),
        substance: Substance,
    ) {
        let material = self.scene.add_material("", Material::diffuse(Vec3::splat(0.5)));
        let n = outline.len() as u32;
        let both = |points: &[Vec2], z: [f32; 2]| {
            points.iter().flat_map(|p| z.map(|z| p.extend(z))).collect::<Vec<Vec3>>()
        };
        let indices = (0..n)
            .flat_map(|i| {
                let (a, b) = (2 * i, 2 * ((i + 1) % n));
                [[a, b, b + 1], [a, b + 1, a + 1]]
            })
            .collect();
        let primitive = Primitive {
            positions: both(&outline, [-1.0, 1.0]),
            indices,
            normals: normals.map(|n| both(&n, [0.0, 0.0])),
            material,
            ..Primitive::default()
        };
        self.scene.add_mesh("", vec![primitive]);
        self.things.push(Thing { outline, fill, edge, substance });
    }

    /// Builds the structure; the page is `page_height` points high.
    pub(crate) fn build(self, page_height: f32) -> Result<Slice> {
        let flat = Flattener::new(&self.scene, BuildOptions::default())
            .at(&Pose::rest(&self.scene))
            .map_err(|e| CliError::failed(e.to_string()))?;
        Ok(Slice { things: self.things, flat, page_height })
    }
}

impl Slice {
    /// The first thing that a ray of the plane meets.
    pub(crate) fn trace(&self, origin: Vec2, direction: Vec2) -> Option<SliceHit> {
        self.closest(&Ray::new(origin.extend(0.0), direction.extend(0.0)))
    }

    /// The first thing that a ray meets that leaves a surface.
    pub(crate) fn trace_from(&self, from: &SliceHit, direction: Vec2) -> Option<SliceHit> {
        self.closest(&self.leaving(from, direction))
    }

    /// What stands between a surface and a point, if anything.
    pub(crate) fn blocker(&self, from: &SliceHit, to: Vec2) -> Option<SliceHit> {
        let mut ray = self.leaving(from, to - from.position);
        ray.t_max = 1.0;
        self.closest(&ray)
    }

    /// A ray that leaves a surface and does not meet it again.
    pub(crate) fn leaving(&self, from: &SliceHit, direction: Vec2) -> Ray {
        Ray::new(from.surface.spawn(direction.extend(0.0)), direction.extend(0.0))
    }

    /// All hits of a ray in its interval, nearest first.
    pub(crate) fn hits(&self, ray: &Ray) -> Vec<Hit> {
        let mut hits = Vec::new();
        self.flat.tlas.all_hits(ray, &TraceOptions::default(), &AcceptAll, &mut hits);
        hits
    }

    /// The structure that is traced.
    pub(crate) fn structure(&self) -> &Tlas {
        &self.flat.tlas
    }

    fn closest(&self, ray: &Ray) -> Option<SliceHit> {
        let raw = self.flat.tlas.closest_hit(ray, &TraceOptions::default(), &AcceptAll);
        raw.is_hit().then(|| {
            let surface = self.flat.surface(&raw);
            let (_, geometry) = self.flat.records(&raw);
            SliceHit {
                position: surface.position.truncate(),
                normal: surface.shading_normal.truncate().normalize_or(Vec2::Y),
                substance: self.things[geometry.node as usize].substance,
                surface,
                raw,
            }
        })
    }

    /// The nearest hit by testing every triangle in 64-bit arithmetic: what `trace` must answer.
    pub(crate) fn brute_force_t(&self, ray: &Ray) -> Option<f64> {
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let mut nearest: Option<f64> = None;
        for (g, geometry) in self.flat.geometries.iter().enumerate() {
            for p in 0..geometry.primitive.indices.len() as u32 {
                let corners = self.flat.world_triangle(0, g as u32, p).points;
                let [a, b, c] = corners.map(|v| v.as_dvec3());
                let (e1, e2) = (b - a, c - a);
                let h = d.cross(e2);
                let det = e1.dot(h);
                if det == 0.0 {
                    continue;
                }
                let s = o - a;
                let (u, q) = (s.dot(h) / det, s.cross(e1));
                let (v, t) = (d.dot(q) / det, e2.dot(q) / det);
                let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
                if inside && t >= f64::from(ray.t_min) && t <= f64::from(ray.t_max) {
                    nearest = Some(nearest.map_or(t, |n| n.min(t)));
                }
            }
        }
        nearest
    }

    /// How many triangles there are.
    pub(crate) fn triangles(&self) -> usize {
        self.flat.geometries.iter().map(|g| g.primitive.indices.len()).sum()
    }

    /// A point of the plane on the page.
    pub(crate) fn page(&self, p: Vec2) -> Vec2 {
        Vec2::new(24.0 + UNIT * p.x, self.page_height - 44.0 - UNIT * p.y)
    }

    /// Draws the things.
    pub(crate) fn draw(&self, canvas: &mut Canvas) {
        for thing in &self.things {
            let outline: Vec<Vec2> = thing.outline.iter().map(|&p| self.page(p)).collect();
            canvas.polygon(&outline, thing.fill, Some(Pen::new(thing.edge, 1.2)));
        }
    }
}
