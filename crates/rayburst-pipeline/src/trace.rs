//! `TraceRay`: from a ray to the shaders that run.

use std::{
    any::Any,
    cell::{Cell, RefCell},
};

use glam::Vec4;
use rayburst_accel::{AcceptAll, CandidateFilter, RayFlags};
use rayburst_math::{Hit, HitKind, Ray};

use crate::{
    AnyHitResult, DispatchError,
    call::{Call, TracedRay},
    context::Miss,
    hit_group::HitRecord,
    procedural,
    table::RayTypeInfo,
};

/// What is in cache lines of its own, wherever the stack is: kernels read rays as a whole.
#[repr(align(64))]
struct Aligned<T>(T);

/// What the search for a hit knows.
pub(crate) struct Search<'a> {
    pub(crate) call: Call<'a>,
    pub(crate) ray: &'a TracedRay,
    pub(crate) ray_type: &'a RayTypeInfo,
}

impl<'a> Search<'a> {
    /// The hit group of a geometry of an instance, by DXR's formula.
    #[inline]
    pub(crate) fn record(&self, instance: u32, geometry: u32) -> Option<&'a (dyn HitRecord + 'a)> {
        let contribution = self.call.dispatch.tlas.instances()[instance as usize].contribution;
        let index = self.ray_type.record(contribution, geometry);
        self.call.dispatch.pipeline.hits.get(index as usize)?.as_deref()
    }
}

/// Asks any hit shaders about candidates.
struct AnyHitFilter<'a, 'p> {
    search: &'a Search<'a>,
    payload: RefCell<&'p mut dyn Any>,
    ends: Cell<bool>,
    /// Candidates of geometry that must not ask twice, where that could happen.
    asked: RefCell<Vec<[u32; 3]>>,
}

impl AnyHitFilter<'_, '_> {
    /// Whether a candidate was asked about before and must not be again.
    fn is_repeated(&self, candidate: &Hit) -> bool {
        let tlas = self.search.call.dispatch.tlas;
        let instance = &tlas.instances()[candidate.instance as usize];
        let blas = &tlas.blases()[instance.blas as usize];
        if !blas.may_ask_twice()
            || !blas.geometries()[candidate.geometry as usize].no_duplicate_any_hit
        {
            return false;
        }
        let key = [candidate.instance, candidate.geometry, candidate.primitive];
        let mut asked = self.asked.borrow_mut();
        let repeated = asked.contains(&key);
        if !repeated {
            asked.push(key);
        }
        repeated
    }
}

impl CandidateFilter for AnyHitFilter<'_, '_> {
    const ENDS: bool = true;

    fn accept(&self, _: u32, _: &Ray, candidate: &Hit) -> bool {
        let record = self.search.record(candidate.instance, candidate.geometry);
        let Some(record) = record.filter(|record| record.has_any_hit()) else {
            return true;
        };
        // What was accepted before has shortened the interval: only what was ignored comes again.
        if self.is_repeated(candidate) {
            return false;
        }
        let mut payload = self.payload.borrow_mut();
        let words = procedural::barycentrics(candidate);
        let result =
            record.any_hit(&self.search.call, self.search.ray, candidate, &words, &mut **payload);
        self.ends.set(result == AnyHitResult::AcceptAndEndSearch);
        result != AnyHitResult::Ignore
    }

    fn ends(&self) -> bool {
        self.ends.get()
    }
}

