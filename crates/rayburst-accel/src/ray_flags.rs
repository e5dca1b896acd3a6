//! The flags of a ray, as DXR has them.

use bitflags::bitflags;

use crate::{Cull, Skip, TraceOptions};

bitflags! {
    /// What a ray asks for beyond the nearest hit (DXR's `RAY_FLAG`, with its values).
    ///
    /// DXR forbids some pairs; here each flag means what it says beside every other. A ray's flags
    /// override those of instances, which override those of geometries.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub struct RayFlags: u32 {
        /// All geometry is opaque: no any hit shader runs.
        const FORCE_OPAQUE = 0x01;
        /// No geometry is opaque; [`RayFlags::FORCE_OPAQUE`] wins over this one.
        const FORCE_NON_OPAQUE = 0x02;
        /// The first hit that is accepted ends the search.
        const ACCEPT_FIRST_HIT_AND_END_SEARCH = 0x04;
        /// No closest hit shader runs.
        const SKIP_CLOSEST_HIT_SHADER = 0x08;
        /// Triangles seen from the back are skipped.
        const CULL_BACK_FACING_TRIANGLES = 0x10;
        /// Triangles seen from the front are skipped.
        const CULL_FRONT_FACING_TRIANGLES = 0x20;
        /// Opaque geometry is skipped; what is opaque is decided with the overrides.
        const CULL_OPAQUE = 0x40;
        /// Geometry that is not opaque is skipped.
        const CULL_NON_OPAQUE = 0x80;
        /// Triangles are skipped.
        const SKIP_TRIANGLES = 0x100;
        /// Procedural primitives are skipped.
        const SKIP_PROCEDURAL_PRIMITIVES = 0x200;
    }
}

impl RayFlags {
    /// The options of a query that skips what these flags skip.
    pub fn options(self, mask: u8) -> TraceOptions {
        let (back, front) = (Self::CULL_BACK_FACING_TRIANGLES, Self::CULL_FRONT_FACING_TRIANGLES);
        let cull = match (self.contains(back), self.contains(front)) {
            (false, false) => Cull::None,
            (true, false) => Cull::Back,
            (false, true) => Cull::Front,
            (true, true) => Cull::Both,
        };
        let force_opaque = if self.contains(Self::FORCE_OPAQUE) {
            Some(true)
        } else {
            self.contains(Self::FORCE_NON_OPAQUE).then_some(false)
        };
        let skip = Skip {
            opaque: self.contains(Self::CULL_OPAQUE),
            non_opaque: self.contains(Self::CULL_NON_OPAQUE),
            triangles: self.contains(Self::SKIP_TRIANGLES),
            procedural: self.contains(Self::SKIP_PROCEDURAL_PRIMITIVES),
        };
        TraceOptions { mask, cull, force_opaque, skip, ..TraceOptions::default() }
    }
}
