//! Footprints: the part of a surface that a pixel sees, which textures are averaged over, and how the
//! surface changes across it.

use glam::{Vec2, Vec3};
use rayburst_math::{Hit, Ray, RayDifferential, cone, curvature, differential};

use crate::{FlatScene, Surface};

/// What a ray covers of the surface that it meets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Footprint(Kind);

#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Kind {
    #[default]
    None,
    Cone(f32),
    Axes([Vec3; 2]),
}

impl Footprint {
    /// A point: textures are looked up at their finest level.
    pub const NONE: Self = Self(Kind::None);

    /// The section of a ray cone whose diameter at the surface, across the ray, is `width` world
    /// units; see [`rayburst_math::RayCone::width_at`].
    #[inline]
    pub const fn cone(width: f32) -> Self {
        Self(Kind::Cone(width))
    }

    /// A parallelogram in the surface's plane: what one pixel to the right and one down are on it,
    /// world units.
    #[inline]
    pub const fn axes(right: Vec3, down: Vec3) -> Self {
        Self(Kind::Axes([right, down]))
    }

    /// That of a ray differential after its transfer to the surface, see
    /// [`RayDifferential::transfer`].
    #[inline]
    pub fn differential(at_hit: &RayDifferential) -> Self {
        Self::axes(at_hit.origin_dx, at_hit.origin_dy)
    }

    /// That of an eye ray, by the rays through the pixels to the right and below, which meet the plane
    /// of the same triangle.
    #[inline]
    pub fn offset_rays(surface: &Surface, right: &Ray, below: &Ray) -> Self {
        let normal = surface.geometric_normal;
        Self(Kind::Axes(differential::offsets_on_plane(surface.position, normal, right, below)))
    }

    /// Two axes of full length in the surface's plane, world units; `wo` leads back along the ray.
    #[inline]
    pub fn on(&self, surface: &Surface, wo: Vec3) -> [Vec3; 2] {
        match self.0 {
            Kind::None => [Vec3::ZERO; 2],
            Kind::Cone(width) => cone::section(width, wo, surface.geometric_normal),
            Kind::Axes(axes) => axes,
        }
    }
}

impl Surface {
    /// How the weights of the triangle's second and third corner change by each of two steps in its
    /// plane.
    #[inline]
    pub fn barycentric_change(&self, steps: [Vec3; 2]) -> [Vec2; 2] {
        let [second, third] = curvature::barycentric_gradients(self.edges);
        steps.map(|step| Vec2::new(second.dot(step), third.dot(step)))
    }

    /// The change of a UV set by a change of the weights, see [`Surface::barycentric_change`].
    #[inline]
    pub fn uv_change(&self, set: usize, weights: Vec2) -> Vec2 {
        let [second, third] = self.uv_edges[set];
        weights.x * second + weights.y * third
    }

    /// Area of the triangle in a UV set divided by its area in the world.
    #[inline]
    pub fn uv_density(&self, set: usize) -> f32 {
        let area = self.edges[0].cross(self.edges[1]).length();
        let [second, third] = self.uv_edges[set];
        if area > 0.0 { second.perp_dot(third).abs() / area } else { 0.0 }
    }
}

/// Normals of a triangle's corners in the world, of unit length.
fn corner_normals(scene: &FlatScene, hit: &Hit) -> Option<[Vec3; 3]> {
    let (instance, geometry) = scene.records(hit);
    let normals = geometry.primitive.normals.as_ref()?;
    Some(geometry.primitive.indices[hit.primitive as usize].map(|i| {
        let n = geometry.normal_transform * normals[i as usize];
        let n = if instance.is_identity { n } else { instance.normal_to_world * n };
        n.normalize_or_zero()
    }))
}

impl FlatScene {
    /// The changes of one of a hit's UV sets by two changes of its barycentric coordinates; zero where
    /// the primitive has none.
    pub(crate) fn uv_steps(&self, hit: &Hit, set: u32, steps: [Vec2; 2]) -> [Vec2; 2] {
        let primitive = &self.records(hit).1.primitive;
        let Some(uvs) = primitive.uvs.get(set as usize).or(primitive.uvs.first()) else {
            return [Vec2::ZERO; 2];
        };
        let [a, b, c] = primitive.indices[hit.primitive as usize].map(|i| uvs[i as usize]);
        steps.map(|step| step.x * (b - a) + step.y * (c - a))
    }

