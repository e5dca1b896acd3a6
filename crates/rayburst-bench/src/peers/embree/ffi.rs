//! The part of Embree 4.4's C interface that is used: records, constants and functions.
//!
//! Declared after the public headers' documentation. Since 4.4 the hit records have `instPrimID`
//! after `instID`; one level of instancing is assumed, which is Embree's default.

use std::{
    ffi::{c_char, c_int, c_uint, c_void},
    path::Path,
};

use libloading::Library;

use crate::BenchError;

/// A device, scene or geometry.
pub(super) type Handle = *mut c_void;

/// `RTCRay`.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub(super) struct Ray1 {
    pub(super) origin: [f32; 3],
    pub(super) t_near: f32,
    pub(super) direction: [f32; 3],
    pub(super) time: f32,
    pub(super) t_far: f32,
    pub(super) mask: c_uint,
    pub(super) id: c_uint,
    pub(super) flags: c_uint,
}

/// `RTCRayHit`.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub(super) struct RayHit1 {
    pub(super) ray: Ray1,
    pub(super) normal: [f32; 3],
    pub(super) u: f32,
    pub(super) v: f32,
    pub(super) primitive: c_uint,
    pub(super) geometry: c_uint,
    pub(super) instance: c_uint,
    pub(super) instance_primitive: c_uint,
    padding: [c_uint; 3],
}

/// `RTCRay8` and `RTCRay16`.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct RayPacket<const W: usize> {
    pub(super) origin: [[f32; W]; 3],
    pub(super) t_near: [f32; W],
    pub(super) direction: [[f32; W]; 3],
    pub(super) time: [f32; W],
    pub(super) t_far: [f32; W],
    pub(super) mask: [c_uint; W],
    pub(super) id: [c_uint; W],
    pub(super) flags: [c_uint; W],
}

/// `RTCHit8` and `RTCHit16`.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct HitPacket<const W: usize> {
    pub(super) normal: [[f32; W]; 3],
    pub(super) u: [f32; W],
    pub(super) v: [f32; W],
    pub(super) primitive: [c_uint; W],
    pub(super) geometry: [c_uint; W],
    pub(super) instance: [c_uint; W],
    pub(super) instance_primitive: [c_uint; W],
}

/// `RTCRayHit8` and `RTCRayHit16`.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct RayHitPacket<const W: usize> {
    pub(super) ray: RayPacket<W>,
    pub(super) hit: HitPacket<W>,
}

/// The `valid` argument of the packet functions: -1 for lanes that are traced, 0 for others.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct ValidMask<const W: usize>(pub(super) [c_int; W]);

/// `RTCIntersectArguments` and `RTCOccludedArguments`, which differ in the type of the last callback.
/// The float is there only in builds with `EMBREE_MIN_WIDTH`; others do not look at it.
#[derive(Clone, Copy)]
#[repr(C)]
pub(super) struct Arguments {
    flags: c_int,
    features: c_uint,
    context: *mut c_void,
    filter: *mut c_void,
    callback: *mut c_void,
    minimal_width: f32,
}

impl Arguments {
    /// The defaults, but for rays that are alike.
    pub(super) const COHERENT: Self = Self {
        flags: 1 << 16,
        features: c_uint::MAX,
        context: std::ptr::null_mut(),
        filter: std::ptr::null_mut(),
        callback: std::ptr::null_mut(),
        minimal_width: 0.0,
    };
}

impl Ray1 {
    /// A ray to be filled in; all masks set.
    pub(super) const EMPTY: Self = Self {
        origin: [0.0; 3],
        t_near: 0.0,
        direction: [0.0; 3],
        time: 0.0,
        t_far: 0.0,
        mask: c_uint::MAX,
        id: 0,
        flags: 0,
    };
}

impl RayHit1 {
    /// A ray to be filled in, without a hit.
    pub(super) const EMPTY: Self = Self {
        ray: Ray1::EMPTY,
        normal: [0.0; 3],
        u: 0.0,
        v: 0.0,
        primitive: INVALID_ID,
        geometry: INVALID_ID,
        instance: INVALID_ID,
        instance_primitive: INVALID_ID,
        padding: [0; 3],
    };
}