/// Traces a ray and runs its shaders.
pub(crate) fn trace_ray(
    call: &Call<'_>,
    ray_type: &RayTypeInfo,
    flags: RayFlags,
    mask: u8,
    ray: &Ray,
    payload: &mut dyn Any,
) {
    let pipeline = call.dispatch.pipeline;
    if call.remaining_depth() == 0 {
        let limit = pipeline.max_recursion_depth;
        return call.fail(|launch| DispatchError::RecursionDepth { launch, limit });
    }
    let traced = Aligned(TracedRay { ray: *ray, flags });
    let traced = &traced.0;
    let search = Search { call: Call { depth: call.depth + 1, ..*call }, ray: traced, ray_type };
    let mut ended = false;
    let mut hit = find_triangle(&search, mask, payload, &mut ended);
    let mut words = procedural::barycentrics(&hit);
    if pipeline.has_intersection
        && !(ended && hit.is_hit())
        && let Some((nearer, attributes)) = procedural::find(&search, mask, &hit, payload)
    {
        (hit, words) = (nearer, attributes);
    }
    if hit.is_hit() {
        if !flags.contains(RayFlags::SKIP_CLOSEST_HIT_SHADER)
            && let Some(record) = search.record(hit.instance, hit.geometry)
        {
            record.closest_hit(&search.call, traced, &hit, &words, payload);
        }
    } else if let Some(Some(miss)) = pipeline.misses.get(ray_type.miss as usize) {
        (miss.run)(&Miss { call: &search.call, ray: traced }, payload);
    }
}

/// A ray whose closed interval holds what is in the open one, as DXR's is for triangles.
///
/// Ends at zero move by more than a bit: subnormal numbers would make every ray slower.
pub(crate) fn open(ray: &Ray) -> Ray {
    /// Below this `t` is as good as zero (2⁻¹⁰⁰).
    const LEAST: f32 = f32::from_bits((127 - 100) << 23);
    // Without branches, other than the methods of `f32`, and the same but for a start at ∞ and an end
    // at −∞, between which there is nothing either way.
    let next = |t: f32, is_up: bool| {
        let step = if t.is_sign_negative() == is_up { u32::MAX } else { 1 };
        let next = f32::from_bits(t.to_bits().wrapping_add(step));
        if t.is_nan() { t } else { next }
    };
    let t_min = if ray.t_min.abs() < LEAST { LEAST } else { next(ray.t_min, true) };
    let t_max = if ray.t_max.abs() < LEAST { -LEAST } else { next(ray.t_max, false) };
    // In halves, as kernels read it: what was written in smaller parts would wait for memory.
    let [mut origin, mut direction]: [Vec4; 2] = bytemuck::cast(*ray);
    (origin.w, direction.w) = (t_min, t_max);
    bytemuck::cast([origin, direction])
}

/// Stands for a hit of which only is known that there is one, and nobody asks for more.
const SOME_HIT: Hit = Hit { kind: HitKind(u32::MAX), ..Hit::MISS };

fn some_hit(found: bool) -> Hit {
    if found { SOME_HIT } else { Hit::MISS }
}

/// The triangle that a ray stops at; notes whether that ends the search.
fn find_triangle(search: &Search<'_>, mask: u8, payload: &mut dyn Any, ended: &mut bool) -> Hit {
    let (tlas, ray) = (search.call.dispatch.tlas, &search.ray.ray);
    let options = search.ray.flags.options(mask);
    let ray = &Aligned(open(ray)).0;
    let first = search.ray.flags.contains(RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH);
    // No shader sees the hit.
    let any = first && search.ray.flags.contains(RayFlags::SKIP_CLOSEST_HIT_SHADER);
    if !search.call.dispatch.pipeline.has_any_hit {
        *ended = first;
        return if any {
            some_hit(tlas.any_hit(ray, &options, &AcceptAll))
        } else if first {
            tlas.first_hit(ray, &options, &AcceptAll)
        } else {
            tlas.closest_hit(ray, &options, &AcceptAll)
        };
    }
    let filter = AnyHitFilter {
        search,
        payload: RefCell::new(payload),
        ends: Cell::new(false),
        asked: RefCell::new(Vec::new()),
    };
    let hit = if any {
        some_hit(tlas.any_hit(ray, &options, &filter))
    } else if first {
        tlas.first_hit(ray, &options, &filter)
    } else {
        tlas.closest_hit(ray, &options, &filter)
    };
    *ended = first || filter.ends.get();
    hit
}
