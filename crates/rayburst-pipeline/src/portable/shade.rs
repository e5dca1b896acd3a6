//! Launches on their way, and running a shader for those of them that found it.

use glam::UVec3;
use rayburst_accel::{RayFlags, Tlas};
use rayburst_math::{Hit, Ray};

use super::{Next, PortableRay, TraceRequest};
use crate::{procedural::Attributes, trace::open};

/// What rays must share to be traced in one batch, in one word: the ray type's key, the flags, the mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Kind(u64);

impl Kind {
    #[inline(always)]
    pub(super) fn of(request: &TraceRequest) -> Self {
        // What else is in the bits of flags means nothing.
        let flags = u64::from(request.flags.bits() & RayFlags::all().bits());
        Self(u64::from(request.ray_type.key) << 32 | flags << 8 | u64::from(request.mask))
    }

    pub(super) fn ray_type(self) -> u32 {
        (self.0 >> 32) as u32
    }

    pub(super) fn flags(self) -> RayFlags {
        RayFlags::from_bits_truncate((self.0 as u32) >> 8)
    }

    pub(super) fn mask(self) -> u8 {
        self.0 as u8
    }
}

/// A launch on its way; its ray is beside it, as it is traced.
#[derive(Clone, Copy)]
pub(super) struct State<P> {
    /// The interval that was asked for.
    t_min: f32,
    t_max: f32,
    pub(super) launch: UVec3,
    pub(super) kind: Kind,
    /// Whether no ray is left to trace.
    pub(super) done: bool,
    pub(super) payload: P,
}

impl<P> State<P> {
    /// The launch, and its ray as it is traced.
    #[inline(always)]
    pub(super) fn new(launch: UVec3, payload: P, request: &TraceRequest) -> (Self, Ray) {
        let (Ray { t_min, t_max, .. }, kind) = (request.ray, Kind::of(request));
        (Self { t_min, t_max, launch, kind, done: false, payload }, open(&request.ray))
    }

    /// The ray that was asked for, given how it is traced.
    #[inline(always)]
    pub(super) fn asked(&self, traced: &Ray) -> Ray {
        Ray { t_min: self.t_min, t_max: self.t_max, ..*traced }
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
    /// What shaders see of a launch and the ray that it asked for.
    #[inline(always)]
    pub(super) fn ray<'a, P>(&self, state: &State<P>, ray: &'a Ray) -> PortableRay<'a> {
        PortableRay {
            launch_index: state.launch,
            launch_dimensions: self.dimensions,
            ray,
            depth: self.depth,
        }
    }
}

/// Launches whose rays found the same shader.
pub(super) struct Group<'a, P> {
    pub(super) step: Step<'a>,
    pub(super) states: &'a mut [State<P>],
    pub(super) rays: &'a mut [Ray],
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
            let (state, ray) = (&mut self.states[index], &mut self.rays[index]);
            let asked = state.asked(ray);
            let (payload, next) = shader(self.step.ray(state, &asked), index, state.payload);
            match next {
                Next::Done => {
                    state.payload = payload;
                    state.done = true;
                }
                Next::Trace(request) => {
                    (*state, *ray) = State::new(state.launch, payload, &request);
                }
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