impl<const W: usize> RayHitPacket<W> {
    /// Rays to be filled in, without hits.
    pub(super) const EMPTY: Self = Self {
        ray: RayPacket {
            origin: [[0.0; W]; 3],
            t_near: [0.0; W],
            direction: [[0.0; W]; 3],
            time: [0.0; W],
            t_far: [0.0; W],
            mask: [c_uint::MAX; W],
            id: [0; W],
            flags: [0; W],
        },
        hit: HitPacket {
            normal: [[0.0; W]; 3],
            u: [0.0; W],
            v: [0.0; W],
            primitive: [INVALID_ID; W],
            geometry: [INVALID_ID; W],
            instance: [INVALID_ID; W],
            instance_primitive: [INVALID_ID; W],
        },
    };
}

/// `RTC_INVALID_GEOMETRY_ID`.
pub(super) const INVALID_ID: c_uint = c_uint::MAX;
/// `RTC_GEOMETRY_TYPE_TRIANGLE`.
pub(super) const GEOMETRY_TRIANGLE: c_int = 0;
/// `RTC_BUFFER_TYPE_INDEX`.
pub(super) const BUFFER_INDEX: c_int = 0;
/// `RTC_BUFFER_TYPE_VERTEX`.
pub(super) const BUFFER_VERTEX: c_int = 1;
/// `RTC_FORMAT_UINT3`.
pub(super) const FORMAT_UINT3: c_int = 0x5003;
/// `RTC_FORMAT_FLOAT3`.
pub(super) const FORMAT_FLOAT3: c_int = 0x9003;
/// `RTC_SCENE_FLAG_DYNAMIC`.
pub(super) const SCENE_DYNAMIC: c_int = 1 << 0;
/// `RTC_SCENE_FLAG_COMPACT`.
pub(super) const SCENE_COMPACT: c_int = 1 << 1;
/// `RTC_SCENE_FLAG_ROBUST`.
pub(super) const SCENE_ROBUST: c_int = 1 << 2;
/// `RTC_BUILD_QUALITY_REFIT`.
pub(super) const QUALITY_REFIT: c_int = 3;

/// `rtcIntersect8` or `rtcIntersect16`.
pub(super) type IntersectPacket<const W: usize> =
    unsafe extern "C" fn(*const ValidMask<W>, Handle, *mut RayHitPacket<W>, *mut Arguments);
/// `rtcOccluded8` or `rtcOccluded16`.
pub(super) type OccludedPacket<const W: usize> =
    unsafe extern "C" fn(*const ValidMask<W>, Handle, *mut RayPacket<W>, *mut Arguments);
/// `RTCMemoryMonitorFunction`.
pub(super) type MemoryMonitor = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;

macro_rules! functions {
    ($($field:ident = $name:literal: $type:ty;)*) => {
        /// The functions that are called.
        #[derive(Clone, Copy)]
        pub(super) struct Functions {
            $(pub(super) $field: $type,)*
        }

        impl Functions {
            /// Looks all of them up.
            pub(super) fn find(library: &Library, path: &Path) -> Result<Self, BenchError> {
                let fail = |e: libloading::Error| BenchError::Peer {
                    path: path.to_owned(),
                    reason: e.to_string(),
                };
                Ok(Self {
                    // SAFETY: the declared types are those of Embree 4's headers.
                    $($field: unsafe { *library.get::<$type>($name).map_err(fail)? },)*
                })
            }
        }
    };
}

