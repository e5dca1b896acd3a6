//! Embree 4, through its shared library.
//!
//! The few functions and records that are used are declared here after Embree's public API manual
//! (4.x); 4.4's `RTCHit` has `instPrimID` after `instID`, so a ray with its hit takes 96 bytes.

use std::{
    ffi::{CString, c_char, c_int, c_uint, c_void},
    path::Path,
    sync::Arc,
};

use libloading::Library;
use rayburst_math::{Hit, HitKind, Ray};

use crate::{Engine, FlatMesh, Query, rays::BenchError};

type Handle = *mut c_void;

/// `RTCRay`.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
struct RtcRay {
    origin: [f32; 3],
    t_near: f32,
    direction: [f32; 3],
    time: f32,
    t_far: f32,
    mask: c_uint,
    id: c_uint,
    flags: c_uint,
}

/// `RTCRayHit`.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
struct RtcRayHit {
    ray: RtcRay,
    normal: [f32; 3],
    u: f32,
    v: f32,
    primitive: c_uint,
    geometry: c_uint,
    instance: c_uint,
    instance_primitive: c_uint,
    padding: [c_uint; 3],
}

const INVALID_ID: c_uint = c_uint::MAX;
const GEOMETRY_TRIANGLE: c_int = 0;
const BUFFER_INDEX: c_int = 0;
const BUFFER_VERTEX: c_int = 1;
const FORMAT_UINT3: c_int = 0x5003;
const FORMAT_FLOAT3: c_int = 0x9003;
const SCENE_ROBUST: c_int = 1 << 2;

/// Build qualities of Embree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum Quality {
    /// Binned surface area heuristic.
    Medium = 1,
    /// With spatial splits.
    High = 2,
}

/// The functions that are called.
#[derive(Clone, Copy)]
struct Functions {
    new_device: unsafe extern "C" fn(*const c_char) -> Handle,
    release_device: unsafe extern "C" fn(Handle),
    device_error: unsafe extern "C" fn(Handle) -> c_int,
    new_scene: unsafe extern "C" fn(Handle) -> Handle,
    release_scene: unsafe extern "C" fn(Handle),
    scene_quality: unsafe extern "C" fn(Handle, c_int),
    scene_flags: unsafe extern "C" fn(Handle, c_int),
    commit_scene: unsafe extern "C" fn(Handle),
    new_geometry: unsafe extern "C" fn(Handle, c_int) -> Handle,
    geometry_quality: unsafe extern "C" fn(Handle, c_int),
    new_buffer: unsafe extern "C" fn(Handle, c_int, c_uint, c_int, usize, usize) -> *mut c_void,
    commit_geometry: unsafe extern "C" fn(Handle),
    attach_geometry: unsafe extern "C" fn(Handle, Handle) -> c_uint,
    release_geometry: unsafe extern "C" fn(Handle),
    intersect1: unsafe extern "C" fn(Handle, *mut RtcRayHit, *mut c_void),
    occluded1: unsafe extern "C" fn(Handle, *mut RtcRay, *mut c_void),
}

/// The loaded library with a device.
pub struct Embree {
    functions: Functions,
    device: Handle,
    /// Keeps the functions' code mapped.
    _library: Library,
}

// SAFETY: Embree's devices and committed scenes may be used from any thread (API manual, "Thread
// Safety"); the functions are plain addresses.
unsafe impl Send for Embree {}
// SAFETY: as above.
unsafe impl Sync for Embree {}

impl Embree {
    /// Loads the library at `path` and opens a device that builds with `threads` threads.
    pub fn load(path: &Path, threads: usize) -> Result<Arc<Self>, BenchError> {
        let fail = |reason: String| BenchError::Peer { path: path.to_owned(), reason };
        // SAFETY: the user names Embree's library; its initialisers have no preconditions.
        let library = unsafe { Library::new(path) }.map_err(|e| fail(e.to_string()))?;
        macro_rules! function {
            ($name:literal) => {{
                // SAFETY: the declared types are those of Embree 4's API manual.
                *unsafe { library.get(concat!($name, "\0").as_bytes()) }
                    .map_err(|e| fail(e.to_string()))?
            }};
        }
        let functions = Functions {
            new_device: function!("rtcNewDevice"),
            release_device: function!("rtcReleaseDevice"),
            device_error: function!("rtcGetDeviceError"),
            new_scene: function!("rtcNewScene"),
            release_scene: function!("rtcReleaseScene"),
            scene_quality: function!("rtcSetSceneBuildQuality"),
            scene_flags: function!("rtcSetSceneFlags"),
            commit_scene: function!("rtcCommitScene"),
            new_geometry: function!("rtcNewGeometry"),
            geometry_quality: function!("rtcSetGeometryBuildQuality"),
            new_buffer: function!("rtcSetNewGeometryBuffer"),
            commit_geometry: function!("rtcCommitGeometry"),
            attach_geometry: function!("rtcAttachGeometry"),
            release_geometry: function!("rtcReleaseGeometry"),
            intersect1: function!("rtcIntersect1"),
            occluded1: function!("rtcOccluded1"),
        };
        let config = CString::new(format!("threads={threads},hugepages=1"))
            .map_err(|e| fail(e.to_string()))?;
        // SAFETY: the configuration is a terminated string that outlives the call.
        let device = unsafe { (functions.new_device)(config.as_ptr()) };
        if device.is_null() {
            return Err(fail("rtcNewDevice gave no device".into()));
        }
        Ok(Arc::new(Self { functions, device, _library: library }))
    }

