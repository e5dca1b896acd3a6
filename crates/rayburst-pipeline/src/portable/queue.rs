//! Running portable shaders: a tile's rays, traced in batches and shaded record by record.

use glam::UVec3;
use rayburst_accel::{AcceptAll, CandidateFilter, RayFlags, Tlas};
use rayburst_math::{Hit, HitKind, Ray};
use rayon::prelude::*;

use super::{Next, PortableHit, PortablePipeline, PortableRay, TraceRequest};
use crate::{
    AnyHitResult, DispatchError,
    pipeline::{check_launches, tiles},
    trace::open,
};

/// Launches of a tile along a side: what is kept of them stays in the second cache.
const TILE: u32 = 32;

/// A launch on its way.
struct State<P> {
    launch: UVec3,
    payload: P,
    request: TraceRequest,
    /// Rays that were traced before.
    depth: u32,
    /// Whether no ray is left to trace.
    done: bool,
}

/// The launches of a tile and what their rays find; one a thread at a time, kept from tile to tile.
struct Queue<P> {
    states: Vec<State<P>>,
    rays: Vec<Ray>,
    hits: Vec<Hit>,
    occluded: Vec<bool>,
    found: Vec<u32>,
    order: Vec<u32>,
    starts: Vec<u32>,
}

impl<P> Default for Queue<P> {
    fn default() -> Self {
        Self {
            states: vec![],
            rays: vec![],
            hits: vec![],
            occluded: vec![],
            found: vec![],
            order: vec![],
            starts: vec![],
        }
    }
}

/// Rays that are traced together.
struct Batch<'a, P> {
    pipeline: &'a PortablePipeline<'a, P>,
    tlas: &'a Tlas,
    dimensions: UVec3,
    states: &'a [State<P>],
}

impl<P> Batch<'_, P> {
    fn ray(&self, index: usize) -> PortableRay<'_> {
        let state = &self.states[index];
        PortableRay {
            launch_index: state.launch,
            launch_dimensions: self.dimensions,
            ray: &state.request.ray,
            depth: state.depth,
        }
    }
}

/// The record that a hit finds.
fn record_of<P>(
    pipeline: &PortablePipeline<'_, P>,
    tlas: &Tlas,
    request: &TraceRequest,
    hit: &Hit,
) -> u64 {
    let instance = &tlas.instances()[hit.instance as usize];
    let ray_type = &pipeline.ray_types[request.ray_type.index as usize];
    ray_type.record(instance.contribution, hit.geometry)
}

impl<P> CandidateFilter for Batch<'_, P> {
    fn accept(&self, index: u32, _: &Ray, candidate: &Hit) -> bool {
        let state = &self.states[index as usize];
        let record = record_of(self.pipeline, self.tlas, &state.request, candidate);
        let Some(Some(record)) = self.pipeline.hits.get(record as usize) else { return true };
        let ray = self.ray(index as usize);
        let hit = PortableHit { ray, hit: candidate, record: &(), tlas: self.tlas };
        record.any_hit(&hit, &state.payload) != AnyHitResult::Ignore
    }
}

/// Stands for a hit of which only is known that there is one.
const SOME_HIT: Hit = Hit { kind: HitKind(u32::MAX), ..Hit::MISS };

impl<P: Copy + Send + Sync + 'static> PortablePipeline<'_, P> {
    /// Runs the shaders for every index of a grid of `width × height × depth`, in tiles on the current
    /// thread pool: `generate` gives a launch's payload and first ray, `finish` gets its payload when no
    /// ray is left. Rays are traced in `tlas`.
    ///
    /// If a launch asks for more rays than were declared, the others run to the end all the same, that
    /// launch is not finished, and the error is that of the first such one, in the order of rows.
    pub fn dispatch_rays(
        &self,
        tlas: &Tlas,
        [width, height, depth]: [u32; 3],
        generate: impl Fn(UVec3) -> (P, Next) + Sync,
        finish: impl Fn(UVec3, P) + Sync,
    ) -> Result<(), DispatchError> {
        check_launches(width, height, depth)?;
        self.check(tlas)?;
        let dimensions = UVec3::new(width, height, depth);
        let order = |launch: &UVec3| (launch.z, launch.y, launch.x);
        let failures = tiles(dimensions, TILE).map_init(Queue::default, |queue, launches| {
            queue.states.clear();
            for launch in launches {
                let (payload, next) = generate(launch);
                match next {
                    Next::Done => finish(launch, payload),
                    Next::Trace(request) => {
                        queue.states.push(State {
                            launch,
                            payload,
                            request,
                            depth: 0,
                            done: false,
                        });
                    }
                }
            }
            while let Some(first) = queue.states.first() {
                // All have traced as many: none may go on.
                if first.depth >= self.max_rays {
                    return queue.states.iter().map(|state| state.launch).min_by_key(order);
                }
                self.step(tlas, dimensions, queue, &finish);
            }
            None
        });
        let first = failures.flatten().min_by_key(order);
        match first {
            Some(launch) => Err(DispatchError::TooManyRays { launch, limit: self.max_rays }),
            None => Ok(()),
        }
    }

