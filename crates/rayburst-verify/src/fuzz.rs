//! Any bytes as a soup of triangles and rays: every way to trace them must give the same bits, and
//! those of brute force.
//!
//! [`check`] is what a fuzzer calls; `cargo xtask fuzz` gives it the inputs of a generator of its own,
//! [`inputs::Mutator`]. Coordinates are any `f32` whatever: NaN, infinite, subnormal,
//! huge.

mod brute;
pub mod inputs;

use std::{fmt::Debug, sync::Arc};

use glam::Vec3;
use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, CandidateFilter, Counters, FilterFn, Instance, IsaLevel, Tlas,
    TraceMode, TraceOptions, TriangleMesh,
};
use rayburst_math::{Hit, Ray};

use inputs::Input;

/// Answers of a batch, compared by their bits.
#[derive(Clone, Debug, PartialEq)]
struct Answers {
    closest: Vec<Hit>,
    any: Vec<bool>,
}

/// What [`check`] traces.
trait Traced {
    fn trace(&self, rays: &[Ray], options: &TraceOptions, filter: &impl CandidateFilter)
    -> Answers;
    fn all(&self, rays: &[Ray], options: &TraceOptions, filter: &impl CandidateFilter) -> Vec<Hit>;
}

macro_rules! traced {
    ($structure:ty) => {
        impl Traced for $structure {
            fn trace(
                &self,
                rays: &[Ray],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) -> Answers {
                let mut closest = vec![Hit::MISS; rays.len()];
                let mut any = vec![false; rays.len()];
                self.closest_hits(rays, &mut closest, options, filter);
                self.any_hits(rays, &mut any, options, filter);
                let mut counted = vec![Hit::MISS; rays.len()];
                let mut counts = vec![Counters::default(); rays.len()];
                self.closest_hits_counted(rays, &mut counted, &mut counts, options, filter);
                assert_same("counting", &counted, &closest, rays);
                Answers { closest, any }
            }

            fn all(
                &self,
                rays: &[Ray],
                options: &TraceOptions,
                filter: &impl CandidateFilter,
            ) -> Vec<Hit> {
                // The first of each ray; the nearest few are the first few.
                let all = self.all_hits_batch(rays, options, filter);
                for k in [0, 1, 2, 5, usize::MAX] {
                    let nearest = self.nearest_hits_batch(rays, k, options, filter);
                    for (i, ray) in rays.iter().enumerate() {
                        let (hits, expected) = (nearest.of(i), all.of(i));
                        let expected = &expected[..k.min(expected.len())];
                        assert_eq!(hits.len(), expected.len(), "{k} nearest hits of {ray:?}");
                        let rays = vec![*ray; hits.len()];
                        assert_same(("nearest hits", k), hits, expected, &rays);
                    }
                }
                (0..rays.len()).map(|i| all.of(i).first().copied().unwrap_or(Hit::MISS)).collect()
            }
        }
    };
}

traced!(Blas);
traced!(Tlas);

fn bits(hit: &Hit) -> [u32; 8] {
    bytemuck::cast(*hit)
}

fn assert_same(what: impl Debug, hits: &[Hit], expected: &[Hit], rays: &[Ray]) {
    for ((hit, expected), ray) in hits.iter().zip(expected).zip(rays) {
        let same = bits(hit) == bits(expected);
        assert!(same, "{what:?}: {hit:?}, not {expected:?}, for {ray:?} ({:08x?})", words(ray));
    }
}

fn words(ray: &Ray) -> [u32; 8] {
    bytemuck::cast(*ray)
}

/// A filter that depends on its arguments alone.
fn sieve(index: u32, _: &Ray, hit: &Hit) -> bool {
    (index ^ hit.primitive ^ hit.t.to_bits()).count_ones() & 1 == 0
}

/// Checks one structure in every mode against the answers of one; returns the nearest hits.
fn check_modes(
    structure: &impl Traced,
    rays: &[Ray],
    options: TraceOptions,
    expected: Option<&[Answers; 2]>,
    name: &str,
) -> [Answers; 2] {
    let single = TraceOptions { mode: TraceMode::Single, ..options };
    let filter = FilterFn(sieve);
    let own = [structure.trace(rays, &single, &AcceptAll), structure.trace(rays, &single, &filter)];
    let expected = expected.unwrap_or(&own);
    for mode in TraceMode::ALL {
        let options = TraceOptions { mode, ..options };
        let name = (name, mode);
        let plain = structure.trace(rays, &options, &AcceptAll);
        let sieved = structure.trace(rays, &options, &filter);
        assert_same(name, &plain.closest, &expected[0].closest, rays);
        assert_same((name, "filtered"), &sieved.closest, &expected[1].closest, rays);
        assert_eq!(plain.any, expected[0].any, "{name:?}");
        assert_eq!(sieved.any, expected[1].any, "{name:?}, filtered");
        // Parts of the batch: bundles and rays in flight are others.
        let part = rays.len() / 3..rays.len();
        let answers = structure.trace(&rays[part.clone()], &options, &AcceptAll);
        let part_of = &expected[0].closest[part.clone()];
        assert_same((name, "part"), &answers.closest, part_of, &rays[part.clone()]);
        assert_eq!(answers.any, expected[0].any[part], "{name:?}, part");
    }
    for (expected, hits) in expected
        .iter()
        .zip([structure.all(rays, &single, &AcceptAll), structure.all(rays, &single, &filter)])
    {
        assert_same((name, "first of all"), &hits, &expected.closest, rays);
        let found = expected.closest.iter().map(Hit::is_hit);
        assert!(found.eq(expected.any.iter().copied()), "{name}: any is not closest");
    }
    own
}

