//! Ambient occlusion by rays: one for every 2×2 pixels, by the cosine, as far as a radius.

use rayburst_math::{Frame, Hit, Ray, glam::Vec3, warp};
use rayon::prelude::*;

use super::{
    gbuffer::GBuffer,
    pass::FrameContext,
    quads::{Quads, Shared, asking},
    shadows::closest_hits,
    signals::Signals,
};
use crate::{dimensions, integrators::ray_key};

#[derive(Debug, Default)]
struct Work {
    rays: Vec<Ray>,
    keys: Vec<u32>,
    hits: Vec<Hit>,
    targets: Vec<(u32, u32)>,
}

/// Fills in the ambient occlusion; returns the rays it took.
pub(crate) fn ambient_occlusion(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    radius: f32,
    quads: &mut Quads,
    signals: &mut Signals,
) -> u64 {
    let columns = quads.size().0;
    let count = quads
        .rows()
        .into_par_iter()
        .map_init(Work::default, |work, mut rows| {
            work.rays.clear();
            work.keys.clear();
            work.targets.clear();
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
                work.rays.push(Ray::with_interval(origin, direction, 0.0, radius));
                work.keys.push(ray_key(frame.key(at), OCCLUSION_DEPTH));
                work.targets.push(block);
            }
            closest_hits(frame.scene, frame.opaque, &work.rays, &work.keys, &mut work.hits);
            for (hit, &(x, y)) in work.hits.iter().zip(&work.targets) {
                if hit.is_hit() {
                    rows.occlusion.set(x, y, 0.0);
                    rows.occluder.set(x, y, hit.t);
                }
            }
            work.rays.len() as u64
        })
        .sum();
    quads.share(gbuffer, signals, Shared { light: false, occlusion: true });
    count
}

/// Keeps the alpha decisions of these rays apart from those of paths.
const OCCLUSION_DEPTH: u32 = 1 << 20;