    /// Traces the next ray of every launch, shades what they hit, and keeps the launches that go on.
    fn step(
        &self,
        tlas: &Tlas,
        dimensions: UVec3,
        queue: &mut Queue<P>,
        finish: &impl Fn(UVec3, P),
    ) {
        let Queue { states, rays, hits, occluded, .. } = queue;
        // Rays of different flags cannot share a batch.
        let kind = |state: &State<P>| {
            let TraceRequest { ray_type, flags, mask, .. } = state.request;
            (flags.bits(), mask, ray_type)
        };
        if !states.is_sorted_by_key(kind) {
            states.sort_by_key(kind);
        }
        rays.clear();
        rays.extend(states.iter().map(|state| open(&state.request.ray)));
        hits.clear();
        hits.resize(states.len(), Hit::MISS);
        let mut start = 0;
        for part in states.chunk_by(|a, b| kind(a) == kind(b)) {
            let range = start..start + part.len();
            start = range.end;
            let batch = Batch { pipeline: self, tlas, dimensions, states: part };
            batch.trace(&rays[range.clone()], &mut hits[range], occluded);
        }
        self.shade(tlas, dimensions, queue, finish);
        // In the order of launches, in which neighbours go about the same way.
        queue.states.retain(|state| !state.done);
    }

    /// Runs the shaders of what rays hit, record by record.
    fn shade(
        &self,
        tlas: &Tlas,
        dimensions: UVec3,
        queue: &mut Queue<P>,
        finish: &impl Fn(UVec3, P),
    ) {
        let Queue { states, hits, found, order, starts, .. } = queue;
        let records = self.hits.len() as u32;
        // What finds no record comes after all of them.
        let (occluded, miss) = (records, records + 1);
        found.clear();
        found.extend(states.iter().zip(&*hits).map(|(state, hit)| {
            if !hit.is_hit() {
                miss
            } else if *hit == SOME_HIT {
                occluded
            } else {
                record_of(self, tlas, &state.request, hit) as u32
            }
        }));
        by_record(found, records + 2, starts, order);
        for &i in &*order {
            let i = i as usize;
            let (state, hit) = (&mut states[i], &hits[i]);
            let ray = PortableRay {
                launch_index: state.launch,
                launch_dimensions: dimensions,
                ray: &state.request.ray,
                depth: state.depth,
            };
            let skips = state.request.flags.contains(RayFlags::SKIP_CLOSEST_HIT_SHADER);
            let (payload, next) = if found[i] == miss {
                let ray_type = &self.ray_types[state.request.ray_type.index as usize];
                match &self.misses[ray_type.miss as usize] {
                    Some(miss) => (miss.run)(&ray, state.payload),
                    None => (state.payload, Next::Done),
                }
            } else if skips {
                (state.payload, Next::Done)
            } else {
                match self.hits.get(found[i] as usize) {
                    Some(Some(record)) if record.has_closest_hit() => {
                        let hit = PortableHit { ray, hit, record: &(), tlas };
                        record.closest_hit(&hit, state.payload)
                    }
                    _ => (state.payload, Next::Done),
                }
            };
            match next {
                Next::Done => {
                    finish(state.launch, payload);
                    state.done = true;
                }
                Next::Trace(request) => {
                    state.payload = payload;
                    state.request = request;
                    state.depth += 1;
                }
            }
        }
    }
}

/// Puts the indices of rays in `order`, sorted by what they found, which is less than `kinds`.
fn by_record(found: &[u32], kinds: u32, starts: &mut Vec<u32>, order: &mut Vec<u32>) {
    order.clear();
    if kinds as usize > found.len() {
        order.extend(0..found.len() as u32);
        order.sort_by_key(|&i| found[i as usize]);
        return;
    }
    starts.clear();
    starts.resize(kinds as usize + 1, 0);
    for &found in found {
        starts[found as usize + 1] += 1;
    }
    for i in 1..starts.len() {
        starts[i] += starts[i - 1];
    }
    order.resize(found.len(), 0);
    for (i, &found) in (0..).zip(found) {
        let start = &mut starts[found as usize];
        order[*start as usize] = i;
        *start += 1;
    }
}

impl<P> Batch<'_, P> {
    /// Traces all rays, which have the same flags, mask and type.
    fn trace(&self, rays: &[Ray], hits: &mut [Hit], occluded: &mut Vec<bool>) {
        let Some(first) = self.states.first() else { return };
        let TraceRequest { flags, mask, .. } = first.request;
        let options = flags.options(mask);
        let any = RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH | RayFlags::SKIP_CLOSEST_HIT_SHADER;
        if flags.contains(any) {
            occluded.clear();
            occluded.resize(rays.len(), false);
            if self.pipeline.has_any_hit {
                self.tlas.any_hits(rays, occluded, &options, self);
            } else {
                self.tlas.any_hits(rays, occluded, &options, &AcceptAll);
            }
            for (hit, &occluded) in hits.iter_mut().zip(&*occluded) {
                *hit = if occluded { SOME_HIT } else { Hit::MISS };
            }
        } else if self.pipeline.has_any_hit {
            self.tlas.closest_hits(rays, hits, &options, self);
        } else {
            self.tlas.closest_hits(rays, hits, &options, &AcceptAll);
        }
    }
}