/// Builds and traces what the bytes say in every way.
///
/// # Panics
/// If two ways disagree, a structure is not valid, or a build fails that should not.
pub fn check(bytes: &[u8]) {
    let input = Input::new(bytes);
    let (mut expected, mut expected_top, mut expected_refit) = (None, None, None);
    for isa in IsaLevel::available() {
        let build =
            BuildOptions { reference_budget: Some(input.budget), ..input.build.options(isa) };
        let mesh = TriangleMesh {
            opaque: input.opaque,
            ..TriangleMesh::new(&input.positions, &input.indices)
        };
        let (first, second) = input.indices.split_at(input.indices.len() / 3);
        let parts =
            [TriangleMesh { indices: first, ..mesh }, TriangleMesh { indices: second, ..mesh }];
        let blas = match Blas::build(&parts, &build) {
            Ok(blas) => blas,
            Err(error) => panic!("{}: {error}", isa.name()),
        };
        if let Err(defect) = blas.validate() {
            panic!("{}: {defect}", isa.name());
        }
        let rays = &input.rays;
        let answers = check_modes(&blas, rays, input.options, expected.as_ref(), isa.name());
        if expected.is_none() {
            let brute = brute::closest(&blas, &parts, rays, input.options.cull);
            assert_same("not brute force", &answers[0].closest, &brute, rays);
        }
        expected.get_or_insert(answers);

        let mut moved = match Blas::build(&parts, &build) {
            Ok(blas) => blas,
            Err(error) => panic!("{}: {error}", isa.name()),
        };
        let refit = parts.map(|part| TriangleMesh { positions: &input.moved, ..part });
        // Triangles that appear are an error, after which the structure is as before.
        let mut grown = blas.clone();
        let refitted = moved.refit(&refit);
        let every = (0..).zip(&parts).flat_map(|(geometry, part)| {
            (0..part.indices.len() as u32).map(move |primitive| (geometry, primitive))
        });
        let changed = grown.refit_changed(&refit, &every.collect::<Vec<_>>());
        assert_eq!(changed.is_ok(), refitted.is_ok(), "{changed:?} {refitted:?}");
        if let Err(defect) = grown.validate() {
            panic!("{}: refit of what changed: {defect}", isa.name());
        }
        if refitted.is_ok() {
            let answers =
                check_modes(&moved, rays, input.options, expected_refit.as_ref(), isa.name());
            if expected_refit.is_none() {
                let brute = brute::closest(&moved, &refit, rays, input.options.cull);
                assert_same("refit is not brute force", &answers[0].closest, &brute, rays);
            }
            check_modes(&grown, rays, input.options, Some(&answers), isa.name());
            expected_refit.get_or_insert(answers);
        }

        if !input.instances.is_empty() {
            let blases = vec![Arc::new(blas), Arc::new(moved)];
            let instances: Vec<Instance> =
                input.instances.iter().map(|instance| Instance { ..*instance }).collect();
            let tlas = match Tlas::build(blases, &instances, &build) {
                Ok(tlas) => tlas,
                Err(error) => panic!("{}: {error}", isa.name()),
            };
            if let Err(defect) = tlas.validate() {
                panic!("{}: {defect}", isa.name());
            }
            let answers =
                check_modes(&tlas, rays, input.options, expected_top.as_ref(), isa.name());
            expected_top.get_or_insert(answers);
        }
    }
}

/// The corners of a triangle as given.
fn corners(mesh: &TriangleMesh<'_>, triangle: usize) -> [Vec3; 3] {
    mesh.indices[triangle].map(|i| mesh.positions[i as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bundles_of_infinite_slack_meet_no_empty_slot() {
        check(include_bytes!("fuzz/infinite_slack.bin"));
    }

    #[test]
    fn slivers_are_hit_within_their_boxes() {
        check(include_bytes!("fuzz/sliver.bin"));
    }

    #[test]
    fn all_ways_agree_on_any_bytes() {
        check(&[]);
        let mut mutator = inputs::Mutator::new(1);
        for _ in 0..300 {
            check(&mutator.next_input());
        }
    }
}
