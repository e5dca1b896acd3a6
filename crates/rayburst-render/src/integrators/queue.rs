//! Queues of rays in flight: the current generation, the next one, and shadow rays.

use rayburst_accel::{AcceptAll, Counters, TraceOptions};
use rayburst_math::{Hit, Ray, RayCone, hash};
use rayburst_scene::FlatScene;

use crate::batch::Batch;

/// What a path carries from vertex to vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathState {
    /// Footprint at the ray's origin.
    pub(crate) cone: RayCone,
}

/// One generation of rays and what they hit.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    pub(crate) rays: Vec<Ray>,
    pub(crate) paths: Vec<PathState>,
    /// Roots of the alpha decisions, one a ray.
    pub(crate) keys: Vec<u32>,
    pub(crate) hits: Vec<Hit>,
}

impl Queue {
    pub(crate) fn clear(&mut self) {
        self.rays.clear();
        self.paths.clear();
        self.keys.clear();
    }

    pub(crate) fn push(&mut self, ray: Ray, path: PathState, key: u32) {
        self.rays.push(ray);
        self.paths.push(path);
        self.keys.push(key);
    }

    /// The eye rays of a batch.
    pub(crate) fn start(&mut self, batch: &Batch) {
        self.clear();
        for slot in 0..batch.len() {
            let path = PathState { cone: batch.cones[slot] };
            self.push(batch.rays[slot], path, ray_key(batch.keys[slot], 1));
        }
    }

    /// Finds the closest hits, and what each ray visited.
    pub(crate) fn trace_counted(&mut self, scene: &FlatScene, counts: &mut Vec<Counters>) {
        self.hits.clear();
        self.hits.resize(self.rays.len(), Hit::MISS);
        counts.clear();
        counts.resize(self.rays.len(), Counters::default());
        let options = TraceOptions::default();
        scene.tlas.closest_hits_counted(&self.rays, &mut self.hits, counts, &options, &AcceptAll);
    }

    /// Finds the closest hits.
    pub(crate) fn trace(&mut self, scene: &FlatScene) {
        self.hits.clear();
        self.hits.resize(self.rays.len(), Hit::MISS);
        let options = TraceOptions::default();
        scene.tlas.closest_hits(&self.rays, &mut self.hits, &options, &AcceptAll);
    }
}

/// All queues of a worker.
#[derive(Debug, Default)]
pub(crate) struct Queues {
    pub(crate) current: Queue,
}

/// The root of a ray's alpha decisions: a hash of seed, pixel, sample and depth.
#[inline]
pub(crate) fn ray_key(path_key: u32, depth: u32) -> u32 {
    hash::combine(path_key, depth)
}
