//! The queries of both structures, in one text.

use std::ops::ControlFlow;

use rayburst_math::{Hit, Ray};

use crate::{AllHits, Blas, CandidateFilter, Counters, Tlas, TraceOptions};

macro_rules! queries {
    ($structure:ty, $visit:expr) => {
        impl $structure {
            /// The nearest hit of a ray, or [`Hit::MISS`].
            pub fn closest_hit(
                &self,
                ray: &Ray,
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) -> Hit {
                self.closest(0, ray, options, filter)
            }

            /// Whether a ray hits anything.
            pub fn any_hit(
                &self,
                ray: &Ray,
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) -> bool {
                self.closest(0, ray, options, filter).is_hit()
            }

            /// Every hit of a ray, nearest first; replaces what `hits` held.
            pub fn all_hits(
                &self,
                ray: &Ray,
                options: &TraceOptions,
                filter: &impl CandidateFilter,
                hits: &mut Vec<Hit>,
            ) {
                hits.clear();
                self.all(0, ray, options, filter, hits);
            }

            /// The nearest hit of each ray.
            ///
            /// # Panics
            /// If the slices differ in length.
            pub fn closest_hits(
                &self,
                rays: &[Ray],
                hits: &mut [Hit],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) {
                assert_eq!(rays.len(), hits.len(), "as many hits as rays");
                for (i, (ray, hit)) in rays.iter().zip(hits).enumerate() {
                    *hit = self.closest(i as u32, ray, options, filter);
                }
            }

            /// [`Self::closest_hits`], and what each ray visited.
            ///
            /// # Panics
            /// If the slices differ in length.
            pub fn closest_hits_counted(
                &self,
                rays: &[Ray],
                hits: &mut [Hit],
                counts: &mut [Counters],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) {
                assert_eq!(rays.len(), counts.len(), "as many counts as rays");
                counts.fill(Counters::default());
                self.closest_hits(rays, hits, options, filter);
            }

            /// Whether each ray hits anything.
            ///
            /// # Panics
            /// If the slices differ in length.
            pub fn any_hits(
                &self,
                rays: &[Ray],
                occluded: &mut [bool],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) {
                assert_eq!(rays.len(), occluded.len(), "as many answers as rays");
                for (i, (ray, hit)) in rays.iter().zip(occluded).enumerate() {
                    *hit = self.closest(i as u32, ray, options, filter).is_hit();
                }
            }

            /// [`Self::any_hits`], and what each ray visited.
            ///
            /// # Panics
            /// If the slices differ in length.
            pub fn any_hits_counted(
                &self,
                rays: &[Ray],
                occluded: &mut [bool],
                counts: &mut [Counters],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) {
                assert_eq!(rays.len(), counts.len(), "as many counts as rays");
                counts.fill(Counters::default());
                self.any_hits(rays, occluded, options, filter);
            }

            /// Every hit of each ray.
            pub fn all_hits_batch(
                &self,
                rays: &[Ray],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) -> AllHits {
                let mut result = AllHits { offsets: vec![0], hits: vec![] };
                for (i, ray) in rays.iter().enumerate() {
                    self.all(i as u32, ray, options, filter, &mut result.hits);
                    result.offsets.push(result.hits.len());
                }
                result
            }

            fn closest<F: CandidateFilter>(
                &self,
                index: u32,
                original: &Ray,
                options: &TraceOptions,
                filter: &F,
            ) -> Hit {
                let mut best = Hit::MISS;
                let mut ray = *original;
                let _ = $visit(self, &mut ray, options, &mut |ray: &mut Ray, hit: Hit, opaque| {
                    if hit.precedes(&best)
                        && (!F::ACTIVE || opaque || filter.accept(index, original, &hit))
                    {
                        best = hit;
                        ray.t_max = hit.t;
                    }
                    ControlFlow::Continue(())
                });
                best
            }

            fn all<F: CandidateFilter>(
                &self,
                index: u32,
                original: &Ray,
                options: &TraceOptions,
                filter: &F,
                hits: &mut Vec<Hit>,
            ) {
                let start = hits.len();
                let mut ray = *original;
                let _ = $visit(self, &mut ray, options, &mut |_: &mut Ray, hit: Hit, opaque| {
                    if !F::ACTIVE || opaque || filter.accept(index, original, &hit) {
                        hits.push(hit);
                    }
                    ControlFlow::Continue(())
                });
                hits[start..].sort_unstable_by(|a, b| {
                    if a.precedes(b) {
                        std::cmp::Ordering::Less
                    } else {
                        std::cmp::Ordering::Greater
                    }
                });
            }
        }
    };
}

queries!(Blas, |blas: &Blas, ray, options: &TraceOptions, visitor| blas.visit(
    ray,
    options.cull,
    visitor
));
queries!(Tlas, Tlas::visit);

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{Affine3A, Vec3};

    use super::*;
    use crate::{AcceptAll, BuildOptions, Instance, TriangleMesh};

    #[test]
    fn one_triangle_is_hit_through_an_instance() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]]);
        let blas = Blas::build(&[mesh], &BuildOptions::default()).unwrap();
        let instance = Instance::new(0, Affine3A::from_translation(Vec3::Z));
        let tlas =
            Tlas::build(vec![Arc::new(blas)], &[instance], &BuildOptions::default()).unwrap();
        let ray = Ray::new(Vec3::new(0.25, 0.25, 3.0), -Vec3::Z);
        let hit = tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
        assert_eq!((hit.t, hit.u, hit.v), (2.0, 0.25, 0.25));
        assert_eq!(hit.kind, rayburst_math::HitKind::TRIANGLE_FRONT);
    }
}
