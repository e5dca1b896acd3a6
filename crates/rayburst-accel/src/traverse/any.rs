//! Whether there is a hit: the first one found ends the search.

use std::ops::ControlFlow;

use rayburst_math::Ray;

use super::{
    prepare::{PreparedRay, Span},
    query::{Candidate, OneHit, Pending, Place, Query},
};

/// Whether something was hit.
#[derive(Clone, Copy)]
pub(crate) struct Any {
    t_max: f32,
    pub(crate) found: bool,
}

impl Any {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Self {
        Self { t_max: ray.t_max, found: false }
    }
}

impl Query for Any {
    const ORDERED: bool = false;

    #[inline(always)]
    fn t_max(&self) -> f32 {
        self.t_max
    }

    #[inline(always)]
    fn wants(&self, _: &Candidate, _: &Place<'_>) -> bool {
        true
    }

    #[inline(always)]
    fn take(&mut self, _: &Candidate, _: &Place<'_>) -> ControlFlow<()> {
        self.found = true;
        ControlFlow::Break(())
    }
}

impl OneHit for Any {
    #[inline(always)]
    fn put_off(&mut self, hit: bool, _: Pending) -> ControlFlow<()> {
        self.found |= hit;
        if hit { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    #[inline(always)]
    fn settle(&mut self, _: &Place<'_>, _: &PreparedRay, _: &Span) {}

    #[inline(always)]
    fn has(&self, _: u32, _: &Place<'_>) -> bool {
        false
    }

    #[inline(always)]
    fn resume(ray: &Ray, _: &Place<'_>, found: Option<&Candidate>) -> Self {
        Self { t_max: ray.t_max, found: found.is_some() }
    }

    #[inline(always)]
    fn found(&self) -> Option<Candidate> {
        self.found.then_some(Candidate { t: self.t_max, u: 0.0, v: 0.0, triangle: 0, front: true })
    }
}