    /// How the unit interpolated normal at a hit changes by each of two steps in the triangle's plane
    /// (Igehy: "Tracing Ray Differentials", SIGGRAPH 1999, section 3.3). It belongs to the surface's
    /// `shading_normal`; zero where the mesh has no normals.
    pub fn normal_change(&self, hit: &Hit, surface: &Surface, steps: [Vec3; 2]) -> [Vec3; 2] {
        let Some([a, b, c]) = corner_normals(self, hit) else { return [Vec3::ZERO; 2] };
        let normal = (1.0 - hit.u - hit.v) * a + hit.u * b + hit.v * c;
        let sign = if normal.dot(surface.shading_normal) < 0.0 { -1.0 } else { 1.0 };
        surface.barycentric_change(steps).map(|weights| {
            let change = weights.x * (b - a) + weights.y * (c - a);
            sign * differential::of_normalized(normal, change)
        })
    }

    /// Mean curvature of the interpolated normals of the triangle that was hit, per world unit:
    /// positive where its front bulges; 0 where the mesh has no normals.
    pub fn mean_curvature(&self, hit: &Hit, surface: &Surface) -> f32 {
        let Some([a, b, c]) = corner_normals(self, hit) else { return 0.0 };
        let bend = curvature::of_triangle(surface.edges, [b - a, c - a]);
        let outwards = (a + b + c).dot(surface.shading_normal) >= 0.0;
        if outwards { bend } else { -bend }
    }
}

#[cfg(test)]
mod tests {
    use rayburst_accel::{AcceptAll, BuildOptions, TraceOptions};
    use rayburst_math::hash::Rng;

    use super::*;
    use crate::{Camera, Flattener, LocalTransform, Material, Pose, Scene, shapes};

    /// A smooth sphere of radius 2 by way of a node's transform, which may mirror.
    fn sphere(scale: Vec3) -> FlatScene {
        let mut scene = Scene::default();
        let white = scene.add_material("white", Material::diffuse(Vec3::ONE));
        let ball = shapes::sphere(Vec3::ZERO, 1.0, 4).into_primitive(white);
        let node = scene.add_mesh("ball", vec![ball]) as usize;
        let matrix = glam::Affine3A::from_scale(scale);
        scene.nodes[node].local = LocalTransform::Matrix(matrix);
        Flattener::new(&scene, BuildOptions::default()).at(&Pose::rest(&scene)).unwrap()
    }

    #[test]
    fn spheres_bend_their_normals_evenly() {
        for scale in [Vec3::splat(2.0), Vec3::new(-2.0, 2.0, 2.0)] {
            let scene = sphere(scale);
            let mut rng = Rng::new(4);
            for _ in 0..200 {
                let from = 5.0 * rayburst_math::warp::uniform_sphere(rng.vec2());
                // From outside and from inside.
                let outside = rng.f32() < 0.5;
                let origin = if outside { from } else { 0.1 * from };
                let ray =
                    Ray::new(origin, if outside { 0.2 * (rng.vec3() - 0.5) - from } else { from });
                let hit = scene.tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
                assert!(hit.is_hit());
                let surface = scene.surface(&hit);
                let bulge =
                    if surface.shading_normal.dot(surface.position) > 0.0 { 0.5 } else { -0.5 };
                let curvature = scene.mean_curvature(&hit, &surface);
                assert!((curvature - bulge).abs() < 0.05, "{curvature}");
                let steps =
                    cone::section(0.01, -ray.direction.normalize(), surface.geometric_normal);
                let changes = scene.normal_change(&hit, &surface, steps);
                for (step, change) in steps.into_iter().zip(changes) {
                    assert!((change - bulge * step).length() < 0.1 * step.length() * 0.5 + 1e-5);
                }
            }
        }
    }

    #[test]
    fn offset_rays_have_the_cameras_differential_at_the_first_hit() {
        let scene = sphere(Vec3::splat(2.0));
        let camera = Camera::look_at(Vec3::new(3.0, 2.0, 5.0), Vec3::ZERO, Vec3::Y, 0.8);
        let size = (64, 48);
        let mut compared = 0;
        for i in 0..300 {
            let pixel = Vec2::new((i * 7 % 64) as f32 + 0.5, (i * 5 % 48) as f32 + 0.5);
            let at = |offset: Vec2| camera.ray(pixel + offset, size, Vec2::splat(0.5)).0;
            let ray = at(Vec2::ZERO);
            let hit = scene.tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
            let surface = match hit.is_hit() {
                true => scene.surface(&hit),
                false => continue,
            };
            if surface.geometric_normal.dot(-ray.direction) < 0.3 {
                continue;
            }
            let two = Footprint::offset_rays(&surface, &at(Vec2::X), &at(Vec2::Y));
            let differential = camera.ray_differential(pixel, size, Vec2::splat(0.5));
            let one = Footprint::differential(&differential.transfer(
                ray.direction,
                hit.t,
                surface.geometric_normal,
            ));
            for (a, b) in two.on(&surface, Vec3::Y).into_iter().zip(one.on(&surface, Vec3::Y)) {
                assert!((a - b).length() < 0.1 * b.length(), "{a} {b}");
            }
            compared += 1;
        }
        assert!(compared > 20, "{compared}");
    }
}
