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
    depth: u32,
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
        let failures = tiles(dimensions, TILE).map(|launches| {
            let mut states = Vec::with_capacity((TILE * TILE) as usize);
            let mut failure = None;
            for launch in launches {
                let (payload, next) = generate(launch);
                match next {
                    Next::Done => finish(launch, payload),
                    Next::Trace(request) => {
                        states.push(State { launch, payload, request, depth: 0 });
                    }
                }
            }
            while !states.is_empty() {
                states = self.step(tlas, dimensions, states, &finish, &mut failure);
            }
            failure
        });
        let order = |launch: &UVec3| (launch.z, launch.y, launch.x);
        let first = failures.flatten().min_by_key(order);
        match first {
            Some(launch) => Err(DispatchError::TooManyRays { launch, limit: self.max_rays }),
            None => Ok(()),
        }
    }

    /// Traces the rays of some launches and shades what they hit; returns those that go on.
    fn step(
        &self,
        tlas: &Tlas,
        dimensions: UVec3,
        mut states: Vec<State<P>>,
        finish: &impl Fn(UVec3, P),
        failure: &mut Option<UVec3>,
    ) -> Vec<State<P>> {
        let too_many = |state: &State<P>| state.depth >= self.max_rays;
        if let Some(state) = states.iter().find(|state| too_many(state)) {
            // All have traced as many: none may go on.
            *failure = failure.or(Some(state.launch));
            return vec![];
        }
        // Rays of different flags cannot share a batch.
        let kind = |state: &State<P>| {
            let TraceRequest { ray_type, flags, mask, .. } = state.request;
            (flags.bits(), mask, ray_type)
        };
        if !states.is_sorted_by_key(kind) {
            states.sort_by_key(kind);
        }
        let mut hits = vec![Hit::MISS; states.len()];
        let mut start = 0;
        for part in states.chunk_by(|a, b| kind(a) == kind(b)) {
            let end = start + part.len();
            let batch = Batch { pipeline: self, tlas, dimensions, states: part };
            batch.trace(&mut hits[start..end]);
            start = end;
        }
        self.shade(tlas, dimensions, states, &hits, finish)
    }

    /// Runs the shaders of what rays hit, record by record; returns the launches that go on.
    fn shade(
        &self,
        tlas: &Tlas,
        dimensions: UVec3,
        states: Vec<State<P>>,
        hits: &[Hit],
        finish: &impl Fn(UVec3, P),
    ) -> Vec<State<P>> {
        /// What rays find that miss, after all records.
        const MISS: u64 = u64::MAX;
        let find = |(state, hit): (&State<P>, &Hit)| {
            if !hit.is_hit() {
                MISS
            } else if *hit == SOME_HIT {
                MISS - 1
            } else {
                record_of(self, tlas, &state.request, hit)
            }
        };
        let found: Vec<u64> = states.iter().zip(hits).map(find).collect();
        let mut rest = Vec::with_capacity(states.len());
        let mut chosen: Vec<Option<(P, Next)>> = vec![None; states.len()];
        let batch = Batch { pipeline: self, tlas, dimensions, states: &states };
        for i in by_record(&found, self.hits.len()) {
            let i = i as usize;
            let (state, hit, ray) = (&states[i], &hits[i], batch.ray(i));
            let skips = state.request.flags.contains(RayFlags::SKIP_CLOSEST_HIT_SHADER);
            let (payload, next) = if found[i] == MISS {
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
            chosen[i] = Some((payload, next));
        }
        // In the order of launches, in which neighbours go about the same way.
        for (chosen, state) in chosen.into_iter().zip(states) {
            let Some((payload, next)) = chosen else { continue };
            match next {
                Next::Done => finish(state.launch, payload),
                Next::Trace(request) => {
                    rest.push(State { payload, request, depth: state.depth + 1, ..state });
                }
            }
        }
        rest
    }
}

/// Indices of rays in the order of the records that they found, of which there are so many; what is no
/// record comes last.
fn by_record(found: &[u64], records: usize) -> Vec<u32> {
    let mut order: Vec<u32> = (0..found.len() as u32).collect();
    if records > found.len() {
        order.sort_by_key(|&i| found[i as usize]);
        return order;
    }
    let bucket = |found: u64| found.min(records as u64) as usize;
    let mut starts = vec![0u32; records + 2];
    for &found in found {
        starts[bucket(found) + 1] += 1;
    }
    for i in 1..starts.len() {
        starts[i] += starts[i - 1];
    }
    for (i, &found) in (0..).zip(found) {
        let start = &mut starts[bucket(found)];
        order[*start as usize] = i;
        *start += 1;
    }
    order
}

impl<P> Batch<'_, P> {
    /// Traces all rays, which have the same flags, mask and type.
    fn trace(&self, hits: &mut [Hit]) {
        let Some(first) = self.states.first() else { return };
        let TraceRequest { flags, mask, .. } = first.request;
        let options = flags.options(mask);
        let rays: Vec<Ray> = self.states.iter().map(|state| open(&state.request.ray)).collect();
        let any = RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH | RayFlags::SKIP_CLOSEST_HIT_SHADER;
        if flags.contains(any) {
            let mut occluded = vec![false; rays.len()];
            if self.pipeline.has_any_hit {
                self.tlas.any_hits(&rays, &mut occluded, &options, self);
            } else {
                self.tlas.any_hits(&rays, &mut occluded, &options, &AcceptAll);
            }
            for (hit, occluded) in hits.iter_mut().zip(occluded) {
                *hit = if occluded { SOME_HIT } else { Hit::MISS };
            }
        } else if self.pipeline.has_any_hit {
            self.tlas.closest_hits(&rays, hits, &options, self);
        } else {
            self.tlas.closest_hits(&rays, hits, &options, &AcceptAll);
        }
    }
}
