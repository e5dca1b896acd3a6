//! What a query takes besides rays, and what it gives besides hits.

use bytemuck::{Pod, Zeroable};
use rayburst_math::{Hit, Ray};

/// Which triangles are skipped by the side they show to the ray's origin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Cull {
    /// None.
    #[default]
    None,
    /// Those seen from the front.
    Front,
    /// Those seen from the back.
    Back,
    /// All, but in instances that disable culling.
    Both,
}

impl Cull {
    #[inline(always)]
    pub(crate) fn skips_front(self) -> bool {
        matches!(self, Self::Front | Self::Both)
    }

    #[inline(always)]
    pub(crate) fn skips_back(self) -> bool {
        matches!(self, Self::Back | Self::Both)
    }
}

/// What is skipped as if it were not there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Skip {
    /// Geometry that is opaque, after all that overrides it.
    pub opaque: bool,
    /// Geometry that is not.
    pub non_opaque: bool,
    /// Triangles.
    pub triangles: bool,
    /// Procedural primitives.
    pub procedural: bool,
}

impl Skip {
    /// Nothing.
    pub const NONE: Self =
        Self { opaque: false, non_opaque: false, triangles: false, procedural: false };

    /// Whether a triangle is skipped, given whether it is opaque.
    #[inline(always)]
    pub(crate) fn skips(self, opaque: bool) -> bool {
        if opaque { self.opaque } else { self.non_opaque }
    }
}

/// How the rays of a batch are traced. Answers do not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum TraceMode {
    /// What suits the rays, decided by looking at them.
    #[default]
    Auto,
    /// One ray after another.
    Single,
    /// Several rays in flight, a node at a time each: hides the latency of memory.
    Interleaved,
    /// Bundles of up to 64 consecutive rays of alike directions, which visit nodes together; the rest
    /// interleaved, and all rays among several instances.
    Packet,
    /// Interleaved too, but first sorted by where they start and where they go, 65,536 at a time, so
    /// that rays in flight need the same memory. [`TraceMode::Auto`] never does so: the sort takes
    /// longer than it saves.
    Stream,
}

/// Options of a query, the same for all rays of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TraceOptions {
    /// Instances whose mask shares no bit with this one are skipped.
    pub mask: u8,
    /// Which faces are skipped.
    pub cull: Cull,
    /// How batches are traced.
    pub mode: TraceMode,
    /// Overrides the opacity of instances and geometries.
    pub force_opaque: Option<bool>,
    /// What else is skipped. Batches that skip by opacity are traced one ray after another.
    pub skip: Skip,
}

impl TraceOptions {
    /// Everything can be hit, as it says itself.
    pub const DEFAULT: Self = Self {
        mask: 0xFF,
        cull: Cull::None,
        mode: TraceMode::Auto,
        force_opaque: None,
        skip: Skip::NONE,
    };
}

impl Default for TraceOptions {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Decides in the middle of a traversal whether a ray stops at a candidate (alpha).
///
/// Called only for geometry that is not opaque. The order of calls is unspecified, so an answer must
/// depend on the arguments alone; any closure `Fn(u32, &Ray, &Hit) -> bool` is a filter in
/// [`FilterFn`].
pub trait CandidateFilter {
    /// Whether the filter is ever asked; if not, the kernels hold no trace of it.
    const ACTIVE: bool = true;
    /// Whether [`CandidateFilter::ends`] is ever asked.
    const ENDS: bool = false;

    /// Whether the candidate counts as a hit. `ray_index` is the ray's index in its batch, `ray` the
    /// ray as given (in world space).
    fn accept(&self, ray_index: u32, ray: &Ray, candidate: &Hit) -> bool;

    /// Whether the search of a single ray ends at the candidate that was just accepted (DXR's
    /// `AcceptHitAndEndSearch`). Batches do not ask: they go on to the nearest hit.
    fn ends(&self) -> bool {
        false
    }
}

/// The filter that lets everything stop rays, at no cost.
#[derive(Clone, Copy, Debug, Default)]
pub struct AcceptAll;

impl CandidateFilter for AcceptAll {
    const ACTIVE: bool = false;

    #[inline(always)]
    fn accept(&self, _: u32, _: &Ray, _: &Hit) -> bool {
        true
    }
}

/// A closure as a filter.
#[derive(Clone, Copy, Debug)]
pub struct FilterFn<F>(pub F);

impl<F: Fn(u32, &Ray, &Hit) -> bool> CandidateFilter for FilterFn<F> {
    #[inline]
    fn accept(&self, ray_index: u32, ray: &Ray, candidate: &Hit) -> bool {
        (self.0)(ray_index, ray, candidate)
    }
}

impl<T: CandidateFilter> CandidateFilter for &T {
    const ACTIVE: bool = T::ACTIVE;
    const ENDS: bool = T::ENDS;

    #[inline]
    fn accept(&self, ray_index: u32, ray: &Ray, candidate: &Hit) -> bool {
        (**self).accept(ray_index, ray, candidate)
    }

    #[inline(always)]
    fn ends(&self) -> bool {
        (**self).ends()
    }
}

/// What a ray visited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Counters {
    /// Inner nodes, of the TLAS and of BLASes.
    pub nodes: u32,
    /// Leaves of BLASes.
    pub leaves: u32,
    /// Triangles tested.
    pub triangles: u32,
    /// Instances entered.
    pub instances: u32,
    /// Those of `nodes` that were visited with a bundle of rays.
    pub packet_nodes: u32,
    /// Rays on their way, this one included, summed over its visits of nodes and leaves: those in
    /// flight at a time, or those of the bundle that made the visit together.
    pub in_flight: u32,
}

impl Counters {
    /// The share of node visits that were a bundle's, from 0 to 1; 0 without any.
    pub fn packet_share(&self) -> f32 {
        self.packet_nodes as f32 / self.nodes.max(1) as f32
    }

    /// Rays on their way at a visit, on average: 1 if the ray was alone, 0 if it visited nothing.
    pub fn mean_in_flight(&self) -> f32 {
        self.in_flight as f32 / (self.nodes + self.leaves).max(1) as f32
    }
}

/// All hits of a batch: those of ray `i` are `hits[offsets[i]..offsets[i + 1]]`, nearest first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AllHits {
    /// Where each ray's hits start, and the end of the last one's.
    pub offsets: Vec<usize>,
    /// The hits.
    pub hits: Vec<Hit>,
}

impl AllHits {
    /// The hits of a ray.
    pub fn of(&self, ray: usize) -> &[Hit] {
        &self.hits[self.offsets[ray]..self.offsets[ray + 1]]
    }
}
