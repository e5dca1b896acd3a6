//! Running portable shaders: a tile's rays, traced in batches and shaded record by record.

use std::sync::{Mutex, PoisonError};

use glam::UVec3;
use rayburst_accel::{AcceptAll, CandidateFilter, RayFlags, Tlas, TraceOptions};
use rayburst_math::{Hit, Ray};
use rayon::prelude::*;

use super::{
    Next, PortablePipeline,
    group::AnyHit,
    procedural::Search,
    shade::{Group, State, Step},
};
use crate::{
    AnyHitResult, DispatchError,
    pipeline::{check_launches, tiles},
    procedural::{Attributes, barycentrics},
    table::RayTypeInfo,
};

/// Launches of a tile along a side: what is kept of them stays in the second cache.
const TILE: u32 = 32;
/// Where so many neighbours find the same shader on average, it is called for them as they are; otherwise
/// once for all that find it.
const RUN: usize = 8;

/// The launches of a tile and what their rays find; one a thread at a time.
pub(super) struct Queue<P> {
    states: Vec<State<P>>,
    /// As they are traced.
    rays: Vec<Ray>,
    /// What is sorted goes there, then changes places.
    sorted: (Vec<State<P>>, Vec<Ray>),
    hits: Vec<Hit>,
    attributes: Vec<Attributes>,
    occluded: Vec<bool>,
    /// The shader that each ray finds, and the rays of each in turn.
    found: Vec<u32>,
    order: Vec<u32>,
    ends: Vec<u32>,
    /// All indices of rays.
    all: Vec<u32>,
}

impl<P> Default for Queue<P> {
    fn default() -> Self {
        Self {
            states: vec![],
            rays: vec![],
            sorted: (vec![], vec![]),
            hits: vec![],
            attributes: vec![],
            occluded: vec![],
            found: vec![],
            order: vec![],
            ends: vec![],
            all: vec![],
        }
    }
}

/// Queues that no thread uses now, kept from dispatch to dispatch.
pub(super) struct Queues<P>(Mutex<Vec<Queue<P>>>);

impl<P> Default for Queues<P> {
    fn default() -> Self {
        Self(Mutex::new(vec![]))
    }
}

/// A queue in use, given back when it is dropped.
struct Lent<'a, P> {
    queue: Queue<P>,
    to: &'a Queues<P>,
}

impl<P> Queues<P> {
    fn lend(&self) -> Lent<'_, P> {
        let mut queues = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        Lent { queue: queues.pop().unwrap_or_default(), to: self }
    }
}

impl<P> Drop for Lent<'_, P> {
    fn drop(&mut self) {
        let mut queues = self.to.0.lock().unwrap_or_else(PoisonError::into_inner);
        queues.push(std::mem::take(&mut self.queue));
    }
}

/// Rays that are traced together.
struct Batch<'a, P> {
    pipeline: &'a PortablePipeline<'a, P>,
    step: Step<'a>,
    states: &'a [State<P>],
    rays: &'a [Ray],
    ray_type: &'a RayTypeInfo,
}

impl<P> Batch<'_, P> {
    /// The record that a hit finds.
    #[inline(always)]
    fn record(&self, hit: &Hit) -> u64 {
        let instance = &self.step.tlas.instances()[hit.instance as usize];
        self.ray_type.record(instance.contribution, hit.geometry)
    }
}

impl<P> CandidateFilter for Batch<'_, P> {
    fn accept(&self, index: u32, _: &Ray, candidate: &Hit) -> bool {
        let (state, ray) = (&self.states[index as usize], &self.rays[index as usize]);
        let record = self.record(candidate) as usize;
        let Some(Some(record)) = self.pipeline.hits.get(record) else { return true };
        let asked = state.asked(ray);
        let (ray, attributes) = (self.step.ray(state, &asked), &barycentrics(candidate));
        let tlas = self.step.tlas;
        let hit = AnyHit { ray, hit: candidate, attributes, tlas };
        record.any_hit(&hit, &state.payload) != AnyHitResult::Ignore
    }
}

/// Why launches of a tile failed.
#[derive(Clone, Copy)]
enum Failure {
    TooManyRays,
    OtherPipeline,
}

/// The place of a launch in the order of rows.
fn row_order(launch: UVec3) -> (u32, u32, u32) {
    (launch.z, launch.y, launch.x)
}

/// The first launch that failed.
type First = Option<(UVec3, Failure)>;

fn earlier(a: First, b: First) -> First {
    a.into_iter().chain(b).min_by_key(|(launch, _)| row_order(*launch))
}

