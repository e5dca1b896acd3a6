//! How a ray cone opens where a path turns: by the width of the scattering lobe, and by the curvature
//! of mirrors.
//!
//! Akenine-Möller, Crassin, Boksansky, Belcour, Panteleev, Wright: "Improved Shader and Texture Level
//! of Detail Using Ray Cones", JCGT 2021, section 3: a cone of width w on a surface of curvature κ is
//! reflected into one that opens by 2κw more. We take κ from the triangle's vertex normals, the mean
//! over its edges of (Δn·Δp)/|Δp|²; it is positive where the surface bulges.

use rayburst_math::{Hit, RayCone};
use rayburst_scene::{BsdfSample, FlatScene};

/// Lobes narrower than this show the curvature; wider ones hide it.
const NARROW: f32 = 0.2;

/// The cone of the ray that leaves a hit, given the cone of the ray that came.
#[inline]
pub(crate) fn scattered(
    scene: &FlatScene,
    hit: &Hit,
    cone: RayCone,
    spread: f32,
    transmitted: bool,
) -> RayCone {
    let mut extra = spread;
    if spread < NARROW && !transmitted {
        extra += 2.0 * curvature(scene, hit) * cone.width_at(hit.t);
    }
    cone.propagate(hit.t, extra)
}

/// The cone of a sampled ray.
#[inline]
pub(crate) fn of_sample(
    scene: &FlatScene,
    hit: &Hit,
    cone: RayCone,
    sample: &BsdfSample,
) -> RayCone {
    scattered(scene, hit, cone, sample.spread, sample.transmitted)
}

/// Mean curvature of the triangle's shading normals along its edges, per world unit.
fn curvature(scene: &FlatScene, hit: &Hit) -> f32 {
    let (instance, geometry) = scene.records(hit);
    let Some(normals) = &geometry.primitive.normals else { return 0.0 };
    let corners = geometry.primitive.indices[hit.primitive as usize];
    let triangle = scene.world_triangle(hit.instance, hit.geometry, hit.primitive);
    let normals = corners.map(|i| {
        let n = geometry.normal_transform * normals[i as usize];
        let n = if instance.is_identity { n } else { instance.normal_to_world * n };
        n.normalize_or_zero()
    });
    let mut sum = 0.0;
    for (a, b) in [(0, 1), (1, 2), (2, 0)] {
        let along = triangle.points[b] - triangle.points[a];
        let squared = along.length_squared();
        if squared > 0.0 {
            sum += (normals[b] - normals[a]).dot(along) / squared;
        }
    }
    sum / 3.0
}
