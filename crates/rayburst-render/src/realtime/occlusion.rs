//! Ambient occlusion by rays: one for every 2×2 pixels, by the cosine, as far as a radius.

use rayburst_math::{
    Ray,
    lanes::{F32x16, Frame16, LANES, Mask16, Vec3x16, cosine_hemisphere},
};
use rayburst_simd::{Isa, Kernel};
use rayon::prelude::*;

use super::{
    gbuffer::{GBuffer, Pixels},
    pass::{FrameContext, isa_of},
    quads::{QuadRows, Quads, asking},
    shadows::OcclusionRays,
};
use crate::{dimensions, integrators::ray_key};

/// What a thread keeps from band to band.
#[derive(Default)]
struct Work {
    rays: OcclusionRays<(u32, u32)>,
    /// Pixels that ask, and their blocks.
    asking: Vec<((u32, u32), (u32, u32))>,
}

/// Fills in the ambient occlusion of blocks; returns the rays it took.
pub(crate) fn ambient_occlusion(
    frame: &FrameContext<'_>,
    gbuffer: &GBuffer,
    radius: f32,
    quads: &mut Quads,
) -> u64 {
    let columns = quads.size().0;
    let isa = isa_of(frame.scene);
    quads
        .rows()
        .into_par_iter()
        .map_init(Work::default, |work, mut rows| {
            work.asking.clear();
            for block in rows.blocks(columns) {
                rows.occlusion.set(block.0, block.1, 1.0);
                rows.occluder.set(block.0, block.1, f32::INFINITY);
                let at = asking(rows.chosen.get(block.0, block.1), block);
                work.asking.extend(at.map(|at| (at, block)));
            }
            isa.dispatch(Rays { frame, gbuffer, radius, rows: &mut rows, work });
            work.rays.resolve(frame.scene, frame.opaque, |(x, y), distance| {
                rows.occlusion.set(x, y, 0.0);
                rows.occluder.set(x, y, distance);
            })
        })
        .sum()
}

/// Lists the rays of a band.
struct Rays<'a, 'r> {
    frame: &'a FrameContext<'a>,
    gbuffer: &'a GBuffer,
    radius: f32,
    rows: &'a mut QuadRows<'r>,
    work: &'a mut Work,
}

impl Kernel for Rays<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, _: I) {
        for first in (0..self.work.asking.len()).step_by(LANES) {
            self.sixteen(first);
        }
    }
}

impl Rays<'_, '_> {
    #[inline(always)]
    fn sixteen(&mut self, first: usize) {
        let mut at = [(0, 0); LANES];
        let count = LANES.min(self.work.asking.len() - first);
        for lane in 0..count {
            at[lane] = self.work.asking[first + lane].0;
        }
        let pixels = Pixels::anywhere(&at[..count], self.gbuffer.size());
        let Some(places) = self.gbuffer.places_at(&pixels) else { return };
        let u = self.frame.samplers(&pixels).get_2d(dimensions::OCCLUSION);
        let direction = Frame16::from_normal(places.normal)
            .to_world(cosine_hemisphere(u))
            .normalize_or(places.normal);
        let open = direction.dot(places.geometric_normal).is_greater(F32x16::ZERO);
        let origin = places.spawn(direction);
        self.list(first, places.some, open, &origin, &direction);
    }

    #[inline(never)]
    fn list(
        &mut self,
        first: usize,
        some: Mask16,
        open: Mask16,
        origin: &Vec3x16,
        direction: &Vec3x16,
    ) {
        for lane in some.lanes() {
            let (at, block) = self.work.asking[first + lane];
            if !open.lane(lane) {
                // Behind the triangle, before the normal of shading: nothing is open there.
                self.rows.occlusion.set(block.0, block.1, 0.0);
                self.rows.occluder.set(block.0, block.1, 0.0);
                continue;
            }
            let (origin, direction) = (origin.lane(lane), direction.lane(lane));
            let ray = Ray::with_interval(origin, direction, 0.0, self.radius);
            self.work.rays.push(ray, ray_key(self.frame.key(at), OCCLUSION_DEPTH), block);
        }
    }
}

/// Keeps the alpha decisions of these rays apart from those of paths.
const OCCLUSION_DEPTH: u32 = 1 << 20;