impl<P: Copy + Send + Sync + 'static> PortablePipeline<'_, P> {
    /// Runs the shaders for every index of a grid of `width × height × depth`, in tiles on the current
    /// thread pool: `generate` gives a launch's payload and first ray, `finish` gets its payload when no
    /// ray is left. Rays are traced in `tlas`.
    ///
    /// If a launch asks for more rays than were declared, or for one of a type of another pipeline, the
    /// others run to the end all the same, that launch is not finished, and the error is that of the first
    /// such one, in the order of rows.
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
        let failures = tiles(dimensions, TILE).map_init(
            || self.queues.lend(),
            |lent, launches| {
                let queue = &mut lent.queue;
                queue.clear();
                launches.for_each(|launch| {
                    let (payload, next) = generate(launch);
                    match next {
                        Next::Done => finish(launch, payload),
                        Next::Trace(request) => {
                            let (state, ray) = State::new(launch, payload, &request);
                            queue.states.push(state);
                            queue.rays.push(ray);
                        }
                    }
                });
                let mut step = Step { tlas, dimensions, depth: 0 };
                let mut first = None;
                while !queue.states.is_empty() {
                    // All have traced as many: none may go on.
                    if step.depth >= self.max_rays {
                        let launches = queue.states.iter().map(|state| state.launch);
                        let launch = launches.min_by_key(|launch| row_order(*launch));
                        return earlier(first, launch.map(|at| (at, Failure::TooManyRays)));
                    }
                    first = earlier(first, self.step(&step, queue));
                    queue.retain(&finish);
                    step.depth += 1;
                }
                first
            },
        );
        match failures.reduce(|| None, earlier) {
            Some((launch, Failure::TooManyRays)) => {
                Err(DispatchError::TooManyRays { launch, limit: self.max_rays })
            }
            Some((launch, Failure::OtherPipeline)) => {
                let payload = std::any::type_name::<P>();
                Err(DispatchError::OtherPipeline { launch, payload })
            }
            None => Ok(()),
        }
    }

    /// Traces the next ray of every launch, and shades what they hit.
    fn step(&self, step: &Step<'_>, queue: &mut Queue<P>) -> First {
        let mut first = None;
        // Rays of different flags cannot share a batch.
        let kind = queue.states[0].kind;
        if queue.states.iter().any(|state| state.kind != kind) {
            first = self.drop_others(queue);
            queue.sort();
        } else if self.ray_type(kind.ray_type()).is_none() {
            first = self.drop_others(queue);
        }
        let Queue { states, rays, hits, attributes, occluded, found, order, ends, all, .. } = queue;
        if hits.len() < states.len() {
            hits.resize(states.len(), Hit::MISS);
            found.resize(states.len(), 0);
            occluded.resize(states.len(), false);
            all.extend(all.len() as u32..states.len() as u32);
            if self.has_intersection {
                attributes.resize(states.len(), [0; 8]);
            }
        }
        let mut start = 0;
        while let Some(kind) = states.get(start).map(|state| state.kind) {
            let count = states[start..].partition_point(|state| state.kind == kind);
            let range = start..start + count;
            start = range.end;
            let part = &states[range.clone()];
            let Some(ray_type) = self.ray_type(kind.ray_type()) else { continue };
            let rays = &rays[range.clone()];
            let batch = Batch { pipeline: self, step: *step, states: part, rays, ray_type };
            let found = &mut found[range.clone()];
            let hits = &mut hits[range.clone()];
            let attributes = attributes.get_mut(range.clone()).unwrap_or_default();
            batch.trace(hits, attributes, &mut occluded[range], found);
        }
        let found = &found[..states.len()];
        // Neighbours mostly find the same shader.
        let changes = found.windows(2).filter(|pair| pair[0] != pair[1]).count();
        let mut members = if changes < found.len() / RUN {
            &all[..found.len()]
        } else {
            group(found, self.hits.len() + self.misses.len() + 1, ends, order);
            &order[..]
        };
        while let Some(&first) = members.first() {
            let shader = found[first as usize] as usize;
            let is_own = |&&i: &&u32| found[i as usize] as usize == shader;
            let count = members.iter().take_while(is_own).count();
            let (own, others) = members.split_at(count);
            members = others;
            let step = *step;
            let mut group = Group { step, states, rays, hits, attributes, members: own };
            match (self.hits.get(shader), self.misses.get(shader.wrapping_sub(self.hits.len()))) {
                (Some(Some(record)), _) if record.has_closest_hit() => {
                    record.closest_hit(&mut group);
                }
                (_, Some(Some(miss))) => (miss.run)(&mut group),
                _ => group.finish(),
            }
        }
        first
    }

    /// Drops the launches whose ray is of another pipeline's type; gives the first of them.
    fn drop_others(&self, queue: &mut Queue<P>) -> First {
        let mut first = None;
        for state in &mut queue.states {
            if self.ray_type(state.kind.ray_type()).is_none() {
                state.done = true;
                first = earlier(first, Some((state.launch, Failure::OtherPipeline)));
            }
        }
        queue.retain(&|_, _| ());
        first
    }
}

impl<P: Copy> Queue<P> {
    fn clear(&mut self) {
        self.states.clear();
        self.rays.clear();
    }