functions! {
    new_device = c"rtcNewDevice": unsafe extern "C" fn(*const c_char) -> Handle;
    release_device = c"rtcReleaseDevice": unsafe extern "C" fn(Handle);
    device_error = c"rtcGetDeviceError": unsafe extern "C" fn(Handle) -> c_int;
    memory_monitor = c"rtcSetDeviceMemoryMonitorFunction":
        unsafe extern "C" fn(Handle, MemoryMonitor, *mut c_void);
    new_scene = c"rtcNewScene": unsafe extern "C" fn(Handle) -> Handle;
    release_scene = c"rtcReleaseScene": unsafe extern "C" fn(Handle);
    scene_quality = c"rtcSetSceneBuildQuality": unsafe extern "C" fn(Handle, c_int);
    scene_flags = c"rtcSetSceneFlags": unsafe extern "C" fn(Handle, c_int);
    commit_scene = c"rtcCommitScene": unsafe extern "C" fn(Handle);
    new_geometry = c"rtcNewGeometry": unsafe extern "C" fn(Handle, c_int) -> Handle;
    geometry_quality = c"rtcSetGeometryBuildQuality": unsafe extern "C" fn(Handle, c_int);
    new_buffer = c"rtcSetNewGeometryBuffer":
        unsafe extern "C" fn(Handle, c_int, c_uint, c_int, usize, usize) -> *mut c_void;
    update_buffer = c"rtcUpdateGeometryBuffer": unsafe extern "C" fn(Handle, c_int, c_uint);
    commit_geometry = c"rtcCommitGeometry": unsafe extern "C" fn(Handle);
    attach_geometry = c"rtcAttachGeometry": unsafe extern "C" fn(Handle, Handle) -> c_uint;
    release_geometry = c"rtcReleaseGeometry": unsafe extern "C" fn(Handle);
    intersect1 = c"rtcIntersect1": unsafe extern "C" fn(Handle, *mut RayHit1, *mut Arguments);
    occluded1 = c"rtcOccluded1": unsafe extern "C" fn(Handle, *mut Ray1, *mut Arguments);
    intersect8 = c"rtcIntersect8": IntersectPacket<8>;
    occluded8 = c"rtcOccluded8": OccludedPacket<8>;
    intersect16 = c"rtcIntersect16": IntersectPacket<16>;
    occluded16 = c"rtcOccluded16": OccludedPacket<16>;
}

#[cfg(test)]
mod tests {
    use std::mem::offset_of;

    use super::*;

    #[test]
    fn single_records_have_embrees_layout() {
        assert_eq!((size_of::<Ray1>(), align_of::<Ray1>()), (48, 16));
        assert_eq!((offset_of!(Ray1, direction), offset_of!(Ray1, t_far)), (16, 32));
        assert_eq!((size_of::<RayHit1>(), align_of::<RayHit1>()), (96, 16));
        assert_eq!((offset_of!(RayHit1, normal), offset_of!(RayHit1, u)), (48, 60));
        assert_eq!((offset_of!(RayHit1, primitive), offset_of!(RayHit1, geometry)), (68, 72));
        let instance = offset_of!(RayHit1, instance);
        assert_eq!((instance, offset_of!(RayHit1, instance_primitive)), (76, 80));
    }

    fn packets_have_embrees_layout<const W: usize>() {
        let row = 4 * W;
        assert_eq!(size_of::<RayPacket<W>>(), 12 * row);
        assert_eq!(offset_of!(RayPacket<W>, t_near), 3 * row);
        assert_eq!(offset_of!(RayPacket<W>, direction), 4 * row);
        assert_eq!(offset_of!(RayPacket<W>, time), 7 * row);
        assert_eq!(offset_of!(RayPacket<W>, t_far), 8 * row);
        assert_eq!(offset_of!(RayPacket<W>, mask), 9 * row);
        assert_eq!(offset_of!(RayPacket<W>, id), 10 * row);
        assert_eq!(offset_of!(RayPacket<W>, flags), 11 * row);
        assert_eq!(offset_of!(RayHitPacket<W>, hit), 12 * row);
        assert_eq!(offset_of!(HitPacket<W>, u), 3 * row);
        assert_eq!(offset_of!(HitPacket<W>, v), 4 * row);
        assert_eq!(offset_of!(HitPacket<W>, primitive), 5 * row);
        assert_eq!(offset_of!(HitPacket<W>, geometry), 6 * row);
        assert_eq!(offset_of!(HitPacket<W>, instance), 7 * row);
        assert_eq!(offset_of!(HitPacket<W>, instance_primitive), 8 * row);
        // Embree wants 32 or 64 bytes of alignment.
        assert!(align_of::<RayHitPacket<W>>() >= row && align_of::<ValidMask<W>>() >= row);
        assert!(size_of::<RayHitPacket<W>>() >= 21 * row);
    }

    #[test]
    fn packet_records_have_embrees_layout() {
        packets_have_embrees_layout::<8>();
        packets_have_embrees_layout::<16>();
    }

    #[test]
    fn arguments_have_embrees_layout() {
        let offsets = [
            offset_of!(Arguments, flags),
            offset_of!(Arguments, features),
            offset_of!(Arguments, context),
            offset_of!(Arguments, filter),
            offset_of!(Arguments, callback),
        ];
        assert_eq!(offsets, [0, 4, 8, 16, 24]);
    }
}
