//! Building Embree's scenes: once for tracing, again and again for timing.

use std::{
    ffi::c_int,
    sync::Arc,
    time::{Duration, Instant},
};

use super::{
    Embree, SceneConfig,
    ffi::{
        BUFFER_INDEX, BUFFER_VERTEX, FORMAT_FLOAT3, FORMAT_UINT3, GEOMETRY_TRIANGLE, Handle,
        QUALITY_REFIT, SCENE_COMPACT, SCENE_DYNAMIC, SCENE_ROBUST,
    },
};
use crate::{BenchError, FlatMesh};

/// A triangle mesh in Embree's own buffers.
pub struct Geometry {
    embree: Arc<Embree>,
    handle: Handle,
}

impl Embree {
    /// Copies a mesh into buffers of Embree.
    pub fn geometry(self: &Arc<Self>, mesh: &FlatMesh) -> Result<Geometry, BenchError> {
        let f = &self.functions;
        let (vertices, triangles) = (mesh.positions.len(), mesh.indices.len());
        // SAFETY: the handles are live and used as the API manual says; a buffer that Embree
        // allocates holds the requested items until the geometry is released.
        let handle = unsafe {
            let handle = (f.new_geometry)(self.device, GEOMETRY_TRIANGLE);
            let to = (f.new_buffer)(handle, BUFFER_VERTEX, 0, FORMAT_FLOAT3, 12, vertices);
            if !to.is_null() {
                mesh.positions
                    .as_ptr()
                    .cast::<u8>()
                    .copy_to_nonoverlapping(to.cast(), 12 * vertices);
            }
            let to = (f.new_buffer)(handle, BUFFER_INDEX, 0, FORMAT_UINT3, 12, triangles);
            if !to.is_null() {
                mesh.indices
                    .as_ptr()
                    .cast::<u8>()
                    .copy_to_nonoverlapping(to.cast(), 12 * triangles);
            }
            handle
        };
        let geometry = Geometry { embree: self.clone(), handle };
        self.check("copying the mesh")?;
        Ok(geometry)
    }
}

impl Geometry {
    /// A new scene of this mesh alone, not yet committed.
    fn scene(&self, geometry_quality: c_int, scene_quality: c_int, flags: c_int) -> EmbreeScene {
        let f = &self.embree.functions;
        // SAFETY: device and geometry are live; the scene keeps the geometry alive.
        let handle = unsafe {
            (f.geometry_quality)(self.handle, geometry_quality);
            (f.commit_geometry)(self.handle);
            let scene = (f.new_scene)(self.embree.device);
            (f.scene_quality)(scene, scene_quality);
            (f.scene_flags)(scene, flags);
            (f.attach_geometry)(scene, self.handle);
            scene
        };
        EmbreeScene { embree: self.embree.clone(), handle }
    }

    /// Builds a scene; also tells how long the build took and the bytes that it added.
    pub fn build(&self, config: SceneConfig) -> Result<(EmbreeScene, Duration, i64), BenchError> {
        let robust = if config.robust { SCENE_ROBUST } else { 0 };
        let compact = if config.compact { SCENE_COMPACT } else { 0 };
        let before = self.embree.memory();
        let quality = config.quality as c_int;
        let scene = self.scene(quality, quality, robust | compact);
        let time = scene.commit();
        self.embree.check("building")?;
        Ok((scene, time, self.embree.memory() - before))
    }

    /// Builds a scene whose mesh is going to move. Only scenes of low quality keep a structure a mesh
    /// that can be fitted anew; all others are rebuilt whole.
    pub fn build_refittable(&self) -> Result<RefitScene<'_>, BenchError> {
        let low = super::Quality::Low as c_int;
        let scene = self.scene(QUALITY_REFIT, low, SCENE_DYNAMIC);
        scene.commit();
        self.embree.check("building")?;
        Ok(RefitScene { geometry: self, scene })
    }
}

impl Drop for Geometry {
    fn drop(&mut self) {
        // SAFETY: the handle is live and released once; scenes have their own references.
        unsafe { (self.embree.functions.release_geometry)(self.handle) }
    }
}

/// A scene of one mesh.
pub struct EmbreeScene {
    pub(super) embree: Arc<Embree>,
    pub(super) handle: Handle,
}

// SAFETY: committed scenes may be traced from any thread.
unsafe impl Send for EmbreeScene {}
// SAFETY: as above.
unsafe impl Sync for EmbreeScene {}

impl EmbreeScene {
    fn commit(&self) -> Duration {
        let start = Instant::now();
        // SAFETY: the scene is live and nothing traces it now.
        unsafe { (self.embree.functions.commit_scene)(self.handle) };
        start.elapsed()
    }
}

impl Drop for EmbreeScene {
    fn drop(&mut self) {
        // SAFETY: the scene is live and released once, before its device.
        unsafe { (self.embree.functions.release_scene)(self.handle) }
    }
}

/// A scene whose boxes are fitted anew when the mesh has moved.
pub struct RefitScene<'a> {
    geometry: &'a Geometry,
    scene: EmbreeScene,
}

impl RefitScene<'_> {
    /// Fits the boxes to the vertices in the buffer; tells how long it took.
    pub fn refit(&mut self) -> Result<Duration, BenchError> {
        let f = &self.scene.embree.functions;
        let start = Instant::now();
        // SAFETY: the geometry is live and has this buffer; nothing traces the scene now.
        unsafe {
            (f.update_buffer)(self.geometry.handle, BUFFER_VERTEX, 0);
            (f.commit_geometry)(self.geometry.handle);
        }
        self.scene.commit();
        let time = start.elapsed();
        self.scene.embree.check("refitting")?;
        Ok(time)
    }
}