    /// Keeps the launches that go on, in their order, in which neighbours go about the same way; gives away
    /// those that are done.
    fn retain(&mut self, finish: &impl Fn(UVec3, P)) {
        let Self { states, rays, .. } = self;
        let mut kept = 0;
        for index in 0..states.len() {
            let state = &states[index];
            if state.done {
                finish(state.launch, state.payload);
            } else {
                if kept != index {
                    states[kept] = *state;
                    rays[kept] = rays[index];
                }
                kept += 1;
            }
        }
        states.truncate(kept);
        rays.truncate(kept);
    }

    /// Puts launches whose rays are of one kind together.
    fn sort(&mut self) {
        let Self { states, rays, sorted, order, .. } = self;
        order.clear();
        order.extend(0..states.len() as u32);
        order.sort_by_key(|&i| states[i as usize].kind);
        sorted.0.clear();
        sorted.0.extend(order.iter().map(|&i| states[i as usize]));
        sorted.1.clear();
        sorted.1.extend(order.iter().map(|&i| rays[i as usize]));
        std::mem::swap(states, &mut sorted.0);
        std::mem::swap(rays, &mut sorted.1);
    }
}

/// Puts the indices of rays in `order`, those that found the same one of so many shaders together.
fn group(found: &[u32], shaders: usize, ends: &mut Vec<u32>, order: &mut Vec<u32>) {
    order.clear();
    if shaders > found.len() {
        order.extend(0..found.len() as u32);
        order.sort_by_key(|&i| found[i as usize]);
        return;
    }
    ends.clear();
    ends.resize(shaders + 1, 0);
    for &found in found {
        ends[found as usize + 1] += 1;
    }
    for i in 1..ends.len() {
        ends[i] += ends[i - 1];
    }
    order.resize(found.len(), 0);
    for (i, &found) in (0..).zip(found) {
        let end = &mut ends[found as usize];
        order[*end as usize] = i;
        *end += 1;
    }
}

impl<P> Batch<'_, P> {
    /// Traces all rays, which have the same flags, mask and type, and notes which shaders they find.
    fn trace(
        &self,
        hits: &mut [Hit],
        attributes: &mut [Attributes],
        occluded: &mut [bool],
        found: &mut [u32],
    ) {
        let Some(kind) = self.states.first().map(|state| state.kind) else { return };
        let rays = self.rays;
        let (flags, pipeline, tlas) = (kind.flags(), self.pipeline, self.step.tlas);
        let options = flags.options(kind.mask());
        let skips = flags.contains(RayFlags::SKIP_CLOSEST_HIT_SHADER);
        let first = skips && flags.contains(RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH);
        let miss = pipeline.hits.len() as u32 + self.ray_type.miss;
        let nothing = (pipeline.hits.len() + pipeline.misses.len()) as u32;
        if first {
            if pipeline.has_any_hit {
                tlas.any_hits(rays, occluded, &options, self);
            } else {
                tlas.any_hits(rays, occluded, &options, &AcceptAll);
            }
            if pipeline.has_intersection {
                for ((occluded, state), ray) in occluded.iter_mut().zip(self.states).zip(rays) {
                    *occluded = *occluded
                        || self.search(state, ray, &options, true).find(&Hit::MISS).is_some();
                }
            }
            for (found, &occluded) in found.iter_mut().zip(&*occluded) {
                *found = if occluded { nothing } else { miss };
            }
            return;
        }
        if pipeline.has_any_hit {
            tlas.closest_hits(rays, hits, &options, self);
        } else {
            tlas.closest_hits(rays, hits, &options, &AcceptAll);
        }
        if pipeline.has_intersection {
            let launches = self.states.iter().zip(rays);
            for ((hit, words), (state, ray)) in hits.iter_mut().zip(attributes).zip(launches) {
                *words = barycentrics(hit);
                if let Some(nearer) = self.search(state, ray, &options, false).find(hit) {
                    (*hit, *words) = nearer;
                }
            }
        }
        if skips {
            for (found, hit) in found.iter_mut().zip(&*hits) {
                *found = if hit.is_hit() { nothing } else { miss };
            }
            return;
        }
        let (instances, ray_type) = (tlas.instances(), self.ray_type);
        for (found, hit) in found.iter_mut().zip(&*hits) {
            *found = match instances.get(hit.instance as usize) {
                Some(instance) if hit.is_hit() => {
                    ray_type.record(instance.contribution, hit.geometry) as u32
                }
                _ => miss,
            };
        }
    }

    fn search<'b>(
        &'b self,
        state: &'b State<P>,
        traced: &Ray,
        options: &'b TraceOptions,
        first: bool,
    ) -> Search<'b, P> {
        let Self { pipeline, step, ray_type, .. } = *self;
        let ray = state.asked(traced);
        Search { pipeline, step, state, ray, ray_type, options, first }
    }
}
