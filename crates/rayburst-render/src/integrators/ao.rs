//! Ambient occlusion: the cosine-weighted share of the hemisphere over a point that is open.
//!
//! Zhukov, Iones, Kronin: "An Ambient Light Illumination Model", EGWR 1998; one cosine-distributed
//! ray a sample, ended at `ao_radius` (chapter 26.1). The hemisphere stands on the shading normal;
//! what of it lies under the surface counts as closed. Eye rays that meet nothing see 1.

use rayburst_math::{Frame, Ray, glam::Vec3, warp};

use super::queue::{Queues, shadow_key};
use crate::{
    Features,
    batch::{Batch, Context},
    dimensions::Vertex,
};

pub(super) fn integrate(context: &Context<'_>, batch: &mut Batch, queues: &mut Queues) {
    let Queues { current, shadows, .. } = queues;
    current.start(batch);
    current.trace(context);
    for slot in 0..batch.len() {
        let (ray, hit) = (&current.rays[slot], &current.hits[slot]);
        if !hit.is_hit() {
            batch.radiance[slot] = Vec3::ONE;
            continue;
        }
        if let Some(features) = batch.features.get_mut(slot) {
            *features = Features::of_hit(context, ray, hit, &current.footprints.get(slot));
        }
        let surface = context.scene.surface(hit);
        let up = surface.normal_towards(-ray.direction);
        let normal = if surface.shading_normal.dot(up) < 0.0 {
            -surface.shading_normal
        } else {
            surface.shading_normal
        };
        let u = batch.samplers[slot].get_2d(Vertex::at_depth(1).direction());
        let direction = Frame::from_normal(normal).to_world(warp::cosine_hemisphere(u));
        if direction.dot(up) <= 0.0 {
            continue;
        }
        let radius = context.settings.ao_radius;
        let ray = Ray::with_interval(surface.spawn(direction), direction, 0.0, radius);
        shadows.push(ray, Vec3::ONE, slot as u32, shadow_key(batch.keys[slot], 1));
    }
    shadows.resolve(context, batch);
}
