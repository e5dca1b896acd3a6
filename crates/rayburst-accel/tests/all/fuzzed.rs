//! What fuzzing found, each as small as it gets.

use std::sync::Arc;

use glam::{Affine3A, Mat3, Vec3};
use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, Instance, IsaLevel, Tlas, TraceMode, TraceOptions,
};
use rayburst_math::{Hit, Ray};

use crate::meshes::{Mesh, QUALITIES, with_isa};

/// Nearest hits in every mode, which must be the first of all hits.
fn check(closest: impl Fn(&TraceOptions) -> Vec<Hit>, first: &[Hit], name: &str) {
    for mode in TraceMode::ALL {
        let options = TraceOptions { mode, ..TraceOptions::default() };
        assert_eq!(closest(&options), first, "{name}, {mode:?}");
    }
}

#[test]
fn empty_slots_are_not_met_whatever_the_transform() {
    // The error of this transform is no number that `f32` has.
    let shear = Mat3::from_cols(Vec3::X, Vec3::new(1e30, 1.0, 0.0), Vec3::Z);
    let transforms = [Affine3A::from_mat3(shear), Affine3A::from_translation(Vec3::Z)];
    let mut mesh = Mesh::default();
    mesh.push([Vec3::ZERO, 1e-15 * Vec3::X, 1e-15 * Vec3::Y]);
    for isa in IsaLevel::available() {
        let instances = transforms.map(|transform| Instance::new(0, transform));
        let blases = vec![Arc::new(mesh.blas(isa))];
        let tlas = Tlas::build(blases, &instances, &with_isa(isa)).unwrap();
        assert_eq!(tlas.stats().primitives, 2);
        let rays: Vec<Ray> = (0..40)
            .map(|i| Ray::new(Vec3::new(2e-16, 2e-16, 3.0 - i as f32 * 0.1), -Vec3::Z))
            .collect();
        let all = tlas.all_hits_batch(&rays, &TraceOptions::default(), &AcceptAll);
        let first = |i: usize| all.of(i).first().copied().unwrap_or(Hit::MISS);
        let firsts: Vec<_> = (0..rays.len()).map(first).collect();
        assert!(firsts[0].is_hit());
        let closest = |options: &TraceOptions| {
            let mut hits = vec![Hit::MISS; rays.len()];
            tlas.closest_hits(&rays, &mut hits, options, &AcceptAll);
            hits
        };
        check(closest, &firsts, isa.name());
    }
}

#[test]
fn distances_that_round_to_the_same_subnormal_are_ties() {
    // The nearest comes last, and several heights are the same distance of such a ray.
    let mut mesh = Mesh::default();
    for i in 0..40 {
        let z = -0.5 - (39 - i) as f32 * 2f32.powi(-24);
        mesh.push([Vec3::new(-1.0, -1.0, z), Vec3::new(3.0, -1.0, z), Vec3::new(-1.0, 3.0, z)]);
    }
    let direction = Vec3::new(0.0, 0.0, -(2f32.powi(127)));
    let rays = [(); 9].map(|()| Ray::new(Vec3::ZERO, direction));
    for isa in IsaLevel::available() {
        for quality in QUALITIES {
            let options = BuildOptions { quality, isa: Some(isa), ..BuildOptions::default() };
            let blas = Blas::build(&[mesh.geometry()], &options).unwrap();
            let all = blas.all_hits_batch(&rays, &TraceOptions::default(), &AcceptAll);
            let first = all.of(0)[0];
            assert!(first.t < f32::MIN_POSITIVE && first.primitive < 39, "{first:?}");
            let closest = |options: &TraceOptions| {
                let mut hits = [Hit::MISS; 9];
                blas.closest_hits(&rays, &mut hits, options, &AcceptAll);
                hits.to_vec()
            };
            check(closest, &[first; 9], isa.name());
        }
    }
}
