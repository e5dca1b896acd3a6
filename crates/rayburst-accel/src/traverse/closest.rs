//! The nearest hit; at equal distance the one of smallest indices.

use std::{hint::select_unpredictable, ops::ControlFlow};

use rayburst_math::{Hit, HitKind, Ray};

use super::{
    prepare::{PreparedRay, Span},
    query::{Candidate, OneHit, Pending, Place, Query, settle_candidate},
};

/// The best candidate so far.
#[derive(Clone, Copy)]
pub(crate) struct Closest {
    t: f32,
    u: f32,
    v: f32,
    /// Instance and triangle, in the order in which they win.
    key: u64,
    front: bool,
    /// A better hit, known to the span's end only.
    pending: Pending,
}

/// Comes after every triangle.
const NO_KEY: u64 = u64::MAX;

#[inline(always)]
fn key(candidate: &Candidate, place: &Place<'_>) -> u64 {
    u64::from(place.instance) << 32 | u64::from(candidate.triangle)
}

impl Closest {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Self {
        Self { t: ray.t_max, u: 0.0, v: 0.0, key: NO_KEY, front: false, pending: Pending::NONE }
    }

    /// The hit; `locate` gives the geometry and primitive of an instance's triangle.
    #[inline(always)]
    pub(crate) fn finish(&self, locate: impl FnOnce(u32, u32) -> (u32, u32)) -> Hit {
        if self.key == NO_KEY {
            return Hit::MISS;
        }
        let instance = (self.key >> 32) as u32;
        let (geometry, primitive) = locate(instance, self.key as u32);
        Hit {
            t: self.t,
            u: self.u,
            v: self.v,
            primitive,
            geometry,
            instance,
            kind: if self.front { HitKind::TRIANGLE_FRONT } else { HitKind::TRIANGLE_BACK },
            reserved: 0,
        }
    }
}

impl Query for Closest {
    const ORDERED: bool = true;

    #[inline(always)]
    fn t_max(&self) -> f32 {
        self.t
    }

    #[inline(always)]
    fn wants(&self, candidate: &Candidate, place: &Place<'_>) -> bool {
        candidate.t < self.t || (candidate.t == self.t && key(candidate, place) < self.key)
    }

    #[inline(always)]
    fn take(&mut self, candidate: &Candidate, place: &Place<'_>) -> ControlFlow<()> {
        *self = Self {
            t: candidate.t,
            u: candidate.u,
            v: candidate.v,
            key: key(candidate, place),
            front: candidate.front,
            pending: Pending::NONE,
        };
        ControlFlow::Continue(())
    }
}

/// The first hit that is found.
#[derive(Clone, Copy)]
pub(crate) struct FirstFound(pub(crate) Closest);

impl Query for FirstFound {
    const ORDERED: bool = false;

    #[inline(always)]
    fn t_max(&self) -> f32 {
        self.0.t
    }

    #[inline(always)]
    fn wants(&self, _: &Candidate, _: &Place<'_>) -> bool {
        true
    }

    #[inline(always)]
    fn take(&mut self, candidate: &Candidate, place: &Place<'_>) -> ControlFlow<()> {
        self.0.take(candidate, place)?;
        ControlFlow::Break(())
    }
}

impl OneHit for Closest {
    #[inline(always)]
    fn put_off(&mut self, hit: bool, pending: Pending) -> ControlFlow<()> {
        // Whether a leaf has a hit is as good as random.
        self.pending = select_unpredictable(hit, pending, self.pending);
        ControlFlow::Continue(())
    }

    #[inline(always)]
    fn settle(&mut self, place: &Place<'_>, ray: &PreparedRay, span: &Span) {
        if self.pending != Pending::NONE {
            let candidate = settle_candidate(place, ray, self.pending, span.t_max);
            // Never breaks.
            let _ = self.take(&candidate, place);
        }
    }

    #[inline(always)]
    fn has(&self, triangle: u32, place: &Place<'_>) -> bool {
        if self.pending == Pending::NONE {
            self.key == u64::from(place.instance) << 32 | u64::from(triangle)
        } else {
            self.pending.triangle(place) == triangle
        }
    }

    #[inline(always)]
    fn resume(ray: &Ray, place: &Place<'_>, found: Option<&Candidate>) -> Self {
        let mut query = Self::new(ray);
        if let Some(candidate) = found {
            // Never breaks.
            let _ = query.take(candidate, place);
        }
        query
    }

    #[inline(always)]
    fn found(&self) -> Option<Candidate> {
        (self.key != NO_KEY).then_some(Candidate {
            t: self.t,
            u: self.u,
            v: self.v,
            triangle: self.key as u32,
            front: self.front,
        })
    }
}
