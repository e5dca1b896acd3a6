//! What a running shader is part of: a dispatch, a place in its grid, a depth.

use std::{
    any::Any,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

use glam::UVec3;
use rayburst_accel::{RayFlags, Tlas};
use rayburst_math::Ray;

use crate::{Callable, CallableId, DispatchError, Pipeline};

/// How deep callable shaders may call each other.
pub(crate) const MAX_CALLABLE_DEPTH: u32 = 31;

/// One call of `dispatch_rays`.
pub(crate) struct Dispatch<'a> {
    pub(crate) pipeline: &'a Pipeline<'a>,
    pub(crate) tlas: &'a Tlas,
    pub(crate) dimensions: UVec3,
    pub(crate) failure: Failure,
}

/// The failure of the first launch that fails, whichever thread it runs on.
#[derive(Default)]
pub(crate) struct Failure {
    failed: AtomicBool,
    first: Mutex<Option<(u64, DispatchError)>>,
}

impl Failure {
    /// Notes why a launch fails.
    #[cold]
    fn note(&self, launch: u64, error: DispatchError) {
        self.failed.store(true, Ordering::Relaxed);
        let mut first = self.first.lock().unwrap_or_else(PoisonError::into_inner);
        if first.as_ref().is_none_or(|(earlier, _)| launch < *earlier) {
            *first = Some((launch, error));
        }
    }

    /// What was noted of the first launch that failed.
    pub(crate) fn into_result(self) -> Result<(), DispatchError> {
        match self.first.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some((_, error)) => Err(error),
            None => Ok(()),
        }
    }
}

/// A running shader.
#[derive(Clone, Copy)]
pub(crate) struct Call<'a> {
    pub(crate) dispatch: &'a Dispatch<'a>,
    pub(crate) launch_index: UVec3,
    /// Rays that are being traced around this call.
    pub(crate) depth: u32,
    /// Callable shaders that are running around this call.
    pub(crate) callable_depth: u32,
}

impl<'a> Call<'a> {
    pub(crate) fn remaining_depth(&self) -> u32 {
        self.dispatch.pipeline.max_recursion_depth.saturating_sub(self.depth)
    }

    /// Makes the dispatch fail.
    #[cold]
    pub(crate) fn fail(&self, error: impl FnOnce(UVec3) -> DispatchError) {
        let ([x, y, z], [width, height, _]) =
            (self.launch_index.to_array(), self.dispatch.dimensions.to_array());
        let row = u64::from(z) * u64::from(height) + u64::from(y);
        let launch = row * u64::from(width) + u64::from(x);
        self.dispatch.failure.note(launch, error(self.launch_index));
    }

    /// The payload as the type that a shader was written for.
    pub(crate) fn payload<'p, P: 'static>(&self, payload: &'p mut dyn Any) -> Option<&'p mut P> {
        let payload = payload.downcast_mut();
        if payload.is_none() {
            let expected = std::any::type_name::<P>();
            self.fail(|launch| DispatchError::OtherPayload { launch, expected });
        }
        payload
    }
}

/// A ray as it was traced.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TracedRay {
    pub(crate) ray: Ray,
    pub(crate) flags: RayFlags,
}

/// Runs a callable shader.
pub(crate) fn call_shader<D: 'static>(call: &Call<'_>, shader: CallableId<D>, data: &mut D) {
    if call.callable_depth >= MAX_CALLABLE_DEPTH {
        return call.fail(|launch| DispatchError::CallableDepth { launch });
    }
    let pipeline = call.dispatch.pipeline;
    let Some(shader) = pipeline.callables.get(pipeline.identity.index(shader.key)) else {
        let data = std::any::type_name::<D>();
        return call.fail(|launch| DispatchError::OtherCallable { launch, data });
    };
    let inner = Call { callable_depth: call.callable_depth + 1, ..*call };
    (shader.run)(&Callable { call: inner }, data);
}
