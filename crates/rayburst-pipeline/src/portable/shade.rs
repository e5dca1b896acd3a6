//! Launches on their way, and running a shader for those of them that found it.

use glam::UVec3;
use rayburst_accel::{RayFlags, Tlas};
use rayburst_math::{Hit, Ray};

use super::{Next, PortableRay, TraceRequest};
use crate::procedural::Attributes;

/// What rays must share to be traced in one batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Kind {
    pub(super) ray_type: u32,
    pub(super) flags: u32,
    pub(super) mask: u8,
}

impl Kind {
    pub(super) fn flags(self) -> RayFlags {
        RayFlags::from_bits_retain(self.flags)
    }
}

/// A launch on its way.
#[derive(Clone, Copy)]
pub(super) struct State<P> {
    pub(super) ray: Ray,
    pub(super) launch: UVec3,
    pub(super) kind: Kind,
    /// Whether no ray is left to trace.
    pub(super) done: bool,
    pub(super) payload: P,
}

impl<P> State<P> {
    #[inline(always)]
    pub(super) fn new(launch: UVec3, payload: P, request: TraceRequest) -> Self {
        let TraceRequest { ray_type, flags, mask, ray } = request;
        let kind = Kind { ray_type: ray_type.key, flags: flags.bits(), mask };
        Self { ray, launch, kind, done: false, payload }
    }
}

/// What is the same for all rays of a step.
#[derive(Clone, Copy)]
pub(super) struct Step<'a> {
    pub(super) tlas: &'a Tlas,
    pub(super) dimensions: UVec3,
    /// Rays that every launch has traced before.
    pub(super) depth: u32,
}

impl Step<'_> {
    /// What shaders see of a launch.
    #[inline(always)]
    pub(super) fn ray<'a, P>(&self, state: &'a State<P>) -> PortableRay<'a> {
        PortableRay {
            launch_index: state.launch,
            launch_dimensions: self.dimensions,
            ray: &state.ray,
            depth: self.depth,
        }
    }
}

/// Launches whose rays found the same shader.
pub(super) struct Group<'a, P> {
    pub(super) step: Step<'a>,
    pub(super) states: &'a mut [State<P>],
    pub(super) hits: &'a [Hit],
    /// Of all hits if there may be others than of triangles.
    pub(super) attributes: &'a [Attributes],
    /// Which of the launches.
    pub(super) members: &'a [u32],
}

impl<P: Copy> Group<'_, P> {
    /// Runs a shader for each of them, given the place of its hit. One call a group, in which the shader is
    /// inlined.
    #[inline(always)]
    pub(super) fn run(&mut self, shader: impl Fn(PortableRay<'_>, usize, P) -> (P, Next)) {
        for &member in self.members {
            let index = member as usize;
            let state = &mut self.states[index];
            let (payload, next) = shader(self.step.ray(state), index, state.payload);
            match next {
                Next::Done => {
                    state.payload = payload;
                    state.done = true;
                }
                Next::Trace(request) => *state = State::new(state.launch, payload, request),
            }
        }
    }

    /// All of them are done as they are.
    pub(super) fn finish(&mut self) {
        for &member in self.members {
            self.states[member as usize].done = true;
        }
    }
}
