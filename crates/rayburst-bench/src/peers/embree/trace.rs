//! Tracing with Embree: single rays, or packets filled from the batch and emptied into its hits.

use std::{ffi::c_uint, ptr, sync::Arc};

use rayburst_math::{Hit, HitKind, Ray};

use super::{
    Config, EmbreeScene, Width,
    ffi::{
        Arguments, INVALID_ID, IntersectPacket, OccludedPacket, Ray1, RayHit1, RayHitPacket,
        RayPacket, ValidMask,
    },
};
use crate::{Engine, Query};

/// A scene and the functions by which it is traced.
pub struct EmbreeEngine {
    scene: Arc<EmbreeScene>,
    config: Config,
}

impl EmbreeEngine {
    /// Traces `scene`, which was built as `config` says.
    pub fn new(scene: Arc<EmbreeScene>, config: Config) -> Self {
        Self { scene, config }
    }
}

impl Engine for EmbreeEngine {
    fn name(&self) -> String {
        self.config.to_string()
    }

    fn is_peer(&self) -> bool {
        true
    }

    fn takes_single_rays(&self) -> bool {
        self.config.width == Width::One
    }

    fn trace(&self, query: Query, rays: &[Ray], hits: &mut [Hit], occluded: &mut [bool]) {
        let f = self.scene.embree.functions;
        match (query, self.config.width) {
            (Query::Closest, Width::One) => self.closest(rays, hits),
            (Query::Closest, Width::Eight) => self.closest_packets(f.intersect8, rays, hits),
            (Query::Closest, Width::Sixteen) => self.closest_packets(f.intersect16, rays, hits),
            (Query::Any, Width::One) => self.any(rays, occluded),
            (Query::Any, Width::Eight) => self.any_packets(f.occluded8, rays, occluded),
            (Query::Any, Width::Sixteen) => self.any_packets(f.occluded16, rays, occluded),
        }
    }
}

impl EmbreeEngine {
    /// Calls `work` with the arguments of a call; null stands for Embree's defaults.
    fn with_arguments(&self, work: impl FnOnce(*mut Arguments)) {
        let mut coherent = Arguments::COHERENT;
        work(if self.config.coherent { &raw mut coherent } else { ptr::null_mut() });
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit]) {
        let intersect = self.scene.embree.functions.intersect1;
        let mut query = RayHit1::EMPTY;
        self.with_arguments(|arguments| {
            for (ray, hit) in rays.iter().zip(hits) {
                fill(&mut query.ray, ray);
                query.geometry = INVALID_ID;
                // SAFETY: the scene is committed, the record has Embree's layout and alignment, and
                // the arguments are null or a live record of Embree's layout.
                unsafe { intersect(self.scene.handle, &mut query, arguments) };
                *hit = hit_of(query.ray.t_far, query.u, query.v, query.primitive, query.geometry);
            }
        });
    }

    fn any(&self, rays: &[Ray], occluded: &mut [bool]) {
        let occlude = self.scene.embree.functions.occluded1;
        let mut query = Ray1::EMPTY;
        self.with_arguments(|arguments| {
            for (ray, occluded) in rays.iter().zip(occluded) {
                fill(&mut query, ray);
                // SAFETY: as in `closest`.
                unsafe { occlude(self.scene.handle, &mut query, arguments) };
                *occluded = query.t_far == f32::NEG_INFINITY;
            }
        });
    }

    fn closest_packets<const W: usize>(
        &self,
        intersect: IntersectPacket<W>,
        rays: &[Ray],
        hits: &mut [Hit],
    ) {
        let mut packet = RayHitPacket::<W>::EMPTY;
        self.with_arguments(|arguments| {
            for (rays, hits) in rays.chunks(W).zip(hits.chunks_mut(W)) {
                let valid = fill_packet(&mut packet.ray, rays);
                packet.hit.geometry = [INVALID_ID; W];
                // SAFETY: as in `closest`; the mask has Embree's alignment too.
                unsafe { intersect(&valid, self.scene.handle, &mut packet, arguments) };
                let RayHitPacket { ray, hit: found } = &packet;
                for (lane, hit) in hits.iter_mut().enumerate() {
                    let (u, v) = (found.u[lane], found.v[lane]);
                    let (primitive, geometry) = (found.primitive[lane], found.geometry[lane]);
                    *hit = hit_of(ray.t_far[lane], u, v, primitive, geometry);
                }
            }
        });
    }

    fn any_packets<const W: usize>(
        &self,
        occlude: OccludedPacket<W>,
        rays: &[Ray],
        occluded: &mut [bool],
    ) {
        let mut packet = RayHitPacket::<W>::EMPTY.ray;
        self.with_arguments(|arguments| {
            for (rays, occluded) in rays.chunks(W).zip(occluded.chunks_mut(W)) {
                let valid = fill_packet(&mut packet, rays);
                // SAFETY: as in `closest_packets`.
                unsafe { occlude(&valid, self.scene.handle, &mut packet, arguments) };
                for (lane, occluded) in occluded.iter_mut().enumerate() {
                    *occluded = packet.t_far[lane] == f32::NEG_INFINITY;
                }
            }
        });
    }
}