    /// Builds a scene of one mesh.
    pub fn build(
        self: &Arc<Self>,
        mesh: &FlatMesh,
        quality: Quality,
        robust: bool,
    ) -> Result<EmbreeScene, BenchError> {
        let f = &self.functions;
        // SAFETY: the handles are live and used as the API manual says; each buffer that Embree
        // allocates holds the requested items (and its own padding) until the geometry is released.
        let (scene, error) = unsafe {
            let geometry = (f.new_geometry)(self.device, GEOMETRY_TRIANGLE);
            let vertices =
                (f.new_buffer)(geometry, BUFFER_VERTEX, 0, FORMAT_FLOAT3, 12, mesh.positions.len());
            let indices =
                (f.new_buffer)(geometry, BUFFER_INDEX, 0, FORMAT_UINT3, 12, mesh.indices.len());
            if !vertices.is_null() && !indices.is_null() {
                let from = mesh.positions.as_ptr().cast::<u8>();
                from.copy_to_nonoverlapping(vertices.cast(), mesh.positions.len() * 12);
                let from = mesh.indices.as_ptr().cast::<u8>();
                from.copy_to_nonoverlapping(indices.cast(), mesh.indices.len() * 12);
            }
            (f.geometry_quality)(geometry, quality as c_int);
            (f.commit_geometry)(geometry);
            let scene = (f.new_scene)(self.device);
            (f.scene_quality)(scene, quality as c_int);
            (f.scene_flags)(scene, if robust { SCENE_ROBUST } else { 0 });
            (f.attach_geometry)(scene, geometry);
            (f.release_geometry)(geometry);
            (f.commit_scene)(scene);
            (scene, (f.device_error)(self.device))
        };
        let built = EmbreeScene { embree: self.clone(), scene, quality, robust };
        if error != 0 {
            return Err(BenchError::Peer {
                path: "libembree4".into(),
                reason: format!("error {error} while building"),
            });
        }
        Ok(built)
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        // SAFETY: the device is live and released once; scenes hold the library through an `Arc`.
        unsafe { (self.functions.release_device)(self.device) }
    }
}

/// A committed Embree scene.
pub struct EmbreeScene {
    embree: Arc<Embree>,
    scene: Handle,
    quality: Quality,
    robust: bool,
}

// SAFETY: committed scenes may be traced from any thread.
unsafe impl Send for EmbreeScene {}
// SAFETY: as above.
unsafe impl Sync for EmbreeScene {}

impl Drop for EmbreeScene {
    fn drop(&mut self) {
        // SAFETY: the scene is live and released once, before its device.
        unsafe { (self.embree.functions.release_scene)(self.scene) }
    }
}

fn rtc_ray(ray: &Ray) -> RtcRay {
    RtcRay {
        origin: ray.origin.to_array(),
        t_near: ray.t_min,
        direction: ray.direction.to_array(),
        time: 0.0,
        t_far: ray.t_max,
        mask: c_uint::MAX,
        id: 0,
        flags: 0,
    }
}

impl Engine for EmbreeScene {
    fn name(&self) -> String {
        let quality = match self.quality {
            Quality::Medium => "medium",
            Quality::High => "high",
        };
        format!("embree:{quality}:1{}", if self.robust { ":robust" } else { "" })
    }

    fn is_peer(&self) -> bool {
        true
    }

    fn trace(&self, query: Query, rays: &[Ray], hits: &mut [Hit], occluded: &mut [bool]) {
        let f = self.embree.functions;
        match query {
            Query::Closest => {
                for (ray, hit) in rays.iter().zip(hits) {
                    let mut query = RtcRayHit {
                        ray: rtc_ray(ray),
                        normal: [0.0; 3],
                        u: 0.0,
                        v: 0.0,
                        primitive: INVALID_ID,
                        geometry: INVALID_ID,
                        instance: INVALID_ID,
                        instance_primitive: INVALID_ID,
                        padding: [0; 3],
                    };
                    // SAFETY: the scene is committed, the record has Embree's layout and alignment,
                    // and null arguments mean the defaults.
                    unsafe { (f.intersect1)(self.scene, &mut query, std::ptr::null_mut()) };
                    *hit = if query.geometry == INVALID_ID {
                        Hit::MISS
                    } else {
                        Hit {
                            t: query.ray.t_far,
                            u: query.u,
                            v: query.v,
                            primitive: query.primitive,
                            geometry: query.geometry,
                            instance: 0,
                            kind: HitKind::TRIANGLE_FRONT,
                            reserved: 0,
                        }
                    };
                }
            }
            Query::Any => {
                for (ray, occluded) in rays.iter().zip(occluded) {
                    let mut query = rtc_ray(ray);
                    // SAFETY: as above.
                    unsafe { (f.occluded1)(self.scene, &mut query, std::ptr::null_mut()) };
                    *occluded = query.t_far == f32::NEG_INFINITY;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_have_embrees_layout() {
        assert_eq!((size_of::<RtcRay>(), align_of::<RtcRay>()), (48, 16));
        assert_eq!((size_of::<RtcRayHit>(), align_of::<RtcRayHit>()), (96, 16));
        assert_eq!(std::mem::offset_of!(RtcRayHit, geometry), 72);
    }

    #[test]
    fn a_missing_library_is_an_error() {
        let error = Embree::load(Path::new("no-such-library.so"), 1).err().expect("an error");
        assert!(error.to_string().contains("no-such-library.so"));
    }
}
