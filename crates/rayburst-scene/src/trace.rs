//! Rays through a scene, with alpha decided on the way.
//!
//! Here and nowhere above are the kernels made for [`AlphaFilter`], so that they are compiled once.

use rayburst_accel::{AcceptAll, Counters, TraceOptions};
use rayburst_math::{Hit, Ray};

use crate::{AlphaFilter, FlatScene};

impl FlatScene {
    /// The closest hit of each ray, or [`Hit::MISS`]. `keys` are the roots of alpha decisions, one a ray,
    /// as for [`AlphaFilter`]; `None` makes everything opaque. Panics where slices that belong together
    /// differ in length.
    pub fn closest_hits(&self, rays: &[Ray], keys: Option<&[u32]>, hits: &mut [Hit]) {
        let options = TraceOptions::default();
        match keys {
            None => self.tlas.closest_hits(rays, hits, &options, &AcceptAll),
            Some(keys) => {
                assert_eq!(rays.len(), keys.len(), "as many keys as rays");
                self.tlas.closest_hits(rays, hits, &options, &AlphaFilter::new(self, keys));
            }
        }
    }

    /// As [`FlatScene::closest_hits`], and what each ray visited.
    pub fn closest_hits_counted(
        &self,
        rays: &[Ray],
        keys: &[u32],
        hits: &mut [Hit],
        counts: &mut [Counters],
    ) {
        assert_eq!(rays.len(), keys.len(), "as many keys as rays");
        let (options, filter) = (TraceOptions::default(), AlphaFilter::new(self, keys));
        self.tlas.closest_hits_counted(rays, hits, counts, &options, &filter);
    }

    /// Whether each ray hits anything; keys as for [`FlatScene::closest_hits`].
    pub fn any_hits(&self, rays: &[Ray], keys: Option<&[u32]>, occluded: &mut [bool]) {
        let options = TraceOptions::default();
        match keys {
            None => self.tlas.any_hits(rays, occluded, &options, &AcceptAll),
            Some(keys) => {
                assert_eq!(rays.len(), keys.len(), "as many keys as rays");
                self.tlas.any_hits(rays, occluded, &options, &AlphaFilter::new(self, keys));
            }
        }
    }

    /// The closest hit of one ray, or [`Hit::MISS`]; `None` for a key makes everything opaque.
    pub fn closest_hit(&self, ray: &Ray, key: Option<u32>) -> Hit {
        let options = TraceOptions::default();
        match &key {
            None => self.tlas.closest_hit(ray, &options, &AcceptAll),
            Some(key) => {
                let filter = AlphaFilter::new(self, std::slice::from_ref(key));
                self.tlas.closest_hit(ray, &options, &filter)
            }
        }
    }

    /// Whether one ray hits anything; `None` for a key makes everything opaque.
    pub fn any_hit(&self, ray: &Ray, key: Option<u32>) -> bool {
        let options = TraceOptions::default();
        match &key {
            None => self.tlas.any_hit(ray, &options, &AcceptAll),
            Some(key) => {
                let filter = AlphaFilter::new(self, std::slice::from_ref(key));
                self.tlas.any_hit(ray, &options, &filter)
            }
        }
    }
}
