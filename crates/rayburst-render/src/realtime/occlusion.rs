//! Ambient occlusion by rays: one for every 2×2 pixels, by the cosine, as far as a radius.

use rayburst_math::{Frame, Ray, glam::Vec3, warp};
use rayon::prelude::*;

use super::{
    gbuffer::GBuffer,
    pass::FrameContext,
    quads::{Quads, asking},
    shadows::OcclusionRays,
};
use crate::{dimensions, integrators::ray_key};

/// Fills in the ambient occlusion of blocks; returns the rays it took.
pub(crate) fn ambient_occlusion(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    radius: f32,
    quads: &mut Quads,
) -> u64 {
    let columns = quads.size().0;
    quads
        .rows()
        .into_par_iter()
        .map_init(OcclusionRays::default, |rays, mut rows| {
            for block in rows.blocks(columns) {
                rows.occlusion.set(block.0, block.1, 1.0);
                rows.occluder.set(block.0, block.1, f32::INFINITY);
                let Some(at) = asking(rows.chosen.get(block.0, block.1), block) else { continue };
                let Some(place) = gbuffer.place_at(at) else { continue };
                let u = frame.sampler(at).get_2d(dimensions::OCCLUSION);
                let local: Vec3 = warp::cosine_hemisphere(u);
                let direction = Frame::from_normal(place.normal).to_world(local).normalize();
                if direction.dot(place.geometric_normal) <= 0.0 {
                    // Behind the triangle, before the normal of shading: nothing is open there.
                    rows.occlusion.set(block.0, block.1, 0.0);
                    rows.occluder.set(block.0, block.1, 0.0);
                    continue;
                }
                let origin = place.spawn(direction);
                let ray = Ray::with_interval(origin, direction, 0.0, radius);
                rays.push(ray, ray_key(frame.key(at), OCCLUSION_DEPTH), block);
            }
            rays.resolve(frame.scene, frame.opaque, |(x, y), distance| {
                rows.occlusion.set(x, y, 0.0);
                rows.occluder.set(x, y, distance);
            })
        })
        .sum()
}

/// Keeps the alpha decisions of these rays apart from those of paths.
const OCCLUSION_DEPTH: u32 = 1 << 20;
