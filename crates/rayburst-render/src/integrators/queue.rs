//! Queues of rays in flight: the current generation, the next one, and shadow rays.

use rayburst_accel::Counters;
use rayburst_math::{Hit, Ray, glam::Vec3, hash};

use crate::{
    RayFootprint,
    batch::{Batch, Context},
    footprint::Footprints,
};

/// What a path carries from vertex to vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathState {
    /// Factor between radiance at the ray's end and its share of the sample.
    pub(crate) throughput: Vec3,
    /// The batch's slot that it adds to.
    pub(crate) slot: u32,
    /// Density, with respect to solid angle, with which the ray's direction was chosen; infinite if
    /// there was no choice (eye rays, mirrors).
    pub(crate) pdf: f32,
    /// Whether it has met nothing but perfect mirrors and glass.
    pub(crate) specular: bool,
}

/// One generation of rays and what they hit.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    pub(crate) rays: Vec<Ray>,
    pub(crate) paths: Vec<PathState>,
    pub(crate) footprints: Footprints,
    /// Roots of the alpha decisions, one a ray.
    pub(crate) keys: Vec<u32>,
    pub(crate) hits: Vec<Hit>,
}

impl Queue {
    pub(crate) fn len(&self) -> usize {
        self.rays.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.rays.is_empty()
    }

    pub(crate) fn clear(&mut self) {
        self.rays.clear();
        self.paths.clear();
        self.footprints.clear();
        self.keys.clear();
    }

    pub(crate) fn push(&mut self, ray: Ray, path: PathState, footprint: &RayFootprint, key: u32) {
        self.rays.push(ray);
        self.paths.push(path);
        self.footprints.push(footprint);
        self.keys.push(key);
    }

    /// The eye rays of a batch.
    pub(crate) fn start(&mut self, batch: &Batch) {
        self.clear();
        for slot in 0..batch.len() {
            let path = PathState {
                throughput: Vec3::ONE,
                slot: slot as u32,
                pdf: f32::INFINITY,
                specular: true,
            };
            let footprint = batch.footprints.get(slot);
            self.push(batch.rays[slot], path, &footprint, ray_key(batch.keys[slot], 1));
        }
    }

    /// Finds the closest hits.
    pub(crate) fn trace(&mut self, context: &Context<'_>) {
        let scene = context.scene;
        self.hits.clear();
        self.hits.resize(self.rays.len(), Hit::MISS);
        let keys = (!context.opaque).then_some(&self.keys[..]);
        scene.closest_hits(&self.rays, keys, &mut self.hits);
    }

    /// Finds the closest hits, and what each ray visited.
    pub(crate) fn trace_counted(&mut self, context: &Context<'_>, counts: &mut Vec<Counters>) {
        let scene = context.scene;
        self.hits.clear();
        self.hits.resize(self.rays.len(), Hit::MISS);
        counts.clear();
        counts.resize(self.rays.len(), Counters::default());
        scene.closest_hits_counted(&self.rays, &self.keys, &mut self.hits, counts);
    }
}

/// Rays that ask whether something is visible, and what it brings if it is.
#[derive(Debug, Default)]
pub(crate) struct ShadowQueue {
    rays: Vec<Ray>,
    /// What to add to which slot.
    light: Vec<(Vec3, u32)>,
    keys: Vec<u32>,
    occluded: Vec<bool>,
}

impl ShadowQueue {
    pub(crate) fn push(&mut self, ray: Ray, radiance: Vec3, slot: u32, key: u32) {
        self.rays.push(ray);
        self.light.push((radiance, slot));
        self.keys.push(key);
    }

    /// Traces all of them, adds what is visible to the batch, and empties the queue.
    pub(crate) fn resolve(&mut self, context: &Context<'_>, batch: &mut Batch) {
        let scene = context.scene;
        self.occluded.clear();
        self.occluded.resize(self.rays.len(), false);
        let keys = (!context.opaque).then_some(&self.keys[..]);
        scene.any_hits(&self.rays, keys, &mut self.occluded);
        batch.counts.shadow += self.rays.len() as u64;
        for (&(radiance, slot), &occluded) in self.light.iter().zip(&self.occluded) {
            if !occluded {
                batch.radiance[slot as usize] += radiance;
            }
        }
        self.rays.clear();
        self.light.clear();
        self.keys.clear();
    }
}

/// All queues of a worker.
#[derive(Debug, Default)]
pub(crate) struct Queues {
    pub(crate) current: Queue,
    pub(crate) next: Queue,
    pub(crate) shadows: ShadowQueue,
}

impl Queues {
    /// Makes the next generation the current one.
    pub(crate) fn advance(&mut self, batch: &mut Batch) {
        std::mem::swap(&mut self.current, &mut self.next);
        self.next.clear();
        batch.counts.indirect += self.current.rays.len() as u64;
    }
}

/// The root of a ray's alpha decisions: a hash of seed, pixel, sample and depth.
#[inline]
pub(crate) fn ray_key(path_key: u32, depth: u32) -> u32 {
    hash::combine(path_key, depth)
}

/// The root of the alpha decisions of the shadow rays that leave the end of a ray of this depth.
#[inline]
pub(crate) fn shadow_key(path_key: u32, depth: u32) -> u32 {
    hash::combine(path_key, !depth)
}