#[inline]
fn fill(to: &mut Ray1, ray: &Ray) {
    to.origin = ray.origin.to_array();
    to.t_near = ray.t_min;
    to.direction = ray.direction.to_array();
    to.t_far = ray.t_max;
}

/// Fills the lanes with rays; lanes without one are not traced.
#[inline]
fn fill_packet<const W: usize>(to: &mut RayPacket<W>, rays: &[Ray]) -> ValidMask<W> {
    let Ok(rays) = <&[Ray; W]>::try_from(rays) else {
        for (lane, ray) in rays.iter().enumerate() {
            fill_lane(to, lane, ray);
        }
        return ValidMask(std::array::from_fn(|lane| if lane < rays.len() { -1 } else { 0 }));
    };
    for lane in 0..W {
        fill_lane(to, lane, &rays[lane]);
    }
    ValidMask([-1; W])
}

#[inline(always)]
fn fill_lane<const W: usize>(to: &mut RayPacket<W>, lane: usize, ray: &Ray) {
    for axis in 0..3 {
        to.origin[axis][lane] = ray.origin[axis];
        to.direction[axis][lane] = ray.direction[axis];
    }
    to.t_near[lane] = ray.t_min;
    to.t_far[lane] = ray.t_max;
}

#[inline(always)]
fn hit_of(t: f32, u: f32, v: f32, primitive: c_uint, geometry: c_uint) -> Hit {
    if geometry == INVALID_ID {
        return Hit::MISS;
    }
    // Which side was hit would cost a product of normal and direction, and Embree is not charged
    // for what it does not give.
    let kind = HitKind::TRIANGLE_FRONT;
    Hit { t, u, v, primitive, geometry, instance: 0, kind, reserved: 0 }
}

#[cfg(test)]
mod tests {
    use rayburst_math::hash::Rng;

    use super::*;

    fn rays(count: usize) -> Vec<Ray> {
        let mut rng = Rng::new(1);
        (0..count)
            .map(|_| Ray::with_interval(rng.vec3(), rng.vec3(), rng.f32(), 2.0 + rng.f32()))
            .collect()
    }

    #[test]
    fn packets_hold_the_rays() {
        let rays = rays(16);
        for count in [1, 7, 16] {
            let mut packet = RayHitPacket::<16>::EMPTY.ray;
            let valid = fill_packet(&mut packet, &rays[..count]);
            for lane in 0..16 {
                assert_eq!(valid.0[lane], if lane < count { -1 } else { 0 });
                let ray = Ray::with_interval(
                    packet.origin.map(|axis| axis[lane]).into(),
                    packet.direction.map(|axis| axis[lane]).into(),
                    packet.t_near[lane],
                    packet.t_far[lane],
                );
                assert_eq!(ray == rays[lane], lane < count);
            }
        }
    }

    #[test]
    fn an_invalid_geometry_is_a_miss() {
        assert_eq!(hit_of(1.0, 0.0, 0.0, 3, INVALID_ID), Hit::MISS);
        let hit = hit_of(1.0, 0.25, 0.5, 3, 0);
        assert!(hit.is_hit() && hit.t == 1.0 && (hit.u, hit.v) == (0.25, 0.5));
        assert_eq!((hit.primitive, hit.geometry), (3, 0));
    }
}
