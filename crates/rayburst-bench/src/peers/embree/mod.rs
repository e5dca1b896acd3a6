//! Embree 4, through its shared library.

mod config;
mod ffi;
mod scene;
mod trace;

use std::{
    ffi::{CString, c_void},
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
};

use libloading::Library;

use self::ffi::{Functions, Handle};
pub use self::{
    config::{Config, Quality, SceneConfig, Width},
    scene::{EmbreeScene, Geometry, RefitScene},
    trace::EmbreeEngine,
};
use crate::BenchError;

/// The loaded library with a device.
pub struct Embree {
    functions: Functions,
    device: Handle,
    path: PathBuf,
    /// Bytes that the device holds; boxed, because the device has its address.
    memory: Box<AtomicI64>,
}

// SAFETY: Embree's devices and committed scenes may be used from any thread (API manual, "Thread
// Safety"); the functions are plain addresses.
unsafe impl Send for Embree {}
// SAFETY: as above.
unsafe impl Sync for Embree {}

impl Embree {
    /// Loads the library at `path` and opens a device that builds with `threads` threads.
    ///
    /// The device asks for huge pages, pins no threads and starts none before the first build.
    pub fn load(path: &Path, threads: usize) -> Result<Arc<Self>, BenchError> {
        let fail = |reason: String| BenchError::Peer { path: path.to_owned(), reason };
        // SAFETY: the user names Embree's library; its initialisers have no preconditions.
        let library = unsafe { Library::new(path) }.map_err(|e| fail(e.to_string()))?;
        let functions = Functions::find(&library, path)?;
        let config = format!("threads={threads},hugepages=1,set_affinity=0,start_threads=0");
        let config = CString::new(config).map_err(|e| fail(e.to_string()))?;
        // SAFETY: the configuration is a terminated string that outlives the call.
        let device = unsafe { (functions.new_device)(config.as_ptr()) };
        if device.is_null() {
            return Err(fail("rtcNewDevice gave no device".into()));
        }
        let memory = Box::new(AtomicI64::new(0));
        let counter = std::ptr::from_ref::<AtomicI64>(&memory).cast_mut().cast::<c_void>();
        // SAFETY: the counter lives in a box that is dropped after the device is released.
        unsafe { (functions.memory_monitor)(device, count_memory, counter) };
        let path = path.to_owned();
        // Never unloaded: its scheduler's threads may still run when the last device is gone.
        std::mem::forget(library);
        Ok(Arc::new(Self { functions, device, path, memory }))
    }

    /// Bytes that the device holds now: buffers and structures.
    pub fn memory(&self) -> i64 {
        self.memory.load(Ordering::Relaxed)
    }

    /// Fails if a call since the last check failed.
    fn check(&self, action: &str) -> Result<(), BenchError> {
        // SAFETY: the device is live.
        let error = unsafe { (self.functions.device_error)(self.device) };
        if error == 0 {
            return Ok(());
        }
        let reason = format!("error {error} while {action}");
        Err(BenchError::Peer { path: self.path.clone(), reason })
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        // SAFETY: the device is live and released once; scenes hold the library through an `Arc`.
        unsafe { (self.functions.release_device)(self.device) }
    }
}

/// Adds what Embree allocates and subtracts what it frees; true lets it go on.
unsafe extern "C" fn count_memory(counter: *mut c_void, bytes: isize, _after: bool) -> bool {
    // SAFETY: the pointer is that of the device's counter, which outlives the device.
    let counter = unsafe { &*counter.cast::<AtomicI64>() };
    counter.fetch_add(bytes as i64, Ordering::Relaxed);
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_library_is_an_error() {
        let error = Embree::load(Path::new("no-such-library.so"), 1).err().expect("an error");
        assert!(error.to_string().contains("no-such-library.so"));
    }

    #[test]
    fn memory_is_counted() {
        let counter = AtomicI64::new(5);
        let address = std::ptr::from_ref(&counter).cast_mut().cast();
        // SAFETY: the counter outlives the calls.
        let go_on =
            unsafe { count_memory(address, 100, false) && count_memory(address, -30, true) };
        assert!(go_on);
        assert_eq!(counter.load(Ordering::Relaxed), 75);
    }
}
