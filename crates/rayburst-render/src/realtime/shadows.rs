//! Rays of a band of pixels, traced in one batch: whether something blocks them, and how far it is.

use rayburst_math::{Hit, Ray};
use rayburst_scene::FlatScene;

/// Rays that ask whether something is visible; `T` says what it brings if it is.
#[derive(Debug)]
pub(crate) struct ShadowRays<T> {
    rays: Vec<Ray>,
    keys: Vec<u32>,
    items: Vec<T>,
    occluded: Vec<bool>,
}

impl<T> Default for ShadowRays<T> {
    fn default() -> Self {
        Self { rays: vec![], keys: vec![], items: vec![], occluded: vec![] }
    }
}

impl<T: Copy> ShadowRays<T> {
    #[inline]
    pub(crate) fn push(&mut self, ray: Ray, key: u32, item: T) {
        self.rays.push(ray);
        self.keys.push(key);
        self.items.push(item);
    }

    /// Traces all rays, tells `answer` of each item whether it is visible, and empties the list; returns
    /// how many rays there were.
    pub(crate) fn resolve(
        &mut self,
        scene: &FlatScene,
        opaque: bool,
        mut answer: impl FnMut(T, bool),
    ) -> u64 {
        self.occluded.clear();
        self.occluded.resize(self.rays.len(), false);
        let keys = (!opaque).then_some(&self.keys[..]);
        scene.any_hits(&self.rays, keys, &mut self.occluded);
        for (&item, &occluded) in self.items.iter().zip(&self.occluded) {
            answer(item, !occluded);
        }
        let count = self.rays.len() as u64;
        self.rays.clear();
        self.keys.clear();
        self.items.clear();
        count
    }
}

/// Rays whose closest hits are asked for; `T` says what for.
#[derive(Debug)]
pub(crate) struct OcclusionRays<T> {
    rays: Vec<Ray>,
    keys: Vec<u32>,
    items: Vec<T>,
    hits: Vec<Hit>,
}

impl<T> Default for OcclusionRays<T> {
    fn default() -> Self {
        Self { rays: vec![], keys: vec![], items: vec![], hits: vec![] }
    }
}

impl<T: Copy> OcclusionRays<T> {
    #[inline]
    pub(crate) fn push(&mut self, ray: Ray, key: u32, item: T) {
        self.rays.push(ray);
        self.keys.push(key);
        self.items.push(item);
    }

    /// Traces all rays, tells `answer` of each item that something blocks and how far that is, and empties
    /// the list; returns how many rays there were.
    pub(crate) fn resolve(
        &mut self,
        scene: &FlatScene,
        opaque: bool,
        mut answer: impl FnMut(T, f32),
    ) -> u64 {
        closest_hits(scene, opaque, &self.rays, &self.keys, &mut self.hits);
        for (hit, &item) in self.hits.iter().zip(&self.items) {
            if hit.is_hit() {
                answer(item, hit.t);
            }
        }
        let count = self.rays.len() as u64;
        self.rays.clear();
        self.keys.clear();
        self.items.clear();
        count
    }
}

/// Finds the closest hits of rays.
pub(crate) fn closest_hits(
    scene: &FlatScene,
    opaque: bool,
    rays: &[Ray],
    keys: &[u32],
    hits: &mut Vec<Hit>,
) {
    hits.clear();
    hits.resize(rays.len(), Hit::MISS);
    scene.closest_hits(rays, (!opaque).then_some(keys), hits);
}
